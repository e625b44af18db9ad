"""Checks whether discovery gives one answer for a machine: cuts each log into parts and explains each part alone.

    python tests/lab/parts.py DATASET... [--parts 2] [--jobs 1] [--out parts.jsonl]

Each run is cut into `--parts` stretches of equal length, and part k holds stretch k of every run. Each part keeps its
likeliest explanations, which together hold 95 % of the weight. `compared` says when two parts agree. Each part is
saved when it is done, so an interrupted call continues where it stopped.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Any

import brickpilot as bp
import numpy as np
from brickpilot.data.dataset import Dataset, Run


def part(dataset: Dataset, index: int, count: int) -> Dataset:
    """Returns part `index` of `count`: stretch `index` of each run. The roles of the runs are chosen again."""
    return dataclasses.replace(dataset, runs=tuple(_cut(run, index, count) for run in dataset.runs))


def _cut(run: Run, index: int, count: int) -> Run:
    edges = np.linspace(0, len(run.time), count + 1).astype(int)
    rows = slice(edges[index], edges[index + 1])
    tables: dict[str, Any] = {
        name: {signal: values[rows] for signal, values in getattr(run, name).items()}
        for name in ("inputs", "outputs", "raw_outputs")
    }
    return dataclasses.replace(run, time=run.time[rows], role=None, replicate_of=None, initial={}, **tables)


def answer(dataset: Dataset, jobs: int) -> dict[str, Any]:
    """Returns a summary of the answer of discovery for a data set."""
    began = time.perf_counter()
    found = bp.discover(dataset, jobs=jobs)
    return {
        "verdict": found.verdict,
        "effects": [one.name for one in found.effects if one.claimed],
        "mechanism": found.mechanism,
        "explanations": [[list(one.effects), one.weight, list(one.mechanisms)] for one in found.explanations],
        "seconds": round(time.perf_counter() - began, 1),
    }


def compared(one: dict[str, Any], other: dict[str, Any]) -> str:
    """Returns how two answers compare: "agree", "contradict", or "only one tells".

    "agree": both answers share a mechanism, or both are `none`, or both are `unknown`. "contradict": both name
    mechanisms, but no common mechanism. "only one tells": at least one is `unknown` or `none`, as its part shows less.
    """
    if not {one["verdict"], other["verdict"]} <= {"named", "ambiguous"}:
        return "agree" if one["verdict"] == other["verdict"] else "only one tells"
    first, second = ({name for _, _, names in said["explanations"] for name in names} for said in (one, other))
    return "agree" if first & second else "contradict"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", nargs="+", type=Path)
    parser.add_argument("--parts", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("parts.jsonl"))
    options = parser.parse_args()
    known = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    done = {(one["log"], one["parts"], one["part"]): one for one in known}
    pairs = Counter[str]()
    for folder in options.datasets:
        dataset, said = bp.read(folder), []
        for index in range(options.parts):
            key = (folder.name, options.parts, index)
            if key not in done:
                made = answer(part(dataset, index, options.parts), options.jobs)
                done[key] = {"log": folder.name, "parts": options.parts, "part": index, **made}
                with options.out.open("a") as file:
                    file.write(json.dumps(done[key]) + "\n")
            said.append(done[key])
            sys.stdout.write(
                f"{folder.name} {index + 1}/{options.parts}: {said[-1]['verdict']} {said[-1]['effects']}\n"
            )
        pairs.update(compared(one, other) for one, other in combinations(said, 2))
    counted = ", ".join(f"{name} {count}" for name, count in sorted(pairs.items()))
    sys.stdout.write(f"{pairs.total()} pairs of parts: {counted}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
