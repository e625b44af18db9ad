"""The blind test of discovery: makes sets with `tests/hidden`, judges them one by one, and keeps a line for each.

The product never imports what makes the sets: it runs it as a program, from a checkout. Every set gives one line of
`results.jsonl`, appended whole; a line that is there is not made again, so that a long campaign can be interrupted and
taken up. What is printed is computed from those lines alone (`benchmark_table`).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brickpilot import __version__
from brickpilot.benchmark import sindy
from brickpilot.benchmark.sets import Maker, Task, truth_of
from brickpilot.data import dataset
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.descent import Progress

RESULTS = "results.jsonl"

Peer = Literal["sindy", "sindy-grid"]

_AT_ONCE = 8  # sets on the disk
_SIZE = re.compile(r"-x([0-9.]+)-")


def load(path: Path) -> list[dict[str, Any]]:
    """The results of a file, one of each set: the last one. A last line that was cut off is left out.

    Raises:
        InputError: no such file, or a line that is no result.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError("no results here: run the benchmark first", file=path) from error
    found: dict[tuple[str, str, int], dict[str, Any]] = {}
    for number, line in enumerate(text.split("\n")[:-1], 1):
        try:
            result = json.loads(line)
            found[result["engine"], result["name"], result["seed"]] = result
        except (ValueError, TypeError, KeyError) as error:
            raise InputError("is not a line that the benchmark wrote", file=path, line=number) from error
    return list(found.values())


def append(path: Path, result: Mapping[str, Any]) -> None:
    """Adds one line in one write, so that it is there whole or not at all; what was cut off before it is taken away."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = (json.dumps(result, allow_nan=False) + "\n").encode()
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.lseek(handle, 0, os.SEEK_END)
        if size and os.pread(handle, 1, size - 1) != b"\n":
            os.ftruncate(handle, path.read_bytes().rfind(b"\n") + 1)
        os.write(handle, line)
        os.fsync(handle)
    finally:
        os.close(handle)


def run(
    tasks: Sequence[Task], out: Path, *, maker: Maker | None, jobs: int, peer: Peer | None, progress: Progress
) -> list[dict[str, Any]]:
    """Judges the sets that OUT/results.jsonl does not hold yet, or holds with an error, and returns all it then holds.

    Args:
        maker: makes sets and experiments; None: the sets stand already, and no experiment is made.
        jobs: of each `discover`, and of what makes the sets.
        progress: called with (sets done, all sets, text) before each set.

    Raises:
        InputError: the peer is not installed.
        SimulationError: no set of a batch can be made.
    """
    why = sindy.missing() if peer else None
    if why:
        raise InputError(why, field="--peer")
    path = out / RESULTS
    kept = (
        {(one["engine"], one["name"], one["seed"]) for one in load(path) if not one["error"]}
        if path.exists()
        else set()
    )
    left = [task for task in tasks if task.key not in kept]
    done = len(tasks) - len(left)
    for batch in _batches(left):
        with tempfile.TemporaryDirectory(prefix="brickpilot-benchmark-") as scratch:
            for task, folder in _ready(batch, Path(scratch), maker, jobs):
                progress(done, len(tasks), task.name)
                with tempfile.TemporaryDirectory(prefix="brickpilot-experiment-") as further:
                    append(path, judge(task, folder, Path(further), maker, jobs, peer))
                if task.folder is None:
                    shutil.rmtree(folder, ignore_errors=True)
                done += 1
    return load(path)


def _batches(tasks: Sequence[Task]) -> Iterator[list[Task]]:
    """Some sets of one suite and engine at a time: neighbours share what is simulated."""
    for _, group in groupby(tasks, key=lambda task: (task.suite, task.engine, task.seed_offset)):
        same = list(group)
        yield from (same[start : start + _AT_ONCE] for start in range(0, len(same), _AT_ONCE))


def _ready(batch: Sequence[Task], scratch: Path, maker: Maker | None, jobs: int) -> Iterator[tuple[Task, Path]]:
    """The sets of a batch, each with its folder; one that could not be made has none there."""
    unmade = [task for task in batch if task.folder is None]
    if unmade and maker is not None:
        try:
            maker.make(unmade, scratch, jobs)
        except SimulationError:
            if not any((scratch / task.name).is_dir() for task in unmade):
                raise
    for task in batch:
        yield task, task.folder or scratch / task.name


def judge(task: Task, folder: Path, further: Path, maker: Maker | None, jobs: int, peer: Peer | None) -> dict[str, Any]:
    """The record of one set: truth, verdict, and what the suggested experiment and the peer made of it.

    Whatever goes wrong is kept as the record's `error`, so that one set does not end a campaign.
    """
    record: dict[str, Any] = {
        "name": task.name,
        "engine": task.engine,
        "seed": task.seed,
        "suite": task.suite,
        "seed_offset": task.seed_offset,
        "version": __version__,
        "error": None,
    }
    try:
        truth = truth_of(folder)
        record |= _facts(task.name, truth)
        began = time.perf_counter()
        data = dataset.read(folder)
        found = pipeline.discover(data, seed=0, jobs=jobs)
        record |= {"elapsed_s": round(time.perf_counter() - began, 2), **verdict(found)}
        record["held_out"] = held_out(found)
        asked = found.to_json()["next_experiment"]
        record["asked"] = None if asked is None else {key: asked.get(key) for key in ("name", "signal", "separation")}
        if asked is not None and maker is not None:
            made = maker.follow(folder, asked, further)
            if made is not None:
                record["follow"] = verdict(pipeline.discover(dataset.read(made), seed=0, jobs=jobs))
        if peer is not None:
            windows = sindy.WINDOWS_S if peer == "sindy-grid" else sindy.tuned_windows()
            record["peer"] = sindy.paths(
                data, found.nominal_model, found.simulated["nominal"], found.roles, found.noise_sd, windows
            )
    except Exception as error:
        text = " ".join(str(error).split())
        record = {**_facts(task.name, None), "verdict": "error", **record, "error": f"{type(error).__name__}: {text}"}
    return record


def _facts(name: str, truth: Mapping[str, Any] | None) -> dict[str, Any]:
    """What the table needs to know of the truth, and places for the verdict."""
    recipe = (
        {"hidden": None, "sensors": "imu", "noise": 1.0, "nominal_error": 0.0} if truth is None else truth["recipe"]
    )
    size = _SIZE.search(name)
    return {
        "hidden": recipe["hidden"],
        "sensors": recipe["sensors"],
        "noise": recipe["noise"],
        "nominal_error": recipe["nominal_error"],
        "size": float(size[1]) if size else None,
        "visibility": {} if truth is None else truth["visibility"],
        "effects": [],
        "term": None,
        "elapsed_s": None,
        "held_out": {"before": None, "after": None, "removed": None, "floor": None},
        "asked": None,
        "follow": None,
        "peer": None,
    }


def verdict(found: Finding) -> dict[str, Any]:
    """What the table needs of a finding: verdict, names, values, rivals and term."""
    full = found.to_json()
    return {
        "verdict": found.verdict,
        "effects": [
            {
                "name": effect["name"],
                "confidence": _finite(effect["confidence"]),
                "parameters": {
                    name: {"value": value["value"], "ci95": _interval(value["ci95"])}
                    for name, value in effect["parameters"].items()
                },
                "equivalents": [
                    {"name": other["name"], "worse_by": _finite(other["worse_by"])} for other in effect["equivalents"]
                ],
            }
            for effect in full["effects"]
        ],
        "term": None
        if found.term is None
        else {"equation": found.term.equation, "removed_held_out": _finite(found.term.removed_held_out)},
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _interval(ci95: Sequence[float] | None) -> list[float] | None:
    return None if ci95 is None or not np.all(np.isfinite(ci95)) else [float(value) for value in ci95]


def held_out(found: Finding) -> dict[str, Any]:
    """The gap on the held-out runs, over the noise floor: rms over all samples of (measured - simulated) / floor.

    The floor is what the data set states (noise and the converter's step), so that it does not hang on what discovery
    takes for noise; where it states none, it is what discovery found. `removed`: share of the mean square above it.
    """
    stated = {
        name: float(np.hypot(one.noise_sd, (one.resolution or 0.0) / 12**0.5))
        for name, one in found.dataset.signals.items()
        if one.noise_sd
    }
    known = all(name in stated for name in found.noise_sd)
    floor = {name: stated[name] if known else sd for name, sd in found.noise_sd.items()}
    squares: dict[str, list[NDArray[np.float64]]] = {"nominal": [], "augmented": []}
    for run in found.dataset.runs:
        if found.roles[run.name] != "held_out":
            continue
        for name, sd in floor.items():
            if name in run.outputs:
                for which, kept in squares.items():
                    off = (run.outputs[name] - found.simulated[which][run.name][name]) / sd
                    kept.append(off[np.isfinite(off)] ** 2)
    if not squares["nominal"]:
        return {"before": None, "after": None, "removed": None, "floor": None}
    before, after = (float(np.concatenate(kept).mean()) for kept in squares.values())
    removed = 1 - max(after - 1, 0.0) / (before - 1) if before > 1 else None
    return {
        "before": before**0.5,
        "after": after**0.5,
        "removed": removed,
        "floor": "stated" if known else "found",
    }
