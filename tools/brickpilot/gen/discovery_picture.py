"""Draws `tools/discovery.svg`, the second picture of the README: a hidden effect found on data of another engine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from brickpilot.data import reading
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding
from brickpilot.gen.svg_figure import BLUE, GREY, ORANGE, figure, to_svg
from brickpilot.report.plot import thin

SUITE, SET, SEED_OFFSET = "single", "coulomb_friction-x2-enc", 1_000_000
SIGNAL = "wheel_speed_left"


def _made(parent: Path) -> tuple[Path, dict[str, dict[str, float]]]:
    """Makes the data set by `tests/hidden`, which shares no code with the plant. Returns its folder and its truth."""
    command = [sys.executable, "-m", "hidden", SUITE, str(parent), "--seed-offset", str(SEED_OFFSET), "--only", SET]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": "tests"})
    truth = json.loads((parent / f"{SET}.truth.json").read_text(encoding="utf-8"))
    return parent / SET, truth["recipe"]["hidden"]


def draw(found: Finding, hidden: dict[str, dict[str, float]]) -> str:
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


def main() -> None:
    """Writes the picture; run from the root of a checkout."""
    with tempfile.TemporaryDirectory() as folder:
        made, hidden = _made(Path(folder))
        found = pipeline.discover(reading.read(made), seed=0)
    Path("tools/discovery.svg").write_text(draw(found, hidden), encoding="utf-8")


if __name__ == "__main__":
    main()
