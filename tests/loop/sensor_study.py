"""Compares sets of sensors in flights with many seeds, on a plant that fits the firmware's model and on other plants.

Prints the table of firmware/README.md and draws firmware/sensors.svg:
`PYTHONPATH=tools/docs .venv/bin/python tests/loop/sensor_study.py`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from pictures import BLUE, GREEN, ORANGE, figure, to_svg

SEEDS = 50
PLANTS: dict[str, dict[str, dict[str, object]]] = {
    "as in the firmware's model": {},
    "10 % heavier, motors 5 % weaker": {"parameters": {"mass": 0.99, "torque_constant": 0.18525}},
    "dry friction 5 mN m a wheel": {"effects": {"coulomb_friction": {"torque": 0.005}}},
    "wheels 2 % larger": {"parameters": {"wheel_radius": 0.041616}},
}
COLOURS = {"ideal": GREEN, "imu+encoders": BLUE, "imu": ORANGE}


def fly(sensors: str, changes: dict[str, dict[str, object]], seed: int) -> flight.Flight:
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), **changes)  # type: ignore[arg-type]
    return flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors=sensors, seed=seed))


def position_error(flown: flight.Flight) -> np.ndarray:
    log = flown.log
    return np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])


def main() -> None:
    drawn, axes = figure(len(PLANTS), row_height=1.7)
    print(
        "| plant | sensors | all 8 waypoints | waypoints, mean "
        "| error of the position estimate, rms, median (95th) | cross-track rms, median |"
    )
    print("|---|---|---|---|---|---|")
    for axis, (title, changes) in zip(axes, PLANTS.items(), strict=True):
        for sensors, colour in COLOURS.items():
            flights = [fly(sensors, changes, seed) for seed in range(1 if sensors == "ideal" else SEEDS)]
            figures = [flight_figures.summary(flown) for flown in flights]
            reached = np.array([figure["waypoints_reached"] for figure in figures])
            error = np.array([figure["position_estimate_error_m"] for figure in figures])
            cross = np.array([figure["cross_track_rms_m"] for figure in figures])
            print(
                f"| {title} | {sensors} | {np.mean(reached == 8):.0%} of {len(figures)} | {reached.mean():.1f} | "
                f"{1000 * np.median(error):.0f} mm ({1000 * np.percentile(error, 95):.0f} mm) "
                f"| {1000 * np.median(cross):.0f} mm |"
            )
            wrong = np.median([position_error(flown) for flown in flights], axis=0)
            axis.plot(flights[0].log["time_s"][::20], 1000 * wrong[::20], color=colour, label=sensors)
        axis.set_title(title, fontsize=9, loc="left")
        axis.set_ylabel("mm")
    axes[0].legend(loc="upper left", ncols=3)
    axes[-1].set_xlabel("time (s)")
    svg = to_svg(drawn, "error of the position estimate over time, median of the seeds")
    Path(__file__).resolve().parents[2].joinpath("firmware", "sensors.svg").write_text(svg + "\n")


if __name__ == "__main__":
    main()
