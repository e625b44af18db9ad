"""The page of a flight: its track, which can be played, its signals, and the signals inside the controller."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.report.plot import Colour, Curve, Figure, Panel, to_html
from brickpilot.report.template import render
from brickpilot.report.track import track_to_html
from brickpilot.vehicle.flight import Flight

PHASES = ("begin", "brake", "turn", "drive", "end")
LINK = "run"
"""The link of all figures of a flight."""

_DEGREES = 180.0 / np.pi
_AT_REST_S = 1.0  # of rest at the end that a figure shows
_MOVES = 1e-3  # a smaller change of place, m, or of heading, rad, is rest
Array = NDArray[np.float64]
Line = tuple[str, str, Colour]


def samples(flight: Flight) -> int:
    """Returns how many samples of the flight are drawn: until a second after robot and motors rest for good."""
    log = flight.log
    driven = np.nan_to_num(np.abs(log["left_voltage_v"]) + np.abs(log["right_voltage_v"])) > 0
    away = np.hypot(log["true_x_m"] - log["true_x_m"][-1], log["true_y_m"] - log["true_y_m"][-1])
    turned = np.abs(log["true_heading_rad"] - log["true_heading_rad"][-1])
    moves = np.flatnonzero(driven | (away > _MOVES) | (turned > _MOVES))
    last = log["time_s"][moves[-1] if len(moves) else 0] + _AT_REST_S
    return int(np.searchsorted(log["time_s"], last, side="right"))


def _panel(flight: Flight, label: str, unit: str, lines: list[Line], scale: float = 1.0) -> Panel:
    """Returns a panel of columns of the log, given as (column, legend, colour) and multiplied by `scale`."""
    count = samples(flight)
    return Panel(
        label, unit, [Curve(name, scale * flight.log[column][:count], colour) for column, name, colour in lines]
    )


def _figure(flight: Flight, title: str, panels: list[Panel]) -> Markup:
    return to_html(Figure(title, flight.log["time_s"][: samples(flight)], panels, link=LINK))


def track(flight: Flight, figures: dict[str, Any]) -> Markup:
    """Draws the track from above, x up and y to the right, over the waypoints and their acceptance circles."""
    scenario, count = flight.plan.scenario, samples(flight)
    log = {name: column[:count] for name, column in flight.log.items()}
    lines = [Curve("true track", np.array([log["true_y_m"], log["true_x_m"]]), "blue", 4.0)]
    if scenario.waypoints and flight.plan.sensors != "ideal":
        estimate = np.array([log["estimate_y_m"], log["estimate_x_m"]])
        lines.append(Curve("estimated track", estimate, "orange", 1.5))
    if scenario.waypoints:
        legs = np.array([scenario.start[:2], *scenario.waypoints]).T
        lines.append(Curve("legs", legs[::-1], "grey", 1.0, dashed=True))
    reached = [moment is not None for moment in figures.get("reached_at_s", [])]
    circles = [(y, x, flight.plan.acceptance, done) for (x, y), done in zip(scenario.waypoints, reached, strict=True)]
    return track_to_html(log["time_s"], log["true_heading_rad"], lines, circles, link=LINK)


def motion(flight: Flight) -> Markup:
    """Draws the true motion and its measurement."""
    mission, measured = flight.plan.scenario.kind == "mission", flight.plan.sensors != "ideal"

    def beside(column: str, name: str, colour: Colour, true: str, *, wanted: bool) -> list[Line]:
        return [*([(column, name, colour)] if wanted else []), (true, "true", "blue")]

    speed = beside("estimate_speed_m_s", "estimate", "orange", "true_speed_m_s", wanted=mission)
    gyro = beside("measured_yaw_rate_rad_s", "measured", "grey", "true_yaw_rate_rad_s", wanted=measured)
    surge = beside("measured_accel_surge_m_s2", "measured", "grey", "true_accel_surge_m_s2", wanted=measured)
    wheels: list[Line] = [("left_wheel_rad_s", "left", "blue"), ("right_wheel_rad_s", "right", "orange")]
    panels = [
        _panel(flight, "surge speed", "m/s", speed),
        _panel(flight, "yaw rate", "rad/s", gyro),
        _panel(flight, "surge acceleration", "m/s^2", surge),
        _panel(flight, "wheel speed", "rad/s", wheels),
    ]
    return _figure(flight, "speeds and accelerations over time", panels)


def electrical(flight: Flight) -> Markup:
    """Draws the voltages and currents of the motors."""
    panels = [
        _panel(
            flight, "motor voltage", "V", [("left_voltage_v", "left", "blue"), ("right_voltage_v", "right", "orange")]
        ),
        _panel(
            flight, "motor current", "A", [("left_current_a", "left", "blue"), ("right_current_a", "right", "orange")]
        ),
    ]
    return _figure(flight, "motor voltages and currents over time", panels)


def inside(flight: Flight) -> Markup:
    """Draws the phase, demand and estimate, the parts of the PIDs, the cross-track error and the estimate's error."""
    count, log = samples(flight), flight.log
    error = np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])[:count]
    demand: list[Line] = [("demand_speed_m_s", "demand", "green"), ("estimate_speed_m_s", "estimate", "orange")]
    efforts: list[Line] = [
        ("speed_p_v", "speed P", "blue"),
        ("speed_i_v", "speed I", "orange"),
        ("yaw_p_v", "yaw P", "green"),
        ("yaw_d_v", "yaw D", "purple"),
    ]
    panels = [
        Panel("phase of guidance", "", [Curve("phase", log["phase"][:count], "purple", shape="step")], rows=PHASES),
        _panel(flight, "speed", "m/s", demand),
        _panel(flight, "line of sight minus heading", "°", [("heading_error_rad", "heading", "purple")], _DEGREES),
        _panel(flight, "efforts of the PIDs", "V", efforts),
        _panel(flight, "distance to the right of the leg", "m", [("cross_track_m", "cross-track", "blue")]),
        Panel("error of the position estimate", "m", [Curve("error", error, "orange")]),
    ]
    return _figure(flight, "signals inside the controller over time", panels)


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


def page(flight: Flight, figures: dict[str, Any], command: str, link: dict[str, Any] | None = None) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        figures: of `summary.json`.
        command: the command line that repeats the flight.
        link: of a flight over a link, what `link_figures.shown` returns.
    """
    mission = flight.plan.scenario.kind == "mission"
    return render(
        "run",
        title=flight.plan.scenario.title,
        verdict=verdict(flight, figures),
        figures=figures,
        mission=mission,
        waypoints=flight.plan.scenario.waypoints,
        ends_early=samples(flight) < len(flight.log["time_s"]),
        track=track(flight, figures),
        motion=motion(flight),
        electrical=electrical(flight),
        inside=inside(flight) if mission else None,
        rim_speed=rim_speed(flight),
        effects=flight.plan.model.effects,
        packaged=flight.plan.scenario.packaged,
        command=command,
        link=link,
    )
