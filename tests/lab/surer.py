"""Measures whether the answer of `why` stays the same, and becomes more certain, when a log has more runs.

    PYTHONPATH=tests:tests/python python tests/lab/surer.py [--logs 20] [--jobs 2] [--out surer.jsonl]

`why` gets one run, two runs, and all runs of a log. A log is of a simulated robot with one hidden fault, and states
wheel radius, half-track, mass, resistance and battery voltage. The logs differ in fault, robot, side and seed. The
answers on a log are saved when they are complete, so a call that was interrupted continues with the next log.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import brickpilot as bp
from hidden.effects import LIBRARY
from hidden.manoeuvre import Manoeuvre, steps
from miswired_logs import ROBOTS
from new_users_logs import MANY, write_log

FAULTS = (
    "motor_asymmetry", "coulomb_friction", "actuator_deadband", "wheel_radius_mismatch", "gyro_scale",
    "input_delay", "battery_sag", "gyro_bias", "yaw_scrub", "quadratic_drag",
)  # fmt: skip
FIRST = (steps("straight", 6.0, (0.5, 5.5, 5.5), (5.0, 0, 0)),)
SECOND = (steps("curve", 6.0, (0.5, 4.2, 2.4), (5.0, 0, 0)),)
SIZE = 2.0  # ratio of the size of a fault to the size at which the fault is clearly visible


def faulty(number: int) -> tuple[str, str, dict[str, dict[str, float]]]:
    """Returns the robot of log `number`, the name of its fault, and {the fault: its parameters}."""
    name = FAULTS[number % len(FAULTS)]
    robot = list(ROBOTS)[(number + number // len(FAULTS)) % len(ROBOTS)]
    effect = LIBRARY[name]
    sign = -1.0 if effect.signed and number >= len(FAULTS) else 1.0
    strong = ROBOTS[robot].mass / ROBOTS["mujoco"].mass if effect.kind in {"torque", "force", "moment"} else 1.0
    values = {
        key: effect.offset.get(key, 0.0) + (sign * SIZE * strong * value if key in effect.scaled else value)
        for key, value in effect.visible.items()
    }
    return robot, name, {name: values}


def asked(logs: list[Path], robot: str, jobs: int) -> dict[str, Any]:
    """Returns the answer of `why` to these logs; "widths": parameter -> relative width of its 95 % interval."""
    known = ROBOTS[robot]
    nominal = {name: getattr(known, name) for name in ("wheel_radius", "half_track", "mass", "resistance")}
    found = bp.why(logs, nominal={**nominal, "battery_voltage": 9.0}, jobs=jobs)
    widths = {}
    for effect in found.finding.effects:
        for name, one in effect.parameters.items():
            if one.ci95 is not None and one.value:
                widths[f"{effect.name}.{name}"] = (one.ci95[1] - one.ci95[0]) / abs(one.value)
    return {
        "ending": found.answer.ending,
        "verdict": found.finding.verdict,
        "mechanism": found.finding.mechanism,
        "names": sorted(one.name for one in found.finding.effects),
        "widths": widths,
        "what": found.answer.what,
    }


def row(number: int, jobs: int) -> dict[str, Any]:
    robot, name, hidden = faulty(number)
    with tempfile.TemporaryDirectory() as place:
        parts: tuple[tuple[Manoeuvre, ...], ...] = (FIRST, SECOND, MANY)
        logs = [Path(place, f"{letter}.csv") for letter in "abc"]
        for seed, (log, runs) in enumerate(zip(logs, parts, strict=True)):
            write_log(log, robot, runs, hidden, seed=10 * number + seed)
        answers = [asked(logs[:count], robot, jobs) for count in (1, 2, 3)]
    return {"log": number, "robot": robot, "hidden": name, "answers": answers}


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Returns the lines of a Markdown table: how many answers change from fewer to more runs, by kind of change."""
    found = ["| from | logs | named or ambiguous before | another mechanism | another name | narrower |"]
    found.append("|---|---|---|---|---|---|")
    for step, text in enumerate(("one run to two", "two runs to all")):
        pairs = [list(pairwise(one["answers"]))[step] for one in rows]
        said = [(a, b) for a, b in pairs if a["verdict"] in {"named", "ambiguous"}]
        moved = [(a, b) for a, b in said if a["mechanism"] and b["mechanism"] and a["mechanism"] != b["mechanism"]]
        renamed = [(a, b) for a, b in said if b["names"] and a["names"] != b["names"]]
        both = [(a["widths"][key], b["widths"][key]) for a, b in pairs for key in a["widths"] if key in b["widths"]]
        narrower = sum(after < before for before, after in both)
        found.append(
            f"| {text} | {len(pairs)} | {len(said)} | {len(moved)} | {len(renamed)} | {narrower} of {len(both)} |"
        )
    last = [one["answers"][-1] for one in rows]
    right = sum(one["hidden"] in answer["names"] for one, answer in zip(rows, last, strict=True))
    found.append(f"\nOf all runs the hidden fault is among the names in {right} of {len(rows)}.")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("surer.jsonl"))
    given = parser.parse_args()
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    for number in range(len(rows), given.logs):
        rows.append(row(number, given.jobs))
        with given.out.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
        print(number, rows[-1]["hidden"], [(one["verdict"], one["names"]) for one in rows[-1]["answers"]], flush=True)
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
