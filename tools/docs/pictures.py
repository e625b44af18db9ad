"""Draws the pictures of the READMEs as SVG, by matplotlib, which the package does not need at run time.

`.venv/bin/python tools/docs/pictures.py` draws all of them, and with names only those. Run it from the root of a
checkout.

- mission: the mission with gyro and rotation sensors, seed 0.
- places: what runs where: on this machine, in simulators, on bricks.
- discovery: a hidden effect found on data of another engine.
- convergence: the plant's error against its motor step, at the body step of 3 ms.
"""

from __future__ import annotations

import argparse
import dataclasses
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from brickpilot.constants import ACCEPTANCE_M, STEP_S
from brickpilot.data import reading
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding
from brickpilot.report.plot import thin
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.flight import Flight
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, simulate
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

# These differ in lightness as well as in hue (Okabe & Ito 2008), and show on white and on near-black.
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#808080"

_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text, which can be selected and searched
    "svg.hashsalt": "brickpilot",  # the same figure gives the same bytes
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}


def figure(rows: int = 1, *, width: float = 8.0, row_height: float = 1.8) -> tuple[Figure, list[Axes]]:
    """Returns a figure with `rows` panels, one above the other, each `width` by `row_height` inches."""
    with matplotlib.rc_context(_STYLE):
        drawn = Figure(figsize=(width, rows * row_height + 0.4), layout="constrained")
        axes = drawn.subplots(rows, 1, sharex=True, squeeze=False)
    return drawn, [axes[row, 0] for row in range(rows)]


def to_svg(drawn: Figure, title: str) -> str:
    """Returns the figure as an `<svg>` element with the accessible name `title`. Black becomes grey."""
    buffer = io.StringIO()
    for legend in filter(None, (axis.get_legend() for axis in drawn.axes)):
        legend.set_frame_on(False)  # its box would be white in dark mode
    with matplotlib.rc_context(_STYLE):
        drawn.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"(?<=[:\s\"])#000000", GREY, svg)
    svg = re.sub(r"<text style=\"", f'<text fill="{GREY}" style="', svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1)


def mission_svg(flown: Flight) -> str:
    """Returns the track from above as SVG, x up and y to the right, over the waypoints and their acceptance circles."""
    log, mission = flown.log, flown.plan.scenario
    drawn, (axis,) = figure(width=7.0, row_height=6.2)
    corners = np.array([mission.start[:2], *mission.waypoints])
    axis.plot(corners[:, 1], corners[:, 0], color=GREY, linewidth=0.8, linestyle=":", label="legs")
    for number, (x, y) in enumerate(mission.waypoints, 1):
        axis.add_patch(Circle((y, x), ACCEPTANCE_M, fill=False, edgecolor=GREEN))
        axis.annotate(str(number), (y, x), ha="center", va="center", fontsize=9)
    axis.plot(log["true_y_m"], log["true_x_m"], color=BLUE, linewidth=1.6, label="true track")
    estimate = log["estimate_y_m"], log["estimate_x_m"]
    axis.plot(*estimate, color=ORANGE, linestyle="--", linewidth=0.9, label="estimated track")
    axis.plot(log["true_y_m"][0], log["true_x_m"][0], marker="o", color=BLUE, markersize=5)
    axis.set_xlabel("y, to the right (m)")
    axis.set_ylabel("x, forward at the start (m)")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), ncols=3)
    return to_svg(drawn, "track over the waypoints, seen from above")


def mission() -> None:
    """Writes `tools/mission.svg`."""
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0))
    Path("tools/mission.svg").write_text(mission_svg(flown), encoding="utf-8")


_PLANT, _WORLD = "plant: robot and sensors\nin double precision", "motors, sensors,\nfloor"
_ROWS = (
    ("brickpilot run", _PLANT, "hal/sil", "in one process", "firmware\nfor this machine", GREY),
    ("hil --link", _PLANT, "hal/link", "serial, TCP, CAN", "firmware\nfor this machine", GREY),
    ("hil --target h8sim", _PLANT, "hal/link", "simulator of the H8/300", "firmware for the\nRCX's processor", BLUE),
    ("hil --target avr:...", _PLANT, "hal/avr", "pins and volts, simavr", "image for the\nATmega328P or 2560", ORANGE),
    ("LEGO RCX", _WORLD, "hal/rcx", "brickOS, H8/3292", "image\nbrickpilot.lx", BLUE),
    ("Arduino Uno, Mega", _WORLD, "hal/avr", "ATmega328P, 2560", "image\nbrickpilot.hex", ORANGE),
)  # fmt: skip
_LEFT, _MIDDLE, _RIGHT, _WIDE, _HIGH = 2.8, 5.3, 7.7, 1.9, 0.62


def _box(axis: Axes, x: float, y: float, text: str, colour: str) -> None:
    corner = (x - _WIDE / 2, y - _HIGH / 2)
    axis.add_patch(FancyBboxPatch(corner, _WIDE, _HIGH, "round,pad=0.04", fill=False, edgecolor=colour, linewidth=1.4))
    axis.text(x, y, text, ha="center", va="center", fontsize=8)


def places_svg() -> str:
    """Returns the picture as SVG: a row for each place where the firmware runs, with its world and its port."""
    drawn, (axis,) = figure(width=8.6, row_height=5.2)
    axis.set_axis_off()
    axis.grid(visible=False)
    for number, (name, world, port, place, program, colour) in enumerate(_ROWS):
        y = -float(number)
        axis.text(0.0, y, name, ha="left", va="center", fontsize=9, fontweight="bold")
        _box(axis, _LEFT, y, world, GREEN)
        _box(axis, _RIGHT, y, program, colour)
        for start, end in ((_LEFT + _WIDE / 2 + 0.05, _MIDDLE - 0.62), (_MIDDLE + 0.62, _RIGHT - _WIDE / 2 - 0.05)):
            axis.annotate("", (end, y), (start, y), arrowprops={"arrowstyle": "<->", "color": GREY})
        axis.text(_MIDDLE, y + 0.06, port, ha="center", va="bottom", fontsize=9, color=colour)
        axis.text(_MIDDLE, y - 0.08, place, ha="center", va="top", fontsize=7)
    axis.set_xlim(-0.05, _RIGHT + _WIDE / 2 + 0.1)
    axis.set_ylim(-len(_ROWS) + 0.55, 0.45)
    return to_svg(
        drawn, "what runs where: the same firmware on this machine, in two simulators, on an RCX and on Arduinos"
    )


def places() -> None:
    """Writes `tools/places.svg`."""
    Path("tools/places.svg").write_text(places_svg(), encoding="utf-8")


SUITE, SET, SEED_OFFSET = "single", "coulomb_friction-x2-enc", 1_000_000
SIGNAL = "wheel_speed_left"


def _made(parent: Path) -> tuple[Path, dict[str, dict[str, float]]]:
    """Makes the data set by `tests/hidden`, which shares no code with the plant. Returns its folder and its truth."""
    command = [sys.executable, "-m", "hidden", SUITE, str(parent), "--seed-offset", str(SEED_OFFSET), "--only", SET]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": "tests"})
    truth = json.loads((parent / f"{SET}.truth.json").read_text(encoding="utf-8"))
    return parent / SET, truth["recipe"]["hidden"]


def discovery_svg(found: Finding, hidden: dict[str, dict[str, float]]) -> str:
    """Returns the picture as SVG: one held-out run before and after the found effect was added, and the error below."""
    run = next(run for run in found.dataset.runs if found.roles[run.name] == "held_out" and SIGNAL in run.outputs)
    measured = run.outputs[SIGNAL]
    before, after = (found.simulated[which][run.name][SIGNAL] for which in ("nominal", "augmented"))
    drawn, (top, bottom) = figure(2, width=7.0, row_height=1.9)
    for axis, lines in (
        (top, ((measured, "measured", GREY), (before, "nominal model", ORANGE), (after, "with the effect", BLUE))),
        (bottom, ((before - measured, "nominal model", ORANGE), (after - measured, "with the effect", BLUE))),
    ):
        for values, label, colour in lines:
            kept = thin(values[np.newaxis], 500)
            axis.plot(run.time[kept], values[kept], color=colour, label=label, linewidth=2.2 if colour == GREY else 1.1)
    effect = found.effects[0]
    name, parameter = next(iter(effect.parameters.items()))
    truth = hidden[effect.name][name]
    low, high = parameter.ci95 or (np.nan, np.nan)
    top.set_title(
        f"found: {effect.name}, {name} {1e3 * parameter.value:.2f} mN m ({1e3 * low:.2f} to {1e3 * high:.2f}); "
        f"hidden: {1e3 * truth:.2f} mN m",
        fontsize=9,
    )
    top.set_ylabel("left wheel, rad/s")
    bottom.set_ylabel("error, rad/s")
    bottom.set_xlabel(f"time of the held-out run {run.name}, s")
    top.legend(loc="best")
    return to_svg(drawn, "Measured and simulated wheel speed before and after discover added the missing effect")


def discovery() -> None:
    """Writes `tools/discovery.svg`."""
    with tempfile.TemporaryDirectory() as folder:
        made, hidden = _made(Path(folder))
        found = pipeline.discover(reading.read(made), seed=0)
    Path("tools/discovery.svg").write_text(discovery_svg(found, hidden), encoding="utf-8")


STEPS_MS = (0.75, 0.6, 0.3, 0.15, 0.075)
_REFERENCE_MS = 0.3 / 64
_SIGNALS = ("wheel_speed_left", "wheel_speed_right", "current_left", "current_right")


def convergence_errors(model: Model) -> list[float]:
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


def draw_convergence(path: Path) -> None:
    """Writes the plot as SVG; the same plant gives the same bytes."""
    with matplotlib.rc_context({"svg.hashsalt": "convergence", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(5.6, 3.6), layout="constrained")
        axes = figure.add_subplot()
        steps = np.array(STEPS_MS)
        for profile, marker in (("coupled", "o"), ("paper", "s")):
            found = convergence_errors(dataclasses.replace(rcx(), profile=profile))
            axes.loglog(steps, found, marker=marker, label=profile)
        axes.loglog(steps, found[-1] * (steps / steps[-1]) ** 2, "k:", linewidth=1, label="second order")
        axes.set_xticks(steps, [f"{step:g}" for step in STEPS_MS])
        axes.minorticks_off()
        axes.set_xlabel("motor step (ms)")
        axes.set_ylabel("rms error / largest value")
        axes.axvline(0.3, color="0.7", linewidth=1)
        axes.legend()
        figure.savefig(path, format="svg", metadata={"Date": None})


def convergence() -> None:
    """Writes `sim_host/convergence.svg`."""
    draw_convergence(Path("sim_host/convergence.svg"))


PICTURES: dict[str, Callable[[], None]] = {
    "mission": mission,
    "places": places,
    "discovery": discovery,
    "convergence": convergence,
}
"""Name of a picture -> what writes it."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="pictures.py", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    names = parser.parse_args().names or PICTURES
    if unknown := [name for name in names if name not in PICTURES]:
        parser.error(f"no picture {', '.join(unknown)}")
    for name in names:
        PICTURES[name]()


if __name__ == "__main__":
    main()
