"""Makes the example logs beside it: `python make_logs.py` writes the same bytes each time.

Each is the log of the packaged robot with one effect that the packaged model lacks, as its own program would print it:
milliseconds, PWM from -255 to 255, encoder counts (960 a turn) and the gyro in deg/s, counter-clockwise positive.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import brickpilot as bp
import numpy as np

STEP_S, REST_S, DRIVE_S = 0.02, 1.0, 1.6
COUNTS = 960
MOVES = ((110, 110), (-140, -140), (140, -140), (-110, 110), (180, 90), (90, 180), (200, 200), (-180, 180), (160, 160))
HIDDEN = {
    "veers": {"wheel_radius_mismatch": {"mismatch": 0.06}},
    "stops_short": {"coulomb_friction": {"torque": 0.012}},
}
"""Log -> effect -> its parameters, SI."""


def log(effects: dict[str, dict[str, float]], seed: int) -> str:
    """Returns the text of a log: a rest before each move and after the last one."""
    random = np.random.default_rng(seed)
    packaged = bp.rcx()
    robot = dataclasses.replace(packaged, effects=effects)
    each = REST_S + DRIVE_S
    time = np.arange(0.0, each * len(MOVES) + REST_S, STEP_S)
    number = np.minimum((time / each).astype(int), len(MOVES) - 1)
    driven = (time - number * each >= REST_S) & (time < each * len(MOVES))
    pwm = np.where(driven[:, np.newaxis], np.array(MOVES)[number], 0)
    volts = pwm / 255 * packaged.parameters["battery_voltage"]
    (made,) = bp.simulate([(robot, bp.OpenLoopRun(time, volts))])
    counts = [np.floor(made.outputs[f"wheel_angle_{side}"] / (2 * np.pi) * COUNTS) for side in ("left", "right")]
    gyro = -np.degrees(made.outputs["yaw_rate"]) + random.normal(0.0, 0.4, time.size)
    rows = [
        f"{1000 * t:.0f},{left},{right},{one:.0f},{other:.0f},{turn:.2f}"
        for t, (left, right), one, other, turn in zip(time, pwm, *counts, gyro, strict=True)
    ]
    return "\n".join(["millis,pwmL,pwmR,encL,encR,gz", *rows, ""])


if __name__ == "__main__":
    for seed, (name, effects) in enumerate(HIDDEN.items()):
        Path(__file__).with_name(f"{name}.csv").write_text(log(effects, seed))
