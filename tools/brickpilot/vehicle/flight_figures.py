"""The figures of a flight: waypoints reached, distances from the route, and errors against the controller's demands.

`fly` flies a scenario in one call, as `brickpilot run` does, but it writes no folder.

The checks of the link, the controller and the waypoints show whether a mission succeeded, and if not, why.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import ACCEPTANCE_M, STEP_S
from brickpilot.data.agreement import signal_error
from brickpilot.data.shown import Result
from brickpilot.errors import InputError
from brickpilot.vehicle import flight as flights
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.flight import Flight
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

_RUN, _WAITS, _DRIVING = 1, 0, 3  # codes in the log: the mode run; the phases in which the robot waits and drives
_ENDED = 2  # the first of the modes in which a mission has ended: arrived, fault
_MODES = ("idle", "run", "arrived", "fault")
LATE = "late tick"  # the fault of a tick that came later than the watchdog allows
_WHILE_DRIVING = ("true_x_m", "true_y_m", "true_heading_rad", "demand_heading_rad", "waypoint")
_FAULTS = ("none", "leg timed out", "leg overshot", "state lost", "commanded", "no route", "silent", LATE)


@dataclass(frozen=True)
class Reached:
    """The waypoints reached in order: the true position came within twice the acceptance radius of each waypoint.

    Attributes:
        at: the time at which each waypoint was reached, s; None: not reached.
        closest: the least distance to each waypoint, m, from the time when the previous waypoint was reached to the
            time when this waypoint was left.
    """

    at: list[float | None]
    closest: list[float]

    @property
    def count(self) -> int:
        return sum(moment is not None for moment in self.at)


def waypoints_reached(
    time_s: Array, x: Array, y: Array, waypoints: Sequence[tuple[float, float]], acceptance: float = ACCEPTANCE_M
) -> Reached:
    """Finds the waypoints that the true track (n,) reaches, without the controller's estimate; `acceptance`: m."""
    at: list[float | None] = []
    closest = []
    begin = 0
    for wx, wy in waypoints:
        distance = np.hypot(x[begin:] - wx, y[begin:] - wy)
        inside = np.flatnonzero(distance <= 2 * acceptance) if None not in at else np.array([], dtype=int)
        if len(inside) == 0:
            at.append(None)
            closest.append(float(distance.min()))
            continue
        first = int(inside[0])
        outside = np.flatnonzero(distance[first:] > 2 * acceptance)
        left = first + (int(outside[0]) if len(outside) else len(distance) - first)
        at.append(float(time_s[begin + first]))
        closest.append(float(distance[:left].min()))
        begin += first
    return Reached(at, closest)


def cross_track(
    x: Array, y: Array, start: tuple[float, float], waypoints: Sequence[tuple[float, float]], leg: Array
) -> Array:
    """Returns the distance of the true position from the line of its leg in m, positive to the right.

    `leg`: (n,), the index of the waypoint at the leg's end.
    """
    corners = np.array([start, *waypoints])
    legs = np.diff(corners, axis=0)
    along = legs / np.linalg.norm(legs, axis=1, keepdims=True)
    index = np.clip(leg.astype(int), 0, len(waypoints) - 1)
    from_x, from_y = corners[index].T
    along_x, along_y = along[index].T
    return np.asarray(along_x * (y - from_y) - along_y * (x - from_x))


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None


def motor_hash(flight: Flight) -> str:
    """Returns the SHA-256 of the motor commands: little-endian pairs of 16 bits, left then right."""
    return hashlib.sha256(flight.motors.astype("<i2").tobytes()).hexdigest()


def summary(flight: Flight) -> dict[str, Any]:
    """Returns the figures of ``summary.json``: lengths in m, times in s, angles in rad.

    ``speed`` and ``heading`` are the integral least squares (ILS, eq. 20) of demanded less true values. The heading's
    ILS covers only the time while driving, and is relative to the ILS of a constant error of half a turn.
    """
    log, plan = flight.log, flight.plan
    common = {
        "scenario": plan.scenario.name,
        "profile": plan.model.profile,
        "sensors": plan.sensors,
        "seed": plan.seed,
        "steps": plan.steps,
        "model": plan.model.name,
        "effects": {name: dict(values) for name, values in plan.model.effects.items()},
        "compensation": None if plan.compensation is None else dict(plan.compensation.raw),
        "gains": None if plan.gains is None else dict(plan.gains.raw),
        "times_real_time": flight.times_real_time,
        "motor_stream_sha256": motor_hash(flight),
        "monitor": monitor_figures(log),
    }
    if plan.scenario.kind == "manoeuvre":
        return common | {
            "final_speed_m_s": float(log["true_speed_m_s"][-1]),
            "final_yaw_rate_rad_s": float(log["true_yaw_rate_rad_s"][-1]),
        }
    running = log["mode"] == _RUN
    demand_speed = np.where(running, log["demand_speed_m_s"], np.nan)
    half_turn = np.where(running & (log["phase"] == _DRIVING), math.pi, np.nan)
    ils = {
        "speed": signal_error(log["time_s"], log["true_speed_m_s"], demand_speed).to_json(),
        "heading": signal_error(log["time_s"], math.pi - _heading_error(log), half_turn).to_json(),
    }
    return {**common, "cruise_m_s": plan.cruise, **route_figures(flight), **ils, **final_figures(flight)}


CAUSES = ("none", "undecided", "friction", "braking", "supply", "slip")


def monitor_figures(log: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Returns what the firmware's monitor said last of each wheel and of the battery, if it found a cause.

    `size` is in V for friction and a share for other causes, above 0 for a loss, and `since_s` and `until_s` are times
    in s; None: until the end.
    """
    found = []
    for channel in ("left", "right", "battery"):
        cause = log[f"{channel}_cause"]
        said = np.flatnonzero(cause)
        if len(said):
            last = int(said[-1])
            found.append(
                {
                    "channel": channel,
                    "cause": CAUSES[int(cause[last])],
                    "size": float(log[f"{channel}_cause_size"][last]),
                    "since_s": float(log[f"{channel}_cause_since_s"][last]),
                    "until_s": None if last == len(cause) - 1 else float(log["time_s"][last]),
                }
            )
    return found


def _heading_error(log: Mapping[str, Array]) -> Array:
    """Returns the demanded minus the true heading in rad, in -pi..pi."""
    return np.asarray(np.angle(np.exp(1j * (log["demand_heading_rad"] - log["true_heading_rad"]))))


def route_figures(flight: Flight) -> dict[str, Any]:
    """Returns the figures of a mission's route: the waypoints reached, and how far the robot was from the route.

    Lengths in m, times in s, angles in rad. The cross-track and heading errors cover only the time while driving.
    """
    log, plan = flight.log, flight.plan
    waypoints = plan.scenario.waypoints
    reached = waypoints_reached(log["time_s"], log["true_x_m"], log["true_y_m"], waypoints, plan.acceptance)
    driving = (log["mode"] == _RUN) & (log["phase"] == _DRIVING)
    driven = {name: log[name][driving] for name in _WHILE_DRIVING}
    off_track = cross_track(
        driven["true_x_m"], driven["true_y_m"], plan.scenario.start[:2], waypoints, driven["waypoint"]
    )
    position_error = np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])
    return {
        "waypoints_total": len(waypoints),
        "waypoints_reached": reached.count,
        "closest_approach_m": reached.closest,
        "reached_at_s": reached.at,
        "position_estimate_error_m": _rms(position_error),
        "cross_track_rms_m": _rms(off_track),
        "cross_track_max_m": float(np.abs(off_track).max()) if len(off_track) else None,
        "heading_rms_rad": _rms(_heading_error(driven)),
    }


def final_figures(flight: Flight) -> dict[str, Any]:
    """Returns the figures of a mission's controller and of the mission's end; times in s."""
    log = flight.log
    ended = np.flatnonzero(log["mode"] >= _ENDED)
    steered = np.flatnonzero((log["mode"] == _RUN) & (log["phase"] > _WAITS))
    return {
        "saturated_steps": {
            "surge": int(np.count_nonzero(log["surge_saturated"])),
            "yaw": int(np.count_nonzero(log["yaw_saturated"])),
        },
        "overshoots": int(log["overshoots"][-1]),
        "started_without_gyro_bias": bool(len(steered) and log["bias_unknown"][steered[0]]),
        "gyro_full_steps": int(log["gyro_full_steps"][-1]),
        "final_mode": _MODES[int(log["mode"][-1])],
        "fault": _FAULTS[int(log["fault"][-1])],
        "ended_at_s": float(log["time_s"][ended[0]]) if len(ended) else None,
        "simulated_s": len(log["time_s"]) * STEP_S,
    }


@dataclass(frozen=True)
class Check:
    """One check of a flight.

    Attributes:
        failure: the cause in one line, or None if the check holds.
        detail: counts or distances, also if the check holds.
        seconds: time from the previous waypoint to this one, s; 0: not reached, or the check concerns no waypoint.
    """

    name: str
    failure: str | None
    detail: str = ""
    seconds: float = 0.0


def checks(figures: Mapping[str, Any]) -> list[Check]:
    """Returns the checks of a flight, causes before their consequences. A manoeuvre has no checks.

    Args:
        figures: the figures of ``summary.json``. The link is checked if the figures have the key "link".
    """
    if "waypoints_total" not in figures:
        return []
    fault = figures["fault"]
    stopped = _fault(figures) if fault != "none" else None
    controller = Check("controller", stopped, f"mode {figures['final_mode']} at the end")
    if "link" not in figures:
        return [controller, *_waypoints(figures)]
    broke_off, stops = figures["broke_off"], figures["safe_stops"]
    lost = None if broke_off is None else f"{broke_off}; the motors were stopped"
    # Every busy computer has late ticks, so a late tick fails a flight only if it ended the flight.
    late = f"{figures['late_ticks']} of {figures['steps']} ticks were more than a step late"
    times = "once" if stops == 1 else f"{stops} times"
    unheard = f"the motors were stopped {times}, as one end did not hear the other in time" if stops else None
    return [
        Check("link", lost, f"{figures['lost_frames']} lost frames"),
        Check("late ticks", stopped if fault == LATE else None, late),
        controller,
        Check("safe stops", unheard, f"{stops} safe stops"),
        *_waypoints(figures),
    ]


def failure(figures: Mapping[str, Any]) -> str | None:
    """Returns in one line why the mission failed; None: it did not fail, or the scenario is a manoeuvre."""
    failed = [check.failure for check in checks(figures) if check.failure is not None]
    if not failed:
        return None
    return f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached: {failed[0]}"


def _fault(figures: Mapping[str, Any]) -> str:
    reached = figures["waypoints_reached"]
    ended = figures["ended_at_s"]
    when = "" if ended is None else f" at {ended:.3f} s"
    where = f", on the way to waypoint {reached + 1}" if reached < figures["waypoints_total"] else ""
    return f'the controller stopped with the fault "{figures["fault"]}"{when}{where}{_lost_heading(figures)}'


def _waypoints(figures: Mapping[str, Any]) -> list[Check]:
    checked = []
    before = 0.0
    rows = zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True)
    for number, (moment, closest) in enumerate(rows, 1):
        detail = f"closest approach {closest:.3f} m"
        missed = None if moment is not None else f"waypoint {number} was missed by {closest:.3f} m{_believes(figures)}"
        checked.append(Check(f"waypoint {number}", missed, detail, 0.0 if moment is None else moment - before))
        before = before if moment is None else moment
    return checked


def _believes(figures: Mapping[str, Any]) -> str:
    """Returns the end of a sentence on a missed waypoint: the state of the controller at the end of the flight."""
    return {
        "arrived": ", although the controller takes it for reached",
        "run": f", and the flight was over after {figures['simulated_s']:g} s",
        "idle": ": the mission was not started",
    }.get(figures["final_mode"], "") + _lost_heading(figures)


def _lost_heading(figures: Mapping[str, Any]) -> str:
    """Returns the end of a sentence: possible reasons why the controller lost its heading; empty: no reason."""
    steps = figures["gyro_full_steps"]
    beyond = f"; the gyro was at the end of its range in {steps} steps, so lower heading_limit" if steps else ""
    drifts = "; it started before the gyro's bias was learnt" if figures["started_without_gyro_bias"] else ""
    return beyond + drifts


@dataclass(frozen=True)
class Flown(Result):
    """A flight with its figures.

    Attributes:
        flight: the plan, and every signal of every step.
        figures: the figures that `brickpilot run --json` prints; lengths in m, times in s, angles in rad.
    """

    flight: Flight
    figures: dict[str, Any]

    @property
    def failure(self) -> str | None:
        """Why the mission failed; None: it did not fail."""
        reason: str | None = self.figures["failure"]
        return reason

    def to_frame(self) -> pandas.DataFrame:
        """Returns the track: a row for each control step, with the columns of log.csv."""
        import pandas

        return pandas.DataFrame(self.flight.log)


def fly(
    scenario: str | Path = "mission",
    *,
    model: Model | None = None,
    profile: str | None = None,
    sensors: str | None = None,
    seed: int | None = None,
    compensation: Compensation | None = None,
    gains: Gains | None = None,
) -> Flown:
    """Flies a mission or a manoeuvre in simulation.

    Args:
        scenario: the name of a packaged scenario, or a file.
        model: the model of the robot; None: the packaged robot.
        profile: "coupled" or "paper"; None: the profile of the scenario, or else of the model.
        sensors: "ideal", "imu" or "imu+encoders"; None: the sensors of the scenario, or else "ideal".
        seed: the seed of the sensors' noise; None: the seed of the scenario, or else 0.
        compensation: the compensation of this robot in the firmware.
        gains: settings of the controller from `brickpilot tune`.

    Raises:
        InputError: a file is bad, an argument has another value than those above, or the scenario needs a link.
        SimulationError: the plant diverges.

    >>> import brickpilot as bp
    >>> flown = bp.fly("forward_1m")
    >>> round(flown.figures["final_speed_m_s"], 3)
    0.0
    >>> float(flown.to_frame()["true_x_m"].iloc[-1].round(1))
    1.2
    """
    plan = flights.plan(
        scenario, model, profile=profile, sensors=sensors, seed=seed, compensation=compensation, gains=gains
    )
    if plan.scenario.faults:
        raise InputError("needs a link, and run has none; fly it with brickpilot hil", file=scenario, field="faults")
    flown = flights.fly(plan)
    figures = summary(flown)
    figures["failure"] = failure(figures)
    return Flown(flown, figures)
