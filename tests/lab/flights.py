"""Flies the paper's mission with one hidden effect at a time, and scores whether discovery names the effect.

    python tests/lab/flights.py DIR [--changed] [--sensors imu+encoders] [--count 24] [--seed 1] [--jobs 1]

With --changed, scores instead whether `changed` names the difference from an effect-free flight with another seed.

The effects are drawn from the library, at their preset sizes. The packaged IMU has biases that the nominal model lacks,
so an answer may always name `accel_bias` and `gyro_bias`, too. Each flight's data set and answer are kept in DIR, so an
interrupted call continues where it stopped.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from pathlib import Path
from typing import Any

import brickpilot as bp
import numpy as np
from brickpilot import catalogue
from brickpilot.cli.main import cli
from brickpilot.data import reading
from brickpilot.errors import SimulationError
from click.testing import CliRunner

BIASES = {"accel_bias", "gyro_bias"}


def drawn(count: int, seed: int) -> list[str]:
    """Returns the flights' effects: "" (no effect), and `count` effects of the library that have a preset size."""
    known = [one.name for one in catalogue.effects() if one.parameters and one.parameters[0].preset]
    return ["", *np.random.default_rng(seed).permutation(known)[:count].tolist()]


def data_of(effect: str, folder: Path, sensors: str, seed: int) -> Path:
    """Returns the data set of a flight with an effect; flies the flight if its data set does not exist yet."""
    made = folder / "data"
    if not made.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        sizes = {info.name: info.preset for info in catalogue.effect(effect).parameters} if effect else {}
        robot = dataclasses.replace(bp.rcx(), effects={effect: sizes} if effect else {})
        bp.save_model(robot, folder / "robot.toml")
        words = ["run", "--sensors", sensors, "--seed", str(seed), "--model", folder / "robot.toml"]
        CliRunner().invoke(cli, [str(one) for one in (*words, "--out", folder / "flight")])
        bp.import_log(folder / "flight", made)
    return made


def answer(effect: str, folder: Path, jobs: int) -> dict[str, Any]:
    """Returns the verdict on a flight, and its score: right, among rivals, silent (unknown or no effect), or wrong."""
    began = time.perf_counter()
    found = bp.discover(reading.read(folder / "data"), jobs=jobs)
    names = [one.name for one in found.effects if one.claimed]
    extra, truth = {*names} - BIASES, {effect} - {""}
    sets = [{*one.effects} - BIASES for one in found.explanations]
    said = "wrong"
    if found.verdict == "unknown" or (truth and not extra):
        said = "silent"
    elif found.verdict != "ambiguous" and extra == truth:
        said = "right"
    elif truth in sets:
        said = "among rivals"
    seconds = round(time.perf_counter() - began, 1)
    return {"effect": effect, "said": said, "verdict": found.verdict, "effects": names, "seconds": seconds}


def change(effect: str, folder: Path, before: Path, jobs: int) -> dict[str, Any]:
    """Returns the verdict of `changed` from the flight `before` to this flight, and its score by mechanism."""
    began = time.perf_counter()
    found = bp.changed(before, folder / "data", jobs=jobs)
    (verdict,) = found.verdicts.values()
    names, mechanisms = [one.what for one in found.changes], {one.mechanism for one in found.changes}
    truth = {catalogue.effect(effect).mechanism} if effect else set()
    sets = [names, *(rival for one in found.changes for rival in one.rivals)]
    said = "wrong"
    if verdict in ("nothing", "unknown"):
        said = "silent" if effect else "right"
    elif verdict == "changed" and mechanisms == truth:
        said = "right"
    elif verdict == "ambiguous" and any(effect in one for one in sets):
        said = "among rivals"
    seconds = round(time.perf_counter() - began, 1)
    return {"effect": effect, "said": said, "verdict": verdict, "effects": names, "seconds": seconds}


def main(words: list[str]) -> None:
    """Flies each effect, runs discovery, and prints a line for each effect and the number of flights of each score."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--changed", action="store_true")
    parser.add_argument("--sensors", default="imu+encoders")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args(words)
    counts: dict[str, int] = {}
    for effect in drawn(asked.count, asked.seed):
        folder = asked.out / (effect or "nothing")
        kept = folder / ("change.json" if asked.changed else "answer.json")
        if not kept.is_file():
            try:
                data_of(effect, folder, asked.sensors, asked.seed)
                if asked.changed:
                    before = data_of("", asked.out / "before", asked.sensors, asked.seed + 1)
                    told = change(effect, folder, before, asked.jobs)
                else:
                    told = answer(effect, folder, asked.jobs)
            except (bp.InputError, SimulationError) as error:
                told = {"effect": effect, "said": "error", "verdict": str(error), "effects": [], "seconds": 0.0}
            kept.write_text(json.dumps(told) + "\n", encoding="utf-8")
        told = json.loads(kept.read_text(encoding="utf-8"))
        counts[told["said"]] = counts.get(told["said"], 0) + 1
        print(f"{effect or 'nothing':28}{told['said']:14}{told['verdict']:11}{' + '.join(told['effects'])}", flush=True)
    print(", ".join(f"{said} {count}" for said, count in sorted(counts.items())))


if __name__ == "__main__":
    main(sys.argv[1:])
