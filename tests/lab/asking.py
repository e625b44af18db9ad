"""Counts the missions until a robot's hidden effect is known: for missions that `ask` chooses, and for a fixed order.

    python tests/lab/asking.py DIR [--count 24] [--seed 1] [--most 5] [--part 0 --parts 1]

Each robot has one hidden effect of the library, at a size drawn from 0.5 to 1.5 times its preset. The robot flies
over a TCP link on this machine. The effect is known when 95 % of the weight is on explanations that have this effect
and no other effect but biases of the packaged IMU. Answers are kept in DIR, so an interrupted call continues.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import brickpilot as bp
import numpy as np
from brickpilot import catalogue
from brickpilot.errors import SimulationError
from brickpilot.vehicle.scenario import Scenario

from lab.flights import BIASES

KNOWN = 0.95
KINDS = ("asked", "planned")


def truths(count: int, seed: int) -> list[tuple[str, dict[str, float]]]:
    """Returns (effect, its parameters) for `count` effects of the library that have a preset size."""
    drawn = np.random.default_rng(seed)
    known = [one for one in catalogue.effects() if one.parameters and one.parameters[0].preset]
    made = []
    for at in drawn.permutation(len(known))[:count]:
        first, *more = known[at].parameters
        size = float(np.clip(first.preset * drawn.uniform(0.5, 1.5), first.minimum, first.maximum))
        made.append((known[at].name, {first.name: size, **{one.name: one.preset for one in more}}))
    return made


def in_order(_found: bp.Finding, offered: Sequence[Scenario], driven: Sequence[str]) -> tuple[Scenario, str] | None:
    """Chooses the first mission that was not driven, whatever the data say."""
    new = [one for one in offered if one.title not in driven]
    return (new[0], "planned") if new else None


def answer(effect: str, sizes: dict[str, float], folder: Path, kind: str, most: int, seed: int) -> dict[str, Any]:
    """Returns the results of one robot; "needed": missions and seconds until its effect was known (None: never)."""
    folder.mkdir(parents=True, exist_ok=True)
    robot = folder / "robot.toml"
    bp.save_model(dataclasses.replace(bp.rcx(), effects={effect: sizes}), robot)
    asked = bp.ask(
        robot, link="tcp", most=most, seed=seed, jobs=1, out=folder / kind,
        choose=in_order if kind == "planned" else None,
    )  # fmt: skip
    seconds, missions, needed = 0.0, 0, None
    for one in asked.manoeuvres:
        seconds, missions = seconds + one.seconds, missions + 1
        held = sum(w for name, w in one.weights.items() if {*name.split(" + ")} - BIASES == {effect})
        if held >= KNOWN * sum(one.weights.values()):
            needed = {"missions": missions, "seconds": round(seconds, 1)}
            break
    names = {one.name for one in asked.finding.effects if one.claimed} - BIASES
    wrong = asked.finding.verdict == "named" and bool(names - {effect})
    last = asked.manoeuvres[-1].weights
    return {"effect": effect, "needed": needed, "stopped": asked.stopped, "wrong": wrong, "last": last,
            "missions": len(asked.manoeuvres)}  # fmt: skip


def main(words: list[str]) -> None:
    """Tries each robot with both kinds of choice, and prints a line for each answer, then the medians."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("out", type=Path)
    for name, default in (("count", 24), ("seed", 1), ("most", 5), ("part", 0), ("parts", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    given = parser.parse_args(words)
    answers: dict[str, list[dict[str, Any]]] = {kind: [] for kind in KINDS}
    for effect, sizes in truths(given.count, given.seed)[given.part :: given.parts]:
        for kind in KINDS:
            kept = given.out / effect / f"{kind}.json"
            if not kept.is_file():
                try:
                    told = answer(effect, sizes, kept.parent, kind, given.most, given.seed)
                except (bp.InputError, SimulationError) as error:
                    told = {"effect": effect, "needed": None, "stopped": str(error), "wrong": False, "last": {},
                            "missions": 0}  # fmt: skip
                kept.write_text(json.dumps(told) + "\n", encoding="utf-8")
            told = json.loads(kept.read_text(encoding="utf-8"))
            answers[kind].append(told)
            print(f"{effect:24}{kind:9}{told['needed'] or '-'!s:40}{told['stopped']:14}{told['last']}", flush=True)
    for kind, every in answers.items():
        needed = [one["needed"] for one in every if one["needed"]]
        if needed:
            missions, seconds = (statistics.median(one[key] for one in needed) for key in ("missions", "seconds"))
            counts = f"known {len(needed)} of {len(every)}, wrong {sum(one['wrong'] for one in every)}"
            print(f"{kind}: {counts}; median of the known: {missions:g} missions, {seconds:g} s")


if __name__ == "__main__":
    main(sys.argv[1:])
