"""The page of a flight: its track, its signals, and the signals inside the controller."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from brickpilot.constants import ACCEPTANCE_M
from brickpilot.report.plot import BLUE, GREEN, GREY, ORANGE, PURPLE, figure, thin, to_svg
from brickpilot.report.template import render
from brickpilot.vehicle.flight import Flight

PHASES = ("begin", "brake", "turn", "drive", "end")


def _lines(axis: Axes, flight: Flight, lines: list[tuple[str, str, str]], label: str, scale: float = 1.0) -> None:
    """Draws columns of the log, given as (column, legend, colour) and multiplied by `scale`, against time."""
    time = flight.log["time_s"]
    for column, legend, colour in lines:
        axis.plot(*thin(time, flight.log[column] * scale), color=colour, label=legend)
    axis.set_ylabel(label)
    axis.legend(loc="upper right", ncols=len(lines))


def track(flight: Flight, figures: dict[str, Any]) -> str:
    """Draws the track from above, x up and y to the right, over the waypoints and their acceptance circles."""
    log, scenario = flight.log, flight.plan.scenario
    drawn, (axis,) = figure(width=7.0, row_height=6.2)
    if scenario.waypoints:
        corners = np.array([scenario.start[:2], *scenario.waypoints])
        axis.plot(corners[:, 1], corners[:, 0], color=GREY, linewidth=0.8, linestyle=":", label="legs")
        for number, ((x, y), moment) in enumerate(zip(scenario.waypoints, figures["reached_at_s"], strict=True), 1):
            colour = GREEN if moment is not None else ORANGE
            axis.add_patch(Circle((y, x), ACCEPTANCE_M, fill=False, edgecolor=colour))
            axis.annotate(str(number), (y, x), ha="center", va="center", fontsize=9)
    axis.plot(log["true_y_m"], log["true_x_m"], color=BLUE, linewidth=1.6, label="true track")
    if scenario.waypoints and flight.plan.sensors != "ideal":
        axis.plot(
            log["estimate_y_m"],
            log["estimate_x_m"],
            color=ORANGE,
            linestyle="--",
            linewidth=0.9,
            label="estimated track",
        )
    axis.plot(log["true_y_m"][0], log["true_x_m"][0], marker="o", color=BLUE, markersize=5)
    axis.set_xlabel("y, to the right (m)")
    axis.set_ylabel("x, forward at the start (m)")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), ncols=3)
    return to_svg(drawn, "track over the waypoints, seen from above")


def motion(flight: Flight) -> str:
    """Draws the true motion and its measurement."""
    drawn, axes = figure(4)
    mission = flight.plan.scenario.kind == "mission"
    speed = [("true_speed_m_s", "true", BLUE)]
    _lines(axes[0], flight, [("estimate_speed_m_s", "estimate", ORANGE), *speed] if mission else speed, "surge (m/s)")
    gyro = [("measured_yaw_rate_rad_s", "measured", GREY)] if flight.plan.sensors != "ideal" else []
    _lines(axes[1], flight, [*gyro, ("true_yaw_rate_rad_s", "true", BLUE)], "yaw rate (rad/s)")
    accel = [("measured_accel_surge_m_s2", "measured", GREY)] if flight.plan.sensors != "ideal" else []
    _lines(axes[2], flight, [*accel, ("true_accel_surge_m_s2", "true", BLUE)], "surge accel. (m/s²)")
    _lines(
        axes[3],
        flight,
        [("left_wheel_rad_s", "left wheel", BLUE), ("right_wheel_rad_s", "right wheel", ORANGE)],
        "rad/s",
    )
    axes[-1].set_xlabel("time (s)")
    return to_svg(drawn, "speeds and accelerations over time")


def electrical(flight: Flight) -> str:
    """Draws the voltages and currents of the motors."""
    drawn, axes = figure(2)
    _lines(axes[0], flight, [("left_voltage_v", "left", BLUE), ("right_voltage_v", "right", ORANGE)], "voltage (V)")
    _lines(
        axes[1],
        flight,
        [("left_current_a", "left", BLUE), ("right_current_a", "right", ORANGE)],
        "current (mA)",
        1000.0,
    )
    axes[-1].set_xlabel("time (s)")
    return to_svg(drawn, "motor voltages and currents over time")


def inside(flight: Flight) -> str:
    """Draws the phase, demand and estimate, the parts of the PIDs, the cross-track error and the estimate's error."""
    drawn, axes = figure(6)
    degrees = 180.0 / np.pi
    axes[0].plot(flight.log["time_s"], flight.log["phase"], color=PURPLE, drawstyle="steps-post")
    axes[0].set_yticks(range(5), PHASES)
    axes[0].set_ylabel("phase")
    _lines(
        axes[1],
        flight,
        [("demand_speed_m_s", "demand", GREEN), ("estimate_speed_m_s", "estimate", ORANGE)],
        "speed (m/s)",
    )
    _lines(axes[2], flight, [("heading_error_rad", "line of sight minus heading", PURPLE)], "heading (deg)", degrees)
    parts = [
        ("speed_p_v", "speed P", BLUE),
        ("speed_i_v", "speed I", ORANGE),
        ("yaw_p_v", "yaw P", GREEN),
        ("yaw_d_v", "yaw D", PURPLE),
    ]
    _lines(axes[3], flight, parts, "efforts (V)")
    _lines(axes[4], flight, [("cross_track_m", "right of the leg", BLUE)], "cross-track (m)")
    log = flight.log
    error = np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])
    axes[5].plot(*thin(log["time_s"], error * 1000.0), color=ORANGE)
    axes[5].set_ylabel("estimate's\nerror (mm)")
    axes[5].set_xlabel("time (s)")
    return to_svg(drawn, "signals inside the controller over time")


def verdict(flight: Flight, figures: dict[str, Any]) -> str:
    """Returns the result of the flight in one sentence."""
    plan = flight.plan
    if plan.scenario.kind == "manoeuvre":
        return (
            f"At the end of {plan.scenario.duration:g} s: {figures['final_speed_m_s']:.3f} m/s and "
            f"{figures['final_yaw_rate_rad_s']:.3f} rad/s in the {plan.model.profile} profile."
        )
    last = [moment for moment in figures["reached_at_s"] if moment is not None]
    when = f", the last after {last[-1]:.1f} s" if last else ""
    return (
        f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached in order{when}, "
        f"in the {plan.model.profile} profile with {plan.sensors} sensors."
    )


def rim_speed(flight: Flight) -> float:
    """Returns the mean rim speed of the left wheel over the last 0.9 s, in m/s."""
    return flight.plan.model.parameters["wheel_radius"] * float(np.mean(np.abs(flight.log["left_wheel_rad_s"][-300:])))


def page(flight: Flight, figures: dict[str, Any], command: str) -> str:
    """Returns the page as one self-contained HTML text; `command` is the command line that repeats the flight."""
    mission = flight.plan.scenario.kind == "mission"
    return render(
        "run",
        title=flight.plan.scenario.title,
        verdict=verdict(flight, figures),
        figures=figures,
        mission=mission,
        waypoints=flight.plan.scenario.waypoints,
        track=track(flight, figures),
        motion=motion(flight),
        electrical=electrical(flight),
        inside=inside(flight) if mission else None,
        rim_speed=rim_speed(flight),
        effects=flight.plan.model.effects,
        packaged=flight.plan.scenario.packaged,
        command=command,
    )
