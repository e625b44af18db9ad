"""Draws `tools/mission.svg`, the picture of the README: the mission with gyro and rotation sensors, seed 0."""

from __future__ import annotations

from pathlib import Path

from brickpilot.report import run_page
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx

GREY = "#808080"  # legible on white and on black


def main() -> None:
    """Writes the picture; run from the root of a checkout."""
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0))
    svg = run_page.track(flown, flight_figures.summary(flown)).replace("currentColor", GREY)
    Path("tools/mission.svg").write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
