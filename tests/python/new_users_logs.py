"""Logs as a new user's Arduino writes them, of robots that engines other than the plant simulate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from hidden import measure
from hidden.manoeuvre import Manoeuvre, steps
from hidden.recipe import Recipe
from miswired_logs import COUNTS, FULL_V, ROBOTS
from numpy.typing import NDArray

STRAIGHT = (steps("straight", 6.0, (0.5, 5.5, 5.5), (5.0, 0, 0)),)
FOUR = (
    steps("ahead", 5.0, (0.5, 4.5, 4.5), (4.0, 0, 0)),
    steps("back", 5.0, (0.5, -3.5, -3.5), (4.0, 0, 0)),
    steps("spin", 5.0, (0.5, 3.0, -3.0), (4.0, 0, 0)),
    steps("curve", 5.0, (0.5, 4.2, 2.4), (4.0, 0, 0)),
)
MANY = (
    *FOUR,
    steps("spin_left", 5.0, (0.5, -4.0, 4.0), (4.0, 0, 0)),
    steps("fast", 5.0, (0.5, 8.0, 8.0), (4.0, 0, 0)),
    steps("curve_left", 5.0, (0.5, 3.0, 7.0), (4.0, 0, 0)),
    steps("slow", 5.0, (0.5, 2.5, 2.5), (4.0, 0, 0)),
)

WEAK_RIGHT = {"motor_asymmetry": {"difference": 2 * 0.12 / (2 - 0.12)}}
"""The right motor gets 12 % less than the left; their mean does not change."""


def stated(robot: str) -> list[str]:
    """Returns the command options by which a user states the measured values of the robot."""
    known = ROBOTS[robot]
    values = {name: getattr(known, name) for name in ("wheel_radius", "half_track", "mass", "resistance")}
    return [word for name, value in values.items() for word in ("--nominal", f"{name}={value}")]


def write_log(
    file: Path, robot: str, runs: Sequence[Manoeuvre], hidden: Mapping[str, Mapping[str, float]], seed: int = 1
) -> None:
    """Writes one log of all runs in sequence: ms, PWM of up to 255, counts (960 per turn), gyro in deg/s (FRD)."""
    recipe = Recipe(name="user", engine=robot, vehicle=ROBOTS[robot], runs=tuple(runs), hidden=hidden, seed=seed)
    random = np.random.default_rng(seed)
    rows, began, counted = ["millis,pwm_left,pwm_right,enc_left,enc_right,gz_dps"], 0.0, np.zeros(2)
    tracks = measure.tracks(recipe)
    for run, track, sensed in zip(runs, tracks, measure.sense(tracks, recipe), strict=True):
        time, left, right = run.held(recipe.sample_s)
        turns = [np.cumsum(sensed[f"wheel_speed_{side}"]) * recipe.sample_s / (2 * np.pi) for side in ("left", "right")]
        gyro = np.degrees(sensed["yaw_rate"] + random.normal(0.0, 0.014, time.size))
        assert len(gyro) == len(time), track
        for k in range(0, time.size, 3):
            counts = [int(np.floor(COUNTS * (counted[side] + turns[side][k]))) for side in (0, 1)]
            pwm = [round(255 * volts[k] / FULL_V) for volts in (left, right)]
            rows.append(f"{1000 * (began + time[k]):.0f},{pwm[0]},{pwm[1]},{counts[0]},{counts[1]},{gyro[k]:.2f}")
        began += float(time[-1]) + 0.009
        counted += [one[-1] for one in turns]
    file.write_text("\n".join([*rows, ""]))


def rewire(file: Path, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> None:
    """Applies `change`, for another wiring or encoder, to the two columns of counts in a log, (rows, 2)."""
    head, *rows = file.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    counts = change(np.array([[float(one[3]), float(one[4])] for one in cells]))
    for one, (left, right) in zip(cells, counts, strict=True):
        one[3:5] = [f"{left:.0f}", f"{right:.0f}"]
    file.write_text("\n".join([head, *map(",".join, cells), ""]))
