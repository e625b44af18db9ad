"""A flight as text: the lines that `run` and `hil` print for a mission, and the mission's checks as a JUnit file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the command line imports this module, and has to start without loading the plant
    from brickpilot.vehicle.flight_figures import Check


def waypoint_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yields a line for each waypoint, and a line with the number of reached waypoints."""
    approaches = zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True)
    for number, (moment, closest) in enumerate(approaches, 1):
        when = "not reached" if moment is None else f"reached at {moment:6.3f} s"
        yield f"waypoint {number}: {when}, closest approach {closest:.3f} m"
    yield (
        f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached in order "
        f"(profile {figures['profile']}, sensors {figures['sensors']})"
    )


def figure_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yields the figures of the whole mission, each with its meaning."""
    off, lost = _metres(figures["cross_track_rms_m"]), _metres(figures["position_estimate_error_m"])
    yield f"cross-track error   {off} rms: how far beside the straight line between two waypoints it drove"
    yield f"position error      {lost} rms: from where the controller takes the robot to be, to where it is"
    if figures["started_without_gyro_bias"]:
        yield "gyro bias           not learnt before the start: the heading drifts by what the gyro reads at rest"
    if steps := figures["gyro_full_steps"]:
        yield f"gyro                at the end of its range in {steps} steps, in which the heading is lost"
    for said in figures["monitor"]:
        yield f"monitor             {monitor_line(said)}"
    yield f"mode at the end     {figures['final_mode']}, fault: {figures['fault']}"
    seconds, times = figures["simulated_s"], figures["times_real_time"]
    rounded = f"{times:.0f}" if times >= 10 else f"{times:.1f}"
    yield f"times real time     {rounded}: {seconds:.4g} s of driving took {seconds / times:.2g} s"


_CAUSES = {
    "undecided": ("not decided yet", ""),
    "friction": ("dry friction", " V"),
    "braking": ("braking with speed", " %"),
    "supply": ("voltage lost", " %"),
    "slip": ("slip", " %"),
}


def monitor_line(said: Mapping[str, Any]) -> str:
    """Returns an entry of `flight_figures.monitor_figures` as "left wheel: dry friction +0.56 V since 14.2 s"."""
    words, unit = _CAUSES[said["cause"]]
    size = said["size"] * (100 if unit == " %" else 1)
    what = f"{words} {size:+.3g}{unit}" if unit else words
    if said["channel"] == "battery":
        what = f"resistance {size:+.3g} % of a motor's" if unit else words
    end = "" if said["until_s"] is None else f" until {said['until_s']:.1f} s"
    place = said["channel"] if said["channel"] == "battery" else f"{said['channel']} wheel"
    return f"{place}: {what} since {said['since_s']:.1f} s{end}"


def link_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yields the figures that only a flight over a link has, each with its meaning."""
    yield f"link                {figures['link']} in {figures['pace']}"
    yield f"late ticks          {figures['late_ticks']} of {figures['steps']}: steps that began more than a step late"
    yield f"lost frames         {figures['lost_frames']}: messages that were damaged, or had no reply"
    yield f"safe stops          {figures['safe_stops']}: times that one end stopped the motors"
    if (board := figures["board"]) is not None:
        yield (
            f"board               started by {board['started_by']}; missed {board['converter']} sets of readings, "
            f"{board['edges']} edges, {board['overruns']} bytes"
        )
    yield f"motor stream        {figures['motor_stream_sha256']}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"


def junit_text(name: str, checks: Sequence[Check], command: str, error: str | None = None) -> str:
    """Returns the file: a test suite `name` with a test case for each check.

    Args:
        command: the command line that repeats the flight; the file has it as a property of the suite.
        error: why the flight did not begin; each test case contains this text. None: the flight began.
    """
    from brickpilot.report.template import render_plain  # here, so that the command line starts without jinja2

    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return render_plain("junit.xml", name=name, checks=checks, command=command, error=error, now=now)
