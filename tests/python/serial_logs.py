"""Logs as a robot prints them: each line has time in ms, PWM of -255..255, encoder counts and three gyro axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEADER = "millis,pwmL,pwmR,encL,encR,gx,gy,gz"
DRIVES = ((1, 3, 180, 180), (5, 7, -120, 120), (9, 11, -200, -200), (13, 15, 200, 90))  # start, end, s; left, right PWM
COUNTS = 960  # encoder counts per turn of a wheel

MAPPING = [
    "time=millis:ms", "duty_left=pwmL*1/255", "duty_right=pwmR*1/255", "wheel_angle_left=encL*1/960:rotation",
    "wheel_angle_right=encR*1/960:rotation", "yaw_rate=gz:deg/s",
]  # fmt: skip


def driven(rows: int = 800, step_ms: int = 20) -> NDArray[np.float64]:
    """Returns (rows, 6): time, ms; PWM, left and right; counts, left and right; yaw rate, deg/s counter-clockwise.

    The wheels follow the PWM with a time constant of 0.1 s.
    """
    time = np.arange(rows) * step_ms
    pwm = np.zeros((rows, 2))
    for start, end, left, right in DRIVES:
        pwm[(time >= start * 1000) & (time < end * 1000)] = left, right
    speed, speeds = np.zeros(2), []
    for one in pwm:
        speeds.append(speed)
        speed = speed + (one / 255 * 30 - speed) * step_ms / 100
    turning = np.array(speeds)
    counts = np.round(np.cumsum(turning, axis=0) * step_ms / 1000 / (2 * np.pi) * COUNTS)
    return np.column_stack([time, pwm, counts, np.round((turning[:, 1] - turning[:, 0]) * 11.5, 2)])


def lines_of(log: NDArray[np.float64]) -> list[str]:
    """Returns the lines that the robot prints for the result of `driven`."""
    return [f"{row[0]:.0f},{row[1]:.0f},{row[2]:.0f},{row[3]:.0f},{row[4]:.0f},0.1,-0.2,{row[5]:.2f}" for row in log]


def write_log(path: Path, lines: list[str]) -> Path:
    """Writes lines with the line ends of a serial monitor, CR LF, and returns `path`."""
    path.write_bytes("".join(f"{line}\r\n" for line in lines).encode())
    return path
