"""Flies a scenario: the firmware controls the plant, both in C. The figures of a flight are in `flight_figures`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import compiled
from brickpilot.catalogue import PROFILE_CODES
from brickpilot.constants import ACCEPTANCE_M, STEP_S, robot_value
from brickpilot.errors import InputError, SimulationError
from brickpilot.vehicle import plant
from brickpilot.vehicle.compensation import FORMATS, Compensation
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.scenario import PROFILES, SENSORS, Scenario, find, load
from brickpilot.vehicle.settings import settings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """A scenario with everything that a flight of it needs: controller, sensors, model and seed.

    Attributes:
        model: the model of the plant.
        controller: the profile whose constants the firmware uses.
        cruise: the cruise speed, m/s.
        compensation: the compensation of this robot in the firmware; None: no compensation.
        gains: settings of the controller that replace the firmware's values; None: no setting is replaced.
        acceptance: the robot's radius, m: a waypoint is reached if the true position passes within twice this distance.
        firmware: a library that `sim_host/run/build` made, with another controller; None: the packaged firmware.
        before: the plant's model until step `later_step`, which has `model` from then on; None: `model` all the time.
        devices: field of `bp_devices` -> value of the robot's sensors, SI; None: the values of the packaged robot.
    """

    scenario: Scenario
    model: Model
    controller: str
    sensors: str
    seed: int
    steps: int
    start_step: int
    cruise: float
    compensation: Compensation | None = None
    gains: Gains | None = None
    firmware: Path | None = None
    acceptance: float = ACCEPTANCE_M
    devices: Mapping[str, float] | None = None
    before: Model | None = None
    later_step: int = 0


@dataclass(frozen=True)
class Flight:
    """The result of a flight.

    Attributes:
        log: column -> (steps,), for all columns or for the requested columns.
        motors: (steps, 2), duty of left and right, 32767 = 1.
    """

    plan: Plan
    log: dict[str, Array]
    motors: NDArray[np.int16]
    times_real_time: float


def plan(
    scenario: Scenario | str | Path,
    model: Model | None = None,
    *,
    profile: str | None = None,
    sensors: str | None = None,
    seed: int | None = None,
    compensation: Compensation | None = None,
    gains: Gains | None = None,
) -> Plan:
    """Returns the plan of a flight.

    Profile, sensors and seed come from the arguments, or else from the scenario. The defaults are the model's profile,
    ideal sensors and seed 0.

    Args:
        scenario: a scenario, the name of a packaged scenario, or a file.
        model: the model of the robot; None: the packaged robot.

    Raises:
        InputError: a file is bad, the profile or the sensors are unknown, the model is of a motor, or this scenario or
            profile cannot use the compensation or the gains.
    """
    for name, value, known in (("profile", profile, PROFILES), ("sensors", sensors, SENSORS)):
        if value is not None and value not in known:
            raise InputError(f"{value!r} is not one of {', '.join(known)}", field=name)
    scenario = scenario if isinstance(scenario, Scenario) else load(find(str(scenario)))
    model = rcx() if model is None else model
    if model.vehicle == "motor":
        raise InputError("a motor model cannot fly a mission; a diff_drive or skid_steer is needed", field=model.name)
    profile = profile or scenario.profile or model.profile
    sensors = sensors or scenario.sensors or "ideal"
    if compensation is not None and (profile != "coupled" or scenario.kind != "mission"):
        raise InputError("needs a mission in the profile coupled", field="compensation")
    if gains is not None and scenario.kind != "mission":
        raise InputError("needs a mission: a manoeuvre has no controller", field="gains")
    if gains is not None and "cruise" in gains.raw:
        cruise = gains.value("cruise")
    else:
        cruise = scenario.cruise.get(profile, robot_value("controller", profile, "cruise"))
    start_at = scenario.start_at if scenario.start_at is not None else (0.0 if sensors == "ideal" else 1.0)
    begins = replace(model, profile=profile)
    return Plan(
        scenario=scenario,
        model=replace(
            begins,
            parameters={**model.parameters, **scenario.parameters},
            effects={**model.effects, **scenario.effects},
        ),
        controller=profile,
        sensors=sensors,
        seed=seed if seed is not None else (scenario.seed or 0),
        steps=round(scenario.duration / STEP_S),
        start_step=round(start_at / STEP_S),
        cruise=cruise,
        compensation=compensation,
        gains=gains,
        before=begins if scenario.sets_in_at > 0 else None,
        later_step=round(scenario.sets_in_at / STEP_S),
    )


def written(plan: Plan) -> dict[str, int]:
    """Returns setting -> raw integer, in the order in which a host writes: first the compensation, then the gains."""
    known = {} if plan.compensation is None else plan.compensation.raw
    tuned = {} if plan.gains is None else plan.gains.raw
    return {FORMATS[name].name: raw for name, raw in known.items()} | dict(tuned)


def _drive(plan: Plan) -> Array:
    """Returns the manoeuvre's voltages, (steps, 2); NaN where a motor floats."""
    drive = np.zeros((plan.steps, 2))
    when = np.arange(plan.steps) * STEP_S
    for segment in plan.scenario.segments:
        drive[when >= segment.from_s - STEP_S / 2] = segment.left, segment.right
    return drive


@contextmanager
def request(plan: Plan, log: Array, motors: NDArray[np.int16], columns: Sequence[str] | None = None) -> Iterator[Any]:
    """Yields the plan as a ``bp_flight *`` for the C interface. Its pointers are valid within the context only.

    `log` has a row for each step; with `columns`, a row for each of these columns instead.
    """
    ffi: Any
    ffi, _ = compiled.interface()
    x, y, heading = plan.scenario.start
    settings_written = [(settings()[name].number, raw) for name, raw in written(plan).items()]
    # The cffi objects in `fields` keep alive the memory to which the request points.
    fields: dict[str, Any] = {
        "model": plant.build(plan.model), "controller": PROFILE_CODES[plan.controller],
        "sensors": SENSORS.index(plan.sensors), "seed": plan.seed, "initial": {"x": x, "y": y, "heading": heading},
        "steps": plan.steps, "start_step": plan.start_step, "cruise": plan.cruise,
        "settings": ffi.new("bp_setting[]", settings_written), "setting_count": len(settings_written),
        "log": ffi.from_buffer("double[]", log), "motors": ffi.from_buffer("short[]", motors),
    }  # fmt: skip
    if plan.before is not None:
        fields |= {"model": plant.build(plan.before), "later": fields["model"], "later_step": plan.later_step}
    if plan.devices is not None:
        fields["devices"] = ffi.new("bp_devices *", {**plan.devices, "bits": round(plan.devices["bits"])})
    if plan.scenario.kind == "manoeuvre":
        fields |= {"drive": ffi.from_buffer("double[]", _drive(plan)), "stop_path": plan.scenario.stop_at or 0.0}
    else:
        waypoints = np.ascontiguousarray(plan.scenario.waypoints, dtype=np.float64)
        fields |= {"waypoints": ffi.from_buffer("double[]", waypoints), "waypoint_count": len(waypoints)}
    if columns is not None:
        fields["columns"] = ffi.new("int[]", [log_names().index(name) for name in columns])
        fields["column_count"] = len(columns)
    yield ffi.new("bp_flight *", fields)
    fields.clear()


@cache
def log_names() -> tuple[str, ...]:
    """Returns the columns of a flight's log; each name ends with the unit."""
    ffi: Any
    ffi, library = compiled.interface()
    names: list[str] = []
    while name := library.bp_log_name(len(names)):
        names.append(ffi.string(name).decode())
    return tuple(names)


def fly(plan: Plan, columns: Sequence[str] | None = None) -> Flight:
    """Flies the plan and keeps the signals of every step.

    Args:
        columns: the columns of the log to keep; None: all. Logging unneeded columns takes a fifth of a flight's time.

    Raises:
        SimulationError: the plant diverges.
    """
    [flown] = fly_many([plan], columns)
    if isinstance(flown, SimulationError):
        raise flown
    return flown


def fly_many(plans: Sequence[Plan], columns: Sequence[str] | None = None) -> list[Flight | SimulationError]:
    """Flies plans side by side, and returns for each plan its flight or the error that stopped it.

    Each flight gives the same bytes as if it were flown alone. Neighbouring plans of equal length share the vector
    registers of one core; groups of eight save the most time. All logs are in memory at once.

    Args:
        plans: the plans, which must all have the same firmware.
        columns: as in `fly`.

    Raises:
        ValueError: the plans have different firmwares.
    """
    if len({plan.firmware for plan in plans}) > 1:
        raise ValueError("flights side by side need one firmware")
    ffi: Any
    ffi, library = compiled.interface()
    if plans and plans[0].firmware is not None:
        library = compiled.closed_loop(plans[0].firmware)
    names = log_names() if columns is None else columns
    logs = [np.zeros((plan.steps, len(names)) if columns is None else (len(names), plan.steps)) for plan in plans]
    motors = [np.zeros((plan.steps, 2), dtype=np.int16) for plan in plans]
    requests = ffi.new("bp_flight[]", len(plans))
    with ExitStack() as held:
        for index, plan in enumerate(plans):
            requests[index] = held.enter_context(request(plan, logs[index], motors[index], columns))[0]
        began = time.perf_counter()
        library.bp_fly_many(requests, len(plans), plant.MOST_LANES)
        elapsed = time.perf_counter() - began
    pace = sum(plan.steps for plan in plans) * STEP_S / elapsed
    flights: list[Flight | SimulationError] = []
    for plan, flown, log, duty in zip(plans, requests, logs, motors, strict=True):
        rows = log if columns is not None else log.T
        signals = {name: np.ascontiguousarray(row) for name, row in zip(names, rows, strict=True)}
        if flown.status == 0:
            flights.append(Flight(plan, signals, duty, pace))
        else:
            message = f"{plan.scenario.name}: the flight stopped with status {flown.status}"
            flights.append(SimulationError(message, status=flown.status))
    return flights
