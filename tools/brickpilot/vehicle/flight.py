"""Closed loops: the firmware flies the plant, in C. Here the request is made and the answer weighed."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import compiled
from brickpilot.catalogue import PROFILE_CODES
from brickpilot.constants import ACCEPTANCE_M, RCX, STEP_S
from brickpilot.data.ils import signal_error
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError, SimulationError
from brickpilot.vehicle import plant
from brickpilot.vehicle.compensation import FORMATS, Compensation
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.scenario import SENSORS, Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """A scenario with every choice made."""

    scenario: Scenario
    model: Model  # of the plant: its profile and effects included
    controller: str  # profile whose constants the firmware uses
    sensors: str
    seed: int
    steps: int
    start_step: int
    cruise: float  # m/s
    motor_step: float = 0.0
    compensation: Compensation | None = None  # what the firmware is told of this robot


@dataclass(frozen=True)
class Flight:
    """What came of it. ``log``: column -> (steps,); ``motors``: (steps, 2) duty, 32767 = 1, left and right."""

    plan: Plan
    log: dict[str, Array]
    motors: NDArray[np.int16]
    times_real_time: float


def plan(
    scenario: Scenario,
    model: Model,
    *,
    profile: str | None = None,
    sensors: str | None = None,
    seed: int | None = None,
    compensation: Compensation | None = None,
) -> Plan:
    """Settles profile, sensors and seed: the argument, else the scenario's, else coupled, ideal, 0.

    Raises:
        InputError: the model is not of a differential drive, or there is no use for the compensation.
    """
    if model.vehicle != "diff_drive":
        raise InputError(f"a {model.vehicle} model cannot fly a mission; a diff_drive is needed", field=model.name)
    profile = profile or scenario.profile or model.profile
    sensors = sensors or scenario.sensors or "ideal"
    if compensation is not None and (profile != "coupled" or scenario.kind != "mission"):
        raise InputError("is for a mission in the profile coupled", field="compensation")
    start_at = scenario.start_at if scenario.start_at is not None else (0.0 if sensors == "ideal" else 1.0)
    return Plan(
        scenario=scenario,
        model=Model(
            name=model.name,
            vehicle=model.vehicle,
            profile=profile,
            parameters={**model.parameters, **scenario.parameters},
            effects={**model.effects, **scenario.effects},
        ),
        controller=profile,
        sensors=sensors,
        seed=seed if seed is not None else (scenario.seed or 0),
        steps=round(scenario.duration / STEP_S),
        start_step=round(start_at / STEP_S),
        cruise=scenario.cruise[profile] if profile in scenario.cruise else preset_cruise(profile),
        compensation=compensation,
    )


def preset_cruise(profile: str) -> float:
    """The firmware's own cruise speed, m/s: [controller.PROFILE] of the packaged rcx.toml."""
    return float(TomlFile(RCX).data["controller"][profile]["cruise"]["value"])


def _drive(plan: Plan) -> Array:
    """The manoeuvre's voltages, (steps, 2), NaN where a motor floats."""
    drive = np.zeros((plan.steps, 2))
    when = np.arange(plan.steps) * STEP_S
    for segment in plan.scenario.segments:
        drive[when >= segment.from_s - STEP_S / 2] = segment.left, segment.right
    return drive


@contextmanager
def request(plan: Plan, log: Array | None, motors: NDArray[np.int16] | None) -> Iterator[Any]:
    """The plan as the C interface takes it, a ``bp_flight *``; what it points to lives as long as the context."""
    ffi: Any
    ffi, _ = compiled.interface()
    request = ffi.new("bp_flight *")
    model = plant.build(plan.model)
    request.model = model
    request.controller = PROFILE_CODES[plan.controller]
    request.sensors = SENSORS.index(plan.sensors)
    request.seed = plan.seed
    request.initial.x, request.initial.y, request.initial.heading = plan.scenario.start
    request.motor_step = plan.motor_step
    request.steps = plan.steps
    request.start_step = plan.start_step
    request.cruise = plan.cruise
    known = {} if plan.compensation is None else plan.compensation.raw
    settings = ffi.new("bp_setting[]", [(FORMATS[name].number, raw) for name, raw in known.items()])
    request.settings, request.setting_count = settings, len(settings)
    waypoints = np.ascontiguousarray(plan.scenario.waypoints, dtype=np.float64)
    drive = _drive(plan) if plan.scenario.kind == "manoeuvre" else None
    held = [model, settings, waypoints, drive]
    if drive is not None:
        held.append(ffi.from_buffer("double[]", drive))
        request.drive = held[-1]
        request.stop_path = plan.scenario.stop_at or 0.0
    else:
        request.waypoint_count = len(waypoints)
        held.append(ffi.from_buffer("double[]", waypoints))
        request.waypoints = held[-1]
    if log is not None:
        held.append(ffi.from_buffer("double[]", log))
        request.log = held[-1]
    if motors is not None:
        held.append(ffi.from_buffer("short[]", motors))
        request.motors = held[-1]
    yield request
    held.clear()


def _fly(plan: Plan, log: Array | None, motors: NDArray[np.int16] | None) -> None:
    with request(plan, log, motors) as asked:
        if status := compiled.interface()[1].bp_fly(asked):
            raise SimulationError(f"{plan.scenario.name}: the flight broke off with status {status}")


def log_names() -> list[str]:
    """Columns of a flight's log; the unit ends each name."""
    ffi: Any
    ffi, library = compiled.interface()
    names: list[str] = []
    while name := library.bp_log_name(len(names)):
        names.append(ffi.string(name).decode())
    return names


def fly(plan: Plan) -> Flight:
    """Flies the plan and keeps every signal of every step.

    Raises:
        SimulationError: the plant's state left every bound.
    """
    names = log_names()
    log = np.zeros((plan.steps, len(names)))
    motors = np.zeros((plan.steps, 2), dtype=np.int16)
    began = time.perf_counter()
    _fly(plan, log, motors)
    elapsed = time.perf_counter() - began
    columns = {name: np.ascontiguousarray(log[:, index]) for index, name in enumerate(names)}
    return Flight(plan, columns, motors, plan.steps * STEP_S / elapsed)


def fly_unlogged(plan: Plan) -> float:
    """Flies the plan for its own sake and returns the simulated time in s: what the benchmark times."""
    _fly(plan, None, None)
    return plan.steps * STEP_S


@dataclass(frozen=True)
class Reached:
    """Waypoints the true position passed within twice the acceptance radius, in order."""

    at: list[float | None]  # s, per waypoint
    closest: list[float]  # m, per waypoint, on its own leg: from the one before being reached to this one being left

    @property
    def count(self) -> int:
        return sum(moment is not None for moment in self.at)


def waypoints_reached(time_s: Array, x: Array, y: Array, waypoints: Sequence[tuple[float, float]]) -> Reached:
    """Judges a track (n,) by its waypoints, independent of what the controller believed."""
    at: list[float | None] = []
    closest = []
    begin = 0
    for wx, wy in waypoints:
        distance = np.hypot(x[begin:] - wx, y[begin:] - wy)
        inside = np.flatnonzero(distance <= 2 * ACCEPTANCE_M) if None not in at else np.array([], dtype=int)
        if len(inside) == 0:
            at.append(None)
            closest.append(float(distance.min()))
            continue
        first = int(inside[0])
        outside = np.flatnonzero(distance[first:] > 2 * ACCEPTANCE_M)
        left = first + (int(outside[0]) if len(outside) else len(distance) - first)
        at.append(float(time_s[begin + first]))
        closest.append(float(distance[:left].min()))
        begin += first
    return Reached(at, closest)


def cross_track(
    x: Array, y: Array, start: tuple[float, float], waypoints: Sequence[tuple[float, float]], leg: Array
) -> Array:
    """Distance (m, right positive) of the true position from the line of its leg; `leg`: (n,) waypoint index."""
    corners = np.array([start, *waypoints])
    index = np.clip(leg.astype(int), 0, len(waypoints) - 1)
    from_, to = corners[index], corners[index + 1]
    along = (to - from_) / np.linalg.norm(to - from_, axis=1, keepdims=True)
    offset = np.stack([x, y], axis=1) - from_
    return np.asarray(along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0])


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None


def summary(flight: Flight) -> dict[str, Any]:
    """The figures of ``summary.json``: lengths in m, times in s, angles in rad.

    ``speed`` and ``heading`` are ILS (eq. 20) of the demand against the truth; the heading's while driving, as a share
    of what a constant error of half a turn would give.
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
        "times_real_time": flight.times_real_time,
        "motor_stream_sha256": hashlib.sha256(flight.motors.astype("<i2").tobytes()).hexdigest(),
    }
    if plan.scenario.kind == "manoeuvre":
        return common | {
            "final_speed_m_s": float(log["true_speed_m_s"][-1]),
            "final_yaw_rate_rad_s": float(log["true_yaw_rate_rad_s"][-1]),
        }
    reached = waypoints_reached(log["time_s"], log["true_x_m"], log["true_y_m"], plan.scenario.waypoints)
    running = log["mode"] == 1
    driving = running & (log["phase"] == 3)
    off_track = cross_track(
        log["true_x_m"], log["true_y_m"], plan.scenario.start[:2], plan.scenario.waypoints, log["waypoint"]
    )
    heading_error = np.angle(np.exp(1j * (log["demand_heading_rad"] - log["true_heading_rad"])))
    position_error = np.hypot(log["estimate_x_m"] - log["true_x_m"], log["estimate_y_m"] - log["true_y_m"])
    return common | {
        "cruise_m_s": plan.cruise,
        "waypoints_total": len(plan.scenario.waypoints),
        "waypoints_reached": reached.count,
        "closest_approach_m": reached.closest,
        "reached_at_s": reached.at,
        "position_estimate_error_m": _rms(position_error),
        "cross_track_rms_m": _rms(off_track[driving]),
        "cross_track_max_m": float(np.abs(off_track[driving]).max()) if driving.any() else None,
        "heading_rms_rad": _rms(heading_error[driving]),
        "speed": signal_error(
            log["time_s"], log["true_speed_m_s"], np.where(running, log["demand_speed_m_s"], np.nan)
        ).to_json(),
        "heading": signal_error(log["time_s"], math.pi - heading_error, np.where(driving, math.pi, np.nan)).to_json(),
        "saturated_steps": {
            "surge": int(np.count_nonzero(log["surge_saturated"])),
            "yaw": int(np.count_nonzero(log["yaw_saturated"])),
        },
        "overshoots": int(log["overshoots"][-1]),
        "final_mode": ("idle", "run", "arrived", "fault")[int(log["mode"][-1])],
        "fault": ("none", "leg timed out", "leg overshot", "state lost", "commanded", "no route", "silent")[
            int(log["fault"][-1])
        ],
    }
