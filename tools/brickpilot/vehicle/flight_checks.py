"""Checks whether a mission was flown: the link, the controller, the waypoints. Each check has a cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.vehicle.flight_figures import LATE


@dataclass(frozen=True)
class Check:
    """One check of a flight.

    Attributes:
        failure: the cause in one line, or None if the check holds.
        detail: the counts, whether the check holds or not.
        seconds: how long its part of the flight took.
    """

    name: str
    failure: str | None
    detail: str = ""
    seconds: float = 0.0


def checks(figures: Mapping[str, Any]) -> list[Check]:
    """Returns the checks of a flight, causes before their consequences; none for a manoeuvre.

    Args:
        figures: of ``summary.json``. A link is checked if there is one.
    """
    if "waypoints_total" not in figures:
        return []
    first, last = ([_link(figures), _late(figures)], [_stops(figures)]) if "link" in figures else ([], [])
    return [*first, _controller(figures), *last, *_waypoints(figures)]


def failure(figures: Mapping[str, Any]) -> str | None:
    """Returns why the mission was not flown, in one line, or None if it was; a manoeuvre cannot fail so."""
    failed = [check.failure for check in checks(figures) if check.failure is not None]
    if not failed:
        return None
    return f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached: {failed[0]}"


def _link(figures: Mapping[str, Any]) -> Check:
    broke_off = figures["broke_off"]
    lost = None if broke_off is None else f"{broke_off}; the motors were stopped"
    return Check("link", lost, f"{figures['lost_frames']} lost frames")


def _late(figures: Mapping[str, Any]) -> Check:
    """Late ticks fail a flight only if one ended the run, because every busy computer has some."""
    late, steps = figures["late_ticks"], figures["steps"]
    detail = f"{late} of {steps} ticks were more than a step late"
    return Check("late ticks", _fault(figures) if figures["fault"] == LATE else None, detail)


def _controller(figures: Mapping[str, Any]) -> Check:
    failed = _fault(figures) if figures["fault"] != "none" else None
    return Check("controller", failed, f"mode {figures['final_mode']} at the end")


def _stops(figures: Mapping[str, Any]) -> Check:
    stops = figures["safe_stops"]
    times = "once" if stops == 1 else f"{stops} times"
    failed = f"the motors were stopped {times}, as one end did not hear the other in time" if stops else None
    return Check("safe stops", failed, f"{stops} safe stops")


def _fault(figures: Mapping[str, Any]) -> str:
    reached = figures["waypoints_reached"]
    ended = figures["ended_at_s"]
    when = "" if ended is None else f" at {ended:.3f} s"
    where = f", on the way to waypoint {reached + 1}" if reached < figures["waypoints_total"] else ""
    return f'the controller stopped with the fault "{figures["fault"]}"{when}{where}{_lost_heading(figures)}'


def _waypoints(figures: Mapping[str, Any]) -> list[Check]:
    found = []
    before = 0.0
    rows = zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True)
    for number, (moment, closest) in enumerate(rows, 1):
        detail = f"closest approach {closest:.3f} m"
        missed = None if moment is not None else f"waypoint {number} was missed by {closest:.3f} m{_believes(figures)}"
        found.append(Check(f"waypoint {number}", missed, detail, 0.0 if moment is None else moment - before))
        before = before if moment is None else moment
    return found


def _believes(figures: Mapping[str, Any]) -> str:
    """The controller's own view of a waypoint that was missed by the true position."""
    return {
        "arrived": ", although the controller takes it for reached",
        "run": f", and the flight was over after {figures['simulated_s']:g} s",
        "idle": ": the mission was not started",
    }.get(figures["final_mode"], "") + _lost_heading(figures)


def _lost_heading(figures: Mapping[str, Any]) -> str:
    """Possible reasons why the controller did not know its heading."""
    steps = figures["gyro_full_steps"]
    beyond = f"; the gyro was at the end of its range in {steps} steps, so lower heading_limit" if steps else ""
    drifts = "; it started before the gyro's bias was learnt" if figures["started_without_gyro_bias"] else ""
    return beyond + drifts
