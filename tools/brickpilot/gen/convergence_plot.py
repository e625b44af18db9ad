"""Draws `sim_host/convergence.svg`: the plant's error against its motor step, at the body step of 3 ms."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from brickpilot.constants import STEP_S
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, simulate

STEPS_MS = (0.75, 0.6, 0.3, 0.15, 0.075)
_REFERENCE_MS = 0.3 / 64
_SIGNALS = ("wheel_speed_left", "wheel_speed_right", "current_left", "current_right")


def errors(model: Model) -> list[float]:
    """Returns, for each of `STEPS_MS`, the largest rms error of a signal as a share of its largest value.

    The manoeuvre: forward, curve, spin, one wheel braked, one floating, backward, each for 0.51 s.
    The truth is the same plant with a motor step 64 times finer than the usual one.
    """
    pieces = [(6.0, 6.0), (7.0, 3.0), (-5.0, 5.0), (7.0, 0.0), (6.0, np.nan), (-8.0, -4.0)]
    inputs = np.repeat(np.array(pieces, dtype=np.float64), 170, axis=0)
    time = np.arange(len(inputs), dtype=np.float64) * STEP_S
    steps = [1e-3 * step for step in (_REFERENCE_MS, *STEPS_MS)]
    truth, *others = simulate([(model, OpenLoopRun(time, inputs, motor_step=step)) for step in steps])

    def share(name: str, got: dict[str, np.ndarray]) -> float:
        exact = truth.outputs[name]
        return float(np.sqrt(np.mean((got[name] - exact) ** 2)) / np.max(np.abs(exact)))

    return [max(share(name, other.outputs) for name in _SIGNALS) for other in others]


def draw(path: Path) -> None:
    """Writes the plot as SVG; the same plant gives the same bytes."""
    with mpl.rc_context({"svg.hashsalt": "convergence", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(5.6, 3.6), layout="constrained")
        axes = figure.add_subplot()
        steps = np.array(STEPS_MS)
        for profile, marker in (("coupled", "o"), ("paper", "s")):
            found = errors(dataclasses.replace(rcx(), profile=profile))
            axes.loglog(steps, found, marker=marker, label=profile)
        axes.loglog(steps, found[-1] * (steps / steps[-1]) ** 2, "k:", linewidth=1, label="second order")
        axes.set_xticks(steps, [f"{step:g}" for step in STEPS_MS])
        axes.minorticks_off()
        axes.set_xlabel("motor step (ms)")
        axes.set_ylabel("rms error / largest value")
        axes.axvline(0.3, color="0.7", linewidth=1)
        axes.legend()
        figure.savefig(path, format="svg", metadata={"Date": None})


def main() -> None:
    """Writes the plot; run from the root of a checkout."""
    draw(Path("sim_host/convergence.svg"))


if __name__ == "__main__":
    main()
