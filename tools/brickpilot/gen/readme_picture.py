"""Draws `tools/mission.svg`, the picture of the README: the mission with gyro and rotation sensors, seed 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.patches import Circle

from brickpilot.constants import ACCEPTANCE_M
from brickpilot.gen.svg_figure import BLUE, GREEN, GREY, ORANGE, figure, to_svg
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.flight import Flight
from brickpilot.vehicle.model import rcx


def track(flown: Flight) -> str:
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


def main() -> None:
    """Writes the picture; run from the root of a checkout."""
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0))
    Path("tools/mission.svg").write_text(track(flown), encoding="utf-8")


if __name__ == "__main__":
    main()
