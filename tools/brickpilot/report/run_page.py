"""The page of a flight: the track, which the reader can play, and the signals of the robot and inside the controller.

`track.js` draws and plays a track, seen from above. For a flight over a link, figures show how long replies took, how
punctual ticks were, and when errors occurred.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.constants import STEP_S
from brickpilot.report import plot
from brickpilot.report.flight_text import monitor_line
from brickpilot.report.plot import Array, Colour, Curve, Figure, Panel, compact, to_html
from brickpilot.report.quantities import plain
from brickpilot.report.template import render
from brickpilot.vehicle.flight import Flight
from brickpilot.vehicle.flight_figures import CAUSES

PHASES = ("begin", "brake", "turn", "drive", "end")
LINK = "run"
"""The `Figure.link` of all figures of a flight."""

_DEGREES = 180.0 / np.pi
_AT_REST_S = 1.0  # time in s that a figure shows after the last motion
_MOVES = 1e-3  # a smaller change of position in m, or of heading in rad, counts as rest
Line = tuple[str, str, Colour]


def samples(flight: Flight) -> int:
    """Returns the number of samples to draw: all samples until 1 s after the last motion of robot or motors."""
    log = flight.log
    driven = np.nan_to_num(np.abs(log["left_voltage_v"]) + np.abs(log["right_voltage_v"])) > 0
    away = np.hypot(log["true_x_m"] - log["true_x_m"][-1], log["true_y_m"] - log["true_y_m"][-1])
    turned = np.abs(log["true_heading_rad"] - log["true_heading_rad"][-1])
    moves = np.flatnonzero(driven | (away > _MOVES) | (turned > _MOVES))
    last = log["time_s"][moves[-1] if len(moves) else 0] + _AT_REST_S
    return int(np.searchsorted(log["time_s"], last, side="right"))


def _panel(flight: Flight, label: str, unit: str, lines: list[Line], scale: float = 1.0) -> Panel:
    """Returns a panel of columns of the log, multiplied by `scale`; `lines`: (column, legend, colour) of each curve."""
    count = samples(flight)
    return Panel(
        label, unit, [Curve(name, scale * flight.log[column][:count], colour) for column, name, colour in lines]
    )


def _figure(flight: Flight, title: str, panels: list[Panel]) -> Markup:
    return to_html(Figure(title, flight.log["time_s"][: samples(flight)], panels, link=LINK))


def track(flight: Flight, figures: dict[str, Any]) -> Markup:
    """Draws the track from above, with x up and y to the right, over the waypoints with their acceptance circles."""
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
    """Draws the true and the measured motion."""
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
    panels = []
    for name, unit in (("voltage", "V"), ("current", "A")):
        column = f"{name}_{unit.lower()}"
        sides: list[Line] = [(f"left_{column}", "left", "blue"), (f"right_{column}", "right", "orange")]
        panels.append(_panel(flight, f"motor {name}", unit, sides))
    return _figure(flight, "motor voltages and currents over time", panels)


def inside(flight: Flight) -> Markup:
    """Draws the phase, demands and estimates, the terms of the PIDs, the cross-track error and the estimate's error."""
    count, log = samples(flight), flight.log
    error = np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])[:count]
    channels: list[tuple[str, Colour]] = [("left", "blue"), ("right", "orange"), ("battery", "green")]
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
        Panel(
            "what the monitor says",
            "",
            [Curve(name, log[f"{name}_cause"][:count], colour, shape="step") for name, colour in channels],
            rows=CAUSES,
        ),
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
    said = "".join(f" {monitor_line(one)}." for one in figures["monitor"])
    return (
        f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached in order{when}, "
        f"in the {plan.model.profile} profile with {plan.sensors} sensors.{said and ' The monitor:' + said}"
    )


def page(flight: Flight, figures: dict[str, Any], command: str, link: dict[str, Any] | None = None) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        figures: the figures of `summary.json`.
        command: the command line that repeats the flight.
        link: for a flight over a link, the result of `link_figures`.
    """
    mission, parameters = flight.plan.scenario.kind == "mission", flight.plan.model.parameters
    wheel_speed = float(np.mean(np.abs(flight.log["left_wheel_rad_s"][-300:])))  # mean over the last 0.9 s, in rad/s
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
        rim_speed=parameters["wheel_radius"] * wheel_speed,
        effects=flight.plan.model.effects,
        sets_in_at=flight.plan.scenario.sets_in_at,
        packaged=flight.plan.scenario.packaged,
        command=command,
        link=link,
    )


def track_to_html(
    time: Array, heading: Array, lines: Sequence[Curve], circles: Sequence[tuple[float, float, float, bool]], *,
    link: str, title: str = "track over the waypoints, seen from above",
) -> Markup:  # fmt: skip
    """Returns a track, seen from above, as an element of a page; the reader can play the track.

    Args:
        time, heading: the run's times in s, and its headings in rad, clockwise from straight up; (n,) each.
        lines: curves, (2, samples) each: the positions to the right and up, in m. Curves with as many samples as
            `time` are played; the robot moves along the first of them.
        circles: for each waypoint: its positions to the right and up in m, its radius in m, and whether it was reached.
        link, title: see `Figure`.
    """
    kept = plot.thin(
        np.concatenate([one.values for one in lines if one.values.shape[1] == len(time)]), plot.MOST_POINTS
    )
    spec = {
        "track": True,
        "link": link,
        "label": "seen from above: x, forward at the start (m)",
        "across": "y, to the right (m)",
        "time": compact(time[kept], plot.ACROSS),
        "heading": compact(heading[kept], plot.UP),
        "lines": [_way(one, kept, len(time)) for one in lines],
        "circles": [
            {"name": str(number), "x": x, "y": y, "radius": radius, "reached": reached}
            for number, (x, y, radius, reached) in enumerate(circles, 1)
        ],
    }
    return plot.element(spec, title, 400)


def _way(one: Curve, kept: NDArray[np.intp], samples: int) -> dict[str, Any]:
    played = one.values.shape[1] == samples
    across, up = one.values[:, kept] if played else one.values
    return {
        "name": one.name,
        "colour": one.colour,
        "width": one.width,
        "dash": [6, 4] if one.dashed else None,
        "played": played,
        "x": compact(across, plot.UP),
        "y": compact(up, plot.UP),
    }


_BARS = 60
_HEIGHT = 140
_WIDEST = 99.5  # percentile of the jitter up to which the bars reach; the outermost bars include larger values
_KINDS: dict[str, tuple[str, Colour]] = {
    "late_ticks": ("late tick", "orange"),
    "lost_frames": ("lost frame", "blue"),
    "refused_frames": ("refused frame", "purple"),
    "safe_stops": ("safe stop", "green"),
}


def link_figures(ticks: Mapping[str, Array], *, realtime: bool, replies: bool = True) -> dict[str, Any]:
    """Returns the page's figures of the ticks, each with the sentence that stands above it; a figure may be None.

    Args:
        ticks: the columns of ticks.csv, each (n,).
        realtime: whether ticks follow a clock; only then can ticks be unpunctual.
        replies: whether the brick replies to each set of readings; a brick with its own sensors and motors does not.
    """
    return {
        "trouble": trouble(ticks),
        "round_trip": round_trip(ticks) if replies else None,
        "jitter": jitter(ticks) if realtime else None,
    }


def trouble(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns a sentence on late ticks, lost and refused frames and safe stops, and their time line."""
    counts = {name: int(ticks[name].sum()) for name in _KINDS}
    said = ", ".join(f"{count} {_KINDS[name][0]}{'' if count == 1 else 's'}" for name, count in counts.items())
    if not any(counts.values()):
        return f"{said}.", None
    at = np.flatnonzero(sum(ticks[name] for name in _KINDS))
    curves = [
        Curve(words, np.where(ticks[name][at] > 0, float(row), np.nan), colour, shape="marks")
        for row, (name, (words, colour)) in enumerate(_KINDS.items())
    ]
    panel = Panel("", "", curves, 26 * len(curves) + 10, rows=[words for words, _ in _KINDS.values()])
    reach = (0.0, float(ticks["time_s"][-1]))
    line = Figure(f"time line of the link: {said}", ticks["time_s"][at], [panel], link=LINK, reach=reach)
    return f"{said}.", to_html(line)


def round_trip(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns the histogram of the times from sending the sensors' readings to the motor command."""
    known = ticks["round_trip_ms"][np.isfinite(ticks["round_trip_ms"])]
    if not len(known):
        return "No reply came.", None
    known = np.maximum(known, 1e-3)
    edges = np.geomspace(known.min() / 1.05, known.max() * 1.05, _BARS + 1)
    half, most, all_of_it = (plain(float(np.percentile(known, share)), 3) for share in (50, 99, 100))
    said = f"Half of {len(known)} replies took up to {half} ms, 99 % up to {most} ms, and the slowest {all_of_it} ms"
    return f"{said}.", _histogram(f"round trip: {said}", known, edges, "round trip", log=True)


def jitter(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns the histogram of the difference between each period and the nominal step."""
    periods = 1e3 * (np.diff(ticks["begun_s"]) - STEP_S)
    known = periods[np.isfinite(periods)]
    if not len(known):
        return "There is one tick alone.", None
    far = max(float(np.percentile(np.abs(known), _WIDEST)), 1e-3)
    sd, most = plain(float(np.std(known)), 3), plain(float(np.abs(known).max()), 3)
    said = f"The period is {1e3 * STEP_S:g} ms; it differs by {sd} ms (standard deviation), and by up to {most} ms"
    text = f"{said}. Periods beyond {plain(far, 3)} ms are in the outermost bars."
    edges = np.linspace(-far, far, _BARS + 1)
    return text, _histogram(f"jitter: {said}", np.clip(known, -far, far), edges, "period less its nominal value")


def _histogram(title: str, values: Array, edges: Array, label: str, *, log: bool = False) -> Markup:
    counts = np.histogram(values, edges)[0].astype(np.float64)
    middle = np.sqrt(edges[:-1] * edges[1:]) if log else (edges[:-1] + edges[1:]) / 2
    ticks = Curve("ticks", np.where(counts > 0, counts, np.nan), shape="bars")
    return to_html(Figure(title, middle, [Panel("ticks", "", [ticks], _HEIGHT, log=True)], label, "ms", log=log))
