"""Makes the table of the data recipe: what recordings of one simulated robot could tell, as `brickpilot check` says."""

from __future__ import annotations

from pathlib import Path

import brickpilot as bp
import numpy as np
import pandas as pd
from reference import table

PAGE = "tools/docs/data_recipe.md"
MARK = "<!-- what each recording tells -->"

STRAIGHT, SPIN, CURVE = ((1, 1), (-1, -1)), ((1, -1), (-1, 1)), ((1, 0.5), (0.5, 1))
LOW, MIDDLE, HIGH = 3.0, 5.0, 8.0
RUN_S = 6.0
RECIPE = "and curves: the recipe"

RECORDINGS: dict[str, tuple[list[tuple[float, float]], float]] = {
    "forward at one power, four times": ([(MIDDLE, MIDDLE)] * 4, 0.02),
    "forward at three powers": ([(volts, volts) for volts in (LOW, MIDDLE, HIGH)], 0.02),
    "and backward": ([(v * a, v * b) for v in (LOW, MIDDLE, HIGH) for a, b in STRAIGHT], 0.02),
    "and spins": ([(v * a, v * b) for v in (LOW, MIDDLE, HIGH) for a, b in STRAIGHT + SPIN], 0.02),
    RECIPE: ([(v * a, v * b) for v in (LOW, MIDDLE, HIGH) for a, b in STRAIGHT + SPIN + CURVE], 0.02),
    "the recipe, sampled five times a second": (
        [(v * a, v * b) for v in (LOW, MIDDLE, HIGH) for a, b in STRAIGHT + SPIN + CURVE],
        0.2,
    ),
}
"""What is driven -> the voltages of each run, and the step between samples in s."""


def stage(root: Path, pages: Path) -> None:
    """Puts the table into the staged recipe, where its mark stands."""
    page = pages / PAGE
    page.write_text(page.read_text(encoding="utf-8").replace(MARK, measured()), encoding="utf-8")


def measured() -> str:
    """Returns the table: recordings, and what `check` says of each."""
    worth = {name: bp.check(recording(*how), jobs=1) for name, how in RECORDINGS.items()}
    head = ("recording", "runs", "effects that it would show", "how large an effect has to be", "values that it tells")
    return table(head, (_row(name, one, worth[RECIPE]) for name, one in worth.items()))


def recording(runs: list[tuple[float, float]], step: float) -> bp.Dataset:
    """Returns the runs of the packaged robot, with encoders of 960 counts a turn and a gyro with noise."""
    frames = {f"r{number}": _run(*volts, step, number) for number, volts in enumerate(runs)}
    return bp.Dataset.from_frames(
        frames,
        vehicle="diff_drive",
        signals={
            "time": "t",
            "voltage_left": "left",
            "voltage_right": "right",
            "wheel_angle_left": "turned_left",
            "wheel_angle_right": "turned_right",
            "yaw_rate": "gyro",
        },
        nominal={name: bp.rcx().parameters[name] for name in ("mass", "wheel_radius", "half_track")},
    )


def _run(left: float, right: float, step: float, seed: int) -> pd.DataFrame:
    time = np.arange(0.0, RUN_S, step)
    driven = (time >= 1.0) & (time < RUN_S - 1.0)
    volts = np.where(driven[:, np.newaxis], [left, right], 0.0)
    (made,) = bp.simulate([(bp.rcx(), bp.OpenLoopRun(time, volts))])
    count = 2 * np.pi / 960
    angles = {
        f"turned_{side}": count * np.floor(made.outputs[f"wheel_angle_{side}"] / count) for side in ("left", "right")
    }
    gyro = made.outputs["yaw_rate"] + np.random.default_rng(seed).normal(0.0, 0.01, time.size)
    return pd.DataFrame({"t": time, "left": volts[:, 0], "right": volts[:, 1], **angles, "gyro": gyro})


def _row(name: str, worth: bp.Check, best: bp.Check) -> tuple[str, ...]:
    """Sizes are beside those of the recipe: the median ratio over the effects that both would show."""
    both = worth.visible.keys() & best.visible.keys()
    larger = float(np.median([worth.visible[one].size / best.visible[one].size for one in sorted(both)]))
    told = [f"`{parameter}`" for parameter, one in worth.parameters.items() if one.identifiable]
    times = "1" if worth is best else f"{larger:.1f} times as large"
    return name, str(len(worth.runs)), str(len(worth.visible)), times, ", ".join(told) or "none alone"
