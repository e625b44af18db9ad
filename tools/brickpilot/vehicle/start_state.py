"""The state that a run starts from, or a window that is cut out of it.

The state is estimated from several samples instead of one. A sensor effect of the model, such as a scale or a bias,
lies between state and reading. So the result is the state at which the model's sensors give the measured values.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Run
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

Array = NDArray[np.float64]

# A run whose first samples all move in one direction starts in motion.
_START_SAMPLES = 9
_SECANT_STEPS = 4

# Measured signals that make up a state and that a sensor effect may change.
_SENSOR_SIGNALS = SUMMED | {"yaw_rate", *RATE_OF.values()}

GEOMETRY = ("wheel_radius", "half_track", "force_per_volt")
"""The nominal parameters that a state made of measured values depends on: see `Reading.state`. Besides them it depends
only on `sensor_effects`."""


@dataclass(frozen=True)
class Reading:
    """The known values at one sample, from which a state is made.

    Attributes:
        measured: signal -> reading, SI; NaN where blank.
        stated: signal -> true value.
        age: s since power-on.
    """

    measured: Mapping[str, float]
    stated: Mapping[str, float]
    model: Model
    age: float = 0.0

    @cached_property
    def known(self) -> dict[str, float]:
        """Signal -> value, of all that is known."""
        return {name: value for name, value in self.measured.items() if math.isfinite(value)} | dict(self.stated)

    @cached_property
    def read(self) -> tuple[str, ...]:
        """The known signals that a sensor effect of the model may have changed; empty: it has no such effect."""
        if not sensor_effects(self.model):
            return ()
        return tuple(name for name in self.known if name in _SENSOR_SIGNALS and name not in self.stated)

    def state(self, values: Array, *, restart: bool = False) -> State:
        """Returns the state in which the signals `read` have these true values.

        `restart`: unmeasured values are NaN, and so stay as simulated; else they are 0.
        """
        truth = self.known | dict(zip(self.read, values.tolist(), strict=True))
        unknown = float("nan") if restart else 0.0
        made = _motor_state if self.model.vehicle == "motor" else _vehicle_state
        return State(x=unknown, y=unknown, age=unknown if restart else self.age, charge=unknown,
            heat=(unknown, unknown), rest=unknown, **made(truth, self.model, unknown))  # fmt: skip


def first_sample(run: Run) -> dict[str, float]:
    """Returns the values measured at a run's first sample, and the rates of signals that sum up motion."""
    measured = {name: float(values[0]) for name, values in run.outputs.items()}
    for summed, rate in RATE_OF.items():
        if summed in run.outputs and rate not in run.outputs:
            measured[rate] = _starting_rate(run.time, run.outputs[summed])
    return measured


def sensor_effects(model: Model) -> tuple[str, ...]:
    """Returns the effects of the model that change the sensors' readings of the state."""
    return tuple(name for name in model.effects if _changes_readings(name, model.vehicle))


def states(readings: Sequence[Reading], *, restart: bool = False) -> list[State]:
    """Returns the states in which the models' sensors give the readings; see `Reading.state`.

    Each signal is solved by its own secant steps, which are exact after three if a sensor adds or scales. A signal
    that does not follow the state keeps its error: a clipped one, or a yaw rate beside two wheel speeds.
    """
    if not readings:
        return []
    wanted = [np.array([one.known[name] for name in one.read]) for one in readings]
    values, slopes = list(wanted), [np.ones_like(one) for one in wanted]
    unsolved = [k for k, one in enumerate(readings) if one.read]
    built = plant.build_all(readings[k].model for k in unsolved)
    given = _sensor_outputs(readings, values, unsolved, built)
    for _ in range(_SECANT_STEPS):
        unsolved = [k for k in unsolved if np.any(np.abs(wanted[k] - given[k]) > 1e-12)]
        if not unsolved:
            break
        moved = {k: (wanted[k] - given[k]) / slopes[k] for k in unsolved}
        for k in unsolved:
            values[k] = values[k] + moved[k]
        outputs = _sensor_outputs(readings, values, unsolved, built)
        changes = {k: outputs[k] - given[k] for k in unsolved}
        given |= outputs
        for k in unsolved:
            follows = (np.abs(moved[k]) > 1e-9) & (np.abs(changes[k]) > 0.1 * np.abs(moved[k]))
            slopes[k] = np.where(follows, changes[k] / np.where(follows, moved[k], 1.0), slopes[k])
        unsolved = [k for k in unsolved if changes[k].any()]
    return [one.state(at, restart=restart) for one, at in zip(readings, values, strict=True)]


def _sensor_outputs(
    readings: Sequence[Reading], values: Sequence[Array], which: Sequence[int], built: Mapping[int, Any]
) -> dict[int, Array]:
    """Returns the model's sensor readings of these values, for the readings numbered `which`, at zero input."""
    jobs = []
    for k in which:
        rest = np.zeros((1, 1 if readings[k].model.vehicle == "motor" else 2))
        jobs.append((readings[k].model, OpenLoopRun(np.zeros(1), rest, readings[k].state(values[k]))))
    simulated = plant.simulate(jobs, signals=_SENSOR_SIGNALS, built=built)
    outputs = zip(which, (one.outputs for one in simulated), strict=True)
    return {
        k: np.array([one[n][0] if n in one else readings[k].known[n] for n in readings[k].read]) for k, one in outputs
    }


@cache
def _changes_readings(effect: str, vehicle: str) -> bool:
    """Whether an effect, at its preset, changes the sensors' readings of the state at the first sample."""
    rest = np.zeros((1, 1 if vehicle == "motor" else 2))
    moving = State(surge=0.2, yaw_rate=1.0, wheel_speed=(7.0, 3.0), wheel_angle=(2.0, 1.0), heading=0.5, age=1.0)
    base = Model("moving", vehicle, "coupled", catalogue.presets(vehicle))
    run = OpenLoopRun(time=np.zeros(1), inputs=rest, initial=moving)
    plain, changed = (
        one.outputs for one in plant.simulate([(base, run), (dataclasses.replace(base, effects={effect: {}}), run)])
    )
    return any(plain[name][0] != changed[name][0] for name in plain.keys() & _SENSOR_SIGNALS)


def _starting_rate(time: Array, values: Array) -> float:
    """Returns the slope of the first samples where they all move in one direction, else 0."""
    first = values[:_START_SAMPLES]
    change = np.diff(first)
    if len(first) < _START_SAMPLES or not (np.all(change > 0) or np.all(change < 0)):
        return 0.0
    return float(np.polyfit(time[:_START_SAMPLES] - time[0], first, 1)[0])


def _motor_state(known: Mapping[str, float], model: Model, unknown: float) -> dict[str, Any]:
    if model.parameters.get("force_per_volt", 0.0) > 0:  # the plant's speed and angle are in m/s and m
        speed, angle = known.get("velocity", unknown), known.get("position", unknown)
    else:
        per = 1 / (model.parameters.get("wheel_radius") or np.inf)
        speed = _first(known, "speed", "velocity", per, unknown)
        angle = _first(known, "angle", "position", per, unknown)
    return {"wheel_speed": (speed, 0.0), "wheel_angle": (angle, 0.0), "current": (known.get("current", unknown), 0.0)}


def _vehicle_state(known: Mapping[str, float], model: Model, unknown: float) -> dict[str, Any]:
    radius, half_track = model.parameters["wheel_radius"], model.parameters["half_track"]
    left = _first(known, "wheel_speed_left", "wheel_velocity_left", 1 / radius, np.nan)
    right = _first(known, "wheel_speed_right", "wheel_velocity_right", 1 / radius, np.nan)
    left_angle = _first(known, "wheel_angle_left", "wheel_travel_left", 1 / radius, unknown)
    right_angle = _first(known, "wheel_angle_right", "wheel_travel_right", 1 / radius, unknown)
    surge, yaw_rate = known.get("surge", unknown), known.get("yaw_rate", unknown)
    if not math.isnan(left + right):
        surge = known.get("surge", radius * (left + right) / 2)
        yaw_rate = known.get("yaw_rate", radius * (left - right) / (2 * half_track))
    elif math.isnan(unknown):
        left = right = unknown
    else:
        left, right = (surge + half_track * yaw_rate) / radius, (surge - half_track * yaw_rate) / radius
    return {
        "heading": known.get("yaw_angle", unknown),
        "surge": surge,
        "sway": known.get("sway", unknown),
        "yaw_rate": yaw_rate,
        "wheel_speed": (left, right),
        "wheel_angle": (left_angle, right_angle),
        "current": (known.get("current_left", unknown), known.get("current_right", unknown)),
    }


def _first(known: Mapping[str, float], name: str, other: str, scale: float, unknown: float) -> float:
    """Returns the value of a signal where it is known, else `scale` times that of another one, else `unknown`."""
    value = known.get(name)
    if value is None:
        value = known[other] * scale if other in known else unknown
    return value
