"""Flies the mission on robots that the firmware does not know, without and with what `brickpilot discover` found.

    PYTHONPATH=tests .venv/bin/python tests/loop/robot_study.py [--robots N] [--out DIR]

Each robot is drawn at random, with one hidden effect that the firmware can undo. The planar engine of `tests/hidden`,
which shares no code with the plant, drives it through eight runs of 5 s. `brickpilot discover` reads the log and
nominal values with errors of 5 % (sd), and writes `compensation.toml`. Then the firmware, whose constants are those of
the packaged robot, flies the mission on the plant with the robot's true values. The program prints the table of
firmware/README.md, and writes the figures to robots.json beside this file.
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
from brickpilot.vehicle import compensation, flight, flight_figures, scenario
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.model import Model, rcx
from hidden import effects, folder
from hidden.manoeuvre import Manoeuvre, short
from hidden.recipe import Hidden, Recipe, Vehicle

FIGURES = Path(__file__).with_name("robots.json")
ROBOTS, SEEDS, STREAM = 20, 5, 14
NOMINAL_ERROR = 0.05  # relative sd
SENSORS = ("imu+encoders", "imu")
UNDONE = tuple(name for name in effects.LIBRARY if compensation.undone(name))
SIZES = (0.5, 2.0)  # range of an effect's size; an effect of size 1 shows clearly in a log
HELD = 4 / 3  # ratio of the dry friction to the constant load that it holds at rest
# rad/s at full voltage. The sensors read wheel speeds to 51 and yaw rates to 10.5; the runs spin at 3.3 of 9 V.
FASTEST_WHEEL, FASTEST_SPIN = 45.0, 22.0


@dataclasses.dataclass(frozen=True)
class Robot:
    """A robot with its true values."""

    name: str
    vehicle: Vehicle
    hidden: Hidden

    @property
    def model(self) -> Model:
        """The plant with the true values."""
        parameters = {**rcx().parameters, **dataclasses.asdict(self.vehicle)}
        presets = {one.name: {info.name: 0.0 for info in one.parameters} for one in catalogue.effects()}
        chosen = {name: {**presets[name], **table} for name, table in self.hidden.items()}
        return dataclasses.replace(rcx(), name=self.name, parameters=parameters, effects=chosen)


def _vehicle(random: np.random.Generator) -> Vehicle:
    """Draws a vehicle: mass, size, battery, speed and acceleration are random, and the motors follow from these."""

    def between(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    mass, battery = between(0.3, 8.0), between(6.5, 14.0)
    radius, half_track = between(0.02, 0.06), between(0.05, 0.15)
    top_speed, acceleration = between(0.8, 2.0), between(2.5, 8.0)  # m/s without load, m/s^2 from rest; at full voltage
    emf = battery * radius / top_speed
    torque = emf * random.uniform(0.75, 1.0)  # gears lose up to a quarter of the torque
    wheel_inertia = between(0.02, 0.4) * mass * radius**2 / 2
    stall = acceleration * (wheel_inertia / radius + mass * radius / 2)
    return Vehicle(
        mass=mass,
        yaw_inertia=mass * (half_track * between(0.9, 1.5)) ** 2,
        half_track=half_track,
        wheel_radius=radius,
        wheel_inertia=wheel_inertia,
        resistance=torque * battery / stall,
        inductance=torque * battery / stall * between(2e-4, 1e-3),
        torque_constant=torque,
        emf_constant=emf,
        viscous_friction=between(0.005, 0.03) * stall * radius / top_speed,
        rolling_friction=between(0.01, 0.02),
        battery_voltage=battery,
    )


def draw(number: int) -> Robot:
    """Draws robot `number`. A robot too fast for the logging sensors is drawn again."""
    random = np.random.default_rng([STREAM, number])
    while True:
        vehicle = _vehicle(random)
        speed = vehicle.battery_voltage / vehicle.emf_constant
        if speed < FASTEST_WHEEL and speed * vehicle.wheel_radius / vehicle.half_track < FASTEST_SPIN:
            break
    effect = UNDONE[number % len(UNDONE)]
    size = float(np.exp(random.uniform(*np.log(SIZES))))
    hidden = {effect: effects.draw(effect, size, vehicle, random)}
    if effect == "constant_offset":  # friction holds the robot at rest, where it learns the gyro's bias
        hidden["coulomb_friction"] = {"torque": HELD * sum(abs(torque) for torque in hidden[effect].values())}
    return Robot(f"robot-{number}", vehicle, hidden)


def _scaled(run: Manoeuvre, factor: float) -> Manoeuvre:
    left, right = (tuple(factor * volts for volts in side) for side in (run.left, run.right))
    return dataclasses.replace(run, left=left, right=right)


def measure(robot: Robot, number: int, parent: Path) -> Path:
    """Writes the data set of a robot into `parent`, with voltages that suit its battery. Keeps an existing data set."""
    runs = tuple(_scaled(run, robot.vehicle.battery_voltage / 9.0) for run in short())
    recipe = Recipe(
        robot.name, robot.hidden, robot.vehicle, "planar", nominal_error=NOMINAL_ERROR, runs=runs, seed=STREAM + number
    )
    made = parent / robot.name
    return made if made.exists() else folder.write(recipe, parent)


def discover(data: Path, out: Path) -> tuple[dict[str, Any], Compensation | None]:
    """Returns the verdict of `brickpilot discover` and the compensation that it writes."""
    command = [Path(sys.executable).with_name("brickpilot"), "discover", data, "--out", out, "--json"]
    done = subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True)
    written = out / "compensation.toml"
    return json.loads(done.stdout), compensation.load(written) if written.exists() else None


def fly(robot: Robot, known: Compensation | None, sensors: str, seeds: int) -> list[dict[str, Any]]:
    """Returns the figures of the packaged mission for each seed."""
    mission = scenario.load(scenario.packaged()["mission"])
    return [
        flight_figures.summary(
            flight.fly(flight.plan(mission, robot.model, sensors=sensors, seed=seed, compensation=known))
        )
        for seed in range(seeds)
    ]


def study(number: int, parent: Path, seeds: int = SEEDS) -> dict[str, Any]:
    """Returns the hidden and the found effects of a robot, and how many waypoints each of its missions reached."""
    robot = draw(number)
    verdict, known = discover(measure(robot, number, parent), parent / f"{robot.name}-found")
    flown = {
        f"{sensors}, {how}": [figures["waypoints_reached"] for figures in fly(robot, told, sensors, seeds)]
        for sensors in SENSORS
        for how, told in (("without", None), ("with", known))
    }
    return {
        "robot": robot.name,
        "mass_kg": round(robot.vehicle.mass, 2),
        "battery_V": round(robot.vehicle.battery_voltage, 1),
        "hidden": list(robot.hidden),
        "verdict": verdict["verdict"],
        "found": [effect["name"] for effect in verdict["effects"]],
        "elapsed_s": verdict["elapsed_s"],
        "remarks": list(known.remarks) if known else [],
        "waypoints": flown,
    }


def missions(figures: dict[str, Any], how: str) -> int:
    """Returns how many missions of the kind `how` ("SENSORS, without" or "SENSORS, with") reached all 8 waypoints."""
    return sum(reached == 8 for reached in figures["waypoints"][how])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--robots", type=int, default=ROBOTS)
    options.add_argument("--out", metavar="DIR", type=Path, default=Path("runs/robot-study"), help="logs and verdicts")
    chosen = options.parse_args()
    print("| robot | mass, battery | hidden | verdict | imu+encoders | imu | no setting carries |")
    print("|---|---|---|---|---|---|---|")
    rows = []
    for number in range(chosen.robots):
        row = study(number, chosen.out)
        rows.append(row)
        counts = " | ".join(
            f"{missions(row, f'{sensors}, without')} -> {missions(row, f'{sensors}, with')} of {SEEDS}"
            for sensors in SENSORS
        )
        limits = ", ".join(remark.split(":")[0] for remark in row["remarks"])
        found = f"{row['verdict']}: {', '.join(row['found'])}" if row["found"] else row["verdict"]
        size = f"{row['mass_kg']} kg, {row['battery_V']} V"
        print(f"| {number} | {size} | {', '.join(row['hidden'])} | {found} | {counts} | {limits} |", flush=True)
    lines = ",\n".join(json.dumps(row) for row in rows)
    FIGURES.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    for sensors in SENSORS:
        whole = {how: sum(missions(row, f"{sensors}, {how}") == SEEDS for row in rows) for how in ("without", "with")}
        print(
            f"{sensors}: all {SEEDS} missions flown by {whole['without']} of {len(rows)} robots without, "
            f"{whole['with']} with"
        )


if __name__ == "__main__":
    main()
