"""Tunes the gains of three robots other than the packaged robot; the tuning knows each robot only from its log.

    PYTHONPATH=tests .venv/bin/python tests/loop/tune_study.py [--jobs N] [--out DIR]

The planar engine of `tests/hidden`, which shares no code with the plant, drives each robot, with one hidden effect,
through eight runs. `brickpilot discover` reads the log and nominal values that are 5 % off. `brickpilot tune` starts
from the gains that `brickpilot firmware` gives the model that was found, and flies robots that the log allows. Then
1,000 fresh robots fly with the gains before and after tuning, and so does the plant with the true values, which the
tuning did not know. The program prints the table of tools/docs/benchmarks.md, and writes the figures to tuned.json
beside this file.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot import catalogue
from brickpilot.campaign.robots import Robot
from brickpilot.constants import STEP_S
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.firmware import simulate
from brickpilot.firmware.robot import load
from brickpilot.tune import task as problems
from brickpilot.tune.tuner import problem, rate
from brickpilot.vehicle import gains, scenario
from brickpilot.vehicle.model import Model, rcx
from hidden import folder
from hidden.manoeuvre import short
from hidden.recipe import Hidden, Recipe, Vehicle
from lab import real_table

FIGURES = Path(__file__).with_name("tuned.json")
ROOT = Path(__file__).parents[2]
STREAM, NOMINAL_ERROR = 17, 0.05
FASTEST_WHEEL = 40.0  # largest wheel speed, rad/s, in the logged runs: the sensors read up to 51
TRUE_SEEDS = 50


@dataclasses.dataclass(frozen=True)
class Study:
    """A true robot, its board, its sensors, tables for its model file, and the number of waypoints of its mission."""

    vehicle: Vehicle
    hidden: Hidden
    board: str
    sensors: str
    tables: str = ""
    waypoints: int = 4


ROBOTS = {
    "small": Study(
        Vehicle(
            mass=0.3, yaw_inertia=0.0006, half_track=0.045, wheel_radius=0.021, wheel_inertia=4e-6, resistance=6.0,
            inductance=0.002, emf_constant=0.12, torque_constant=0.1, battery_voltage=7.4,
        ),
        {"motor_asymmetry": {"difference": 0.08}},
        "rcx",
        "imu",
        "[sensors.encoder]\ncounts_per_turn = 120\n[sensors.imu]\ngyro_range = 17.45\n",
        8,
    ),
    "middle": Study(
        Vehicle(
            mass=2.4, yaw_inertia=0.03, half_track=0.1, wheel_radius=0.035, wheel_inertia=3e-4, resistance=1.4,
            inductance=0.001, emf_constant=0.3, torque_constant=0.24, battery_voltage=12.0,
        ),
        {"coulomb_friction": {"torque": 0.06}},
        "avr",
        "imu+encoders",
    ),
    "heavy": Study(
        Vehicle(
            mass=8.0, yaw_inertia=0.2, half_track=0.14, wheel_radius=0.055, wheel_inertia=4e-3, resistance=4.0,
            inductance=0.003, emf_constant=0.6, torque_constant=0.5, battery_voltage=12.0,
        ),
        {"gyro_scale": {"error": 0.05}},
        "rcx",
        "imu",
        "[robot]\nlength = 0.32\n",
    ),
}  # fmt: skip
"""Robots of 0.3 to 8 kg, as in tests/python/test_firmware.py except for the effect of the first robot."""


def measure(name: str, one: Study, parent: Path) -> Path:
    """Writes the data set of a robot into `parent`, at speeds that its sensors can log. Keeps an existing data set."""
    battery = one.vehicle.battery_voltage
    factor = battery / 9.0 * min(1.0, FASTEST_WHEEL / (battery / one.vehicle.emf_constant))
    runs = tuple(
        dataclasses.replace(
            run, **{side: tuple(factor * volts for volts in getattr(run, side)) for side in ("left", "right")}
        )
        for run in short()
    )
    recipe = Recipe(
        name, one.hidden, one.vehicle, "planar", nominal_error=NOMINAL_ERROR, runs=runs, seed=STREAM + len(name)
    )
    return parent / name if (parent / name).exists() else folder.write(recipe, parent)


def command(*words: str) -> dict[str, Any]:
    """Runs a command of the checkout with --json, and returns what it prints."""
    program = str(Path(sys.executable).with_name("brickpilot"))
    done = subprocess.run([program, *words, "--json"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def truth(one: Study, name: str) -> Model:
    """Returns the model with the true parameters of the robot and of its hidden effect."""
    presets = {effect.name: {info.name: 0.0 for info in effect.parameters} for effect in catalogue.effects()}
    effects = {effect: {**presets[effect], **table} for effect, table in one.hidden.items()}
    return dataclasses.replace(
        rcx(), name=name, parameters={**rcx().parameters, **dataclasses.asdict(one.vehicle)}, effects=effects
    )


def route(one: Study, model: Path, file: Path) -> str:
    """Writes the first waypoints of the robot's mission, with their share of its duration; returns the file."""
    whole = simulate.mission(load(model), None)
    share = one.waypoints / len(whole.waypoints)
    length = round((simulate.REST_S + share * (whole.duration - simulate.REST_S)) / STEP_S) * STEP_S
    title, points = f"{whole.title}; {one.waypoints} of them", whole.waypoints[: one.waypoints]
    mission = dataclasses.replace(whole, title=title, waypoints=points, duration=length)
    file.write_text(scenario.render_mission(mission), encoding="utf-8")
    return str(file)


def true_flights(name: str, one: Study, model: Path, tuned: Path, mission: str | None) -> dict[str, Any]:
    """Flies the true robot before and after tuning; each flight has its own sensor noise and biases."""
    given = problem(model, one.board, one.sensors, mission, SD_SHARE, STREAM)
    devices = given.allowed.devices
    found: dict[str, Any] = {}
    for how, raw in (("before", given.start), ("after", gains.load(tuned / "gains.toml").raw)):
        flown = [fly_true(given, devices, truth(one, name), raw, seed) for seed in range(TRUE_SEEDS)]
        own = rate(flown)
        arrived = [each for each in flown if each.success]
        found[how] = {
            "successes": own.successes,
            "flights": own.robots,
            "cross_track_m": round(float(np.mean([each.cross_track for each in arrived])), 5) if arrived else None,
            "time_s": round(float(np.mean([each.time for each in arrived])), 3) if arrived else None,
        }
    return found


def fly_true(given: problems.Problem, devices: Any, model: Model, raw: problems.Raw, seed: int) -> problems.Outcome:
    """Returns the outcome of one flight of the true robot, with biases drawn by `seed`."""
    random = np.random.default_rng([STREAM, seed])
    biases = {key: float(random.normal(0.0, abs(value))) for key, value in devices.items() if "_bias" in key}
    own = Robot(seed, model, {**devices, **biases}, seed)
    [outcome] = problems.outcomes([given.planned(own, raw)])
    return outcome


def study(name: str, parent: Path, jobs: int, budget: str, robots: int) -> dict[str, Any]:
    """Returns the hidden and the found effects, and the success rates of the mission before and after tuning."""
    one = ROBOTS[name]
    data, found, tuned = measure(name, one, parent), parent / f"{name}-found", parent / f"{name}-tuned"
    model = found / "model.toml"
    if not model.exists():  # an existing result is kept, like the log
        command("discover", str(data), "--jobs", str(jobs), "--out", str(found))
        model.write_text(model.read_text() + one.tables)  # the joint uncertainty stays in verdict.json
    verdict = json.loads((found / "verdict.json").read_text())
    mission = route(one, model, parent / f"{name}-mission.toml") if one.waypoints < 8 else None
    words = [
        "--board",
        one.board,
        "--sensors",
        one.sensors,
        "--budget",
        budget,
        "--robots",
        str(robots),
        "--jobs",
        str(jobs),
    ]
    figures = command(
        "tune",
        "--model",
        str(model),
        *words,
        *(["--scenario", mission] if mission else []),
        "--out",
        str(tuned),
        "--seed",
        str(STREAM),
    )
    kept = ("kept_start", "sensors", "mission", "explanations", "success", "gained", "lost", "p", "changes", "failures")
    return {
        "robot": name,
        "mass_kg": one.vehicle.mass,
        "board": one.board,
        "hidden": list(one.hidden),
        "verdict": verdict["verdict"],
        "found": [effect["name"] for effect in verdict["effects"]],
        **{key: figures[key] for key in kept},
        "gains": {key: [each["before"], each["after"], each["unit"]] for key, each in figures["gains"].items()},
        "flights": figures["flights"],
        "truth": true_flights(name, one, model, tuned, mission),
    }


def shown(row: dict[str, Any]) -> str:
    """Returns the row of the table."""
    rates = []
    for how in ("before", "after"):
        own = row["success"][how]
        low, high = (100 * end for end in own["ci95"])
        rates.append(f"{100 * own['share']:.1f} % ({low:.1f}..{high:.1f})")
    track, time = (row["changes"][name] for name in ("cross-track", "time"))
    true = [f"{row['truth'][how]['successes']}" for how in ("before", "after")]
    return " | ".join(
        [
            f"| {row['mass_kg']:g} kg, `{row['board']}`, `{row['sensors']}`",
            f"{', '.join(f'`{name}`' for name in row['hidden'])}: {row['verdict']}",
            *rates,
            f"{row['gained']}, {row['lost']}; {row['p']:.1g}",
            f"{1e3 * track['before']:.0f} -> {1e3 * track['after']:.0f} mm",
            f"{time['before']:.1f} -> {time['after']:.1f} s",
            f"{true[0]} -> {true[1]} of {TRUE_SEEDS} |",
        ]
    )


MARKS = ("<!-- gains -->", "<!-- end of gains -->")
HEAD = (
    "| robot, board, sensors | hidden: verdict | success before | success after | only after, only before; p "
    "| cross-track rms | time | the true robot |\n|---|---|---|---|---|---|---|---|"
)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", metavar="DIR", type=Path, default=Path("runs/tune-study"), help="logs and results")
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--budget", default="88", help="of `brickpilot tune`")
    options.add_argument("--robots", type=int, default=16, help="of `brickpilot tune`")
    options.add_argument("--robot", choices=ROBOTS, action="append", help="this one alone; repeatable")
    options.add_argument("--write", metavar="FILE.md", type=Path, help="write the table between its marks, too")
    chosen = options.parse_args()
    parent = chosen.out.resolve()
    for name in chosen.robot or ROBOTS:
        keep(study(name, parent, chosen.jobs, chosen.budget, chosen.robots))
    print("\n".join(table()))
    if chosen.write is not None:
        real_table.write_between_marks(chosen.write, table(), MARKS)


def table() -> list[str]:
    """Returns the lines of the table, from the kept figures."""
    return [*HEAD.split("\n"), *map(shown, kept().values())]


def kept() -> dict[str, dict[str, Any]]:
    """Returns the rows of the file of figures, in the order of `ROBOTS`."""
    rows = {row["robot"]: row for row in json.loads(FIGURES.read_text())} if FIGURES.exists() else {}
    return {name: rows[name] for name in ROBOTS if name in rows}


def keep(row: dict[str, Any]) -> None:
    """Puts a row into the file of figures, in place of an older row of the same robot."""
    rows = kept() | {row["robot"]: row}
    lines = ",\n".join(json.dumps(rows[name]) for name in ROBOTS if name in rows)
    FIGURES.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
