"""The state at the start of a run, or at the start of a window that is cut out of a run.

The state is estimated from several samples instead of one. A sensor effect of the model, such as a scale or a bias,
changes the reading of a state. So the result is the state in which the model's sensors give the measured values.
"""

from __future__ import annotations

import dataclasses
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
"""The nominal parameters on which a state made of measured values depends: see `Readings.states`. The state also
depends on `sensor_effects`, and on the age if a sensor effect depends on the age."""


@dataclass(frozen=True)
class Readings:
    """The known values at some samples; each sample gives a state. All models are of one kind of vehicle.

    Attributes:
        measured: signal -> (samples,) reading, SI; NaN where blank.
        stated: signal -> (samples,) true value; NaN where no value is stated.
        models: the models for which states are made.
        of: (samples,) the index in `models` of each sample's model.
        age: (samples,) time since power-on, s.
    """

    measured: Mapping[str, Array]
    stated: Mapping[str, Array]
    models: Sequence[Model]
    of: NDArray[np.intp]
    age: Array

    @cached_property
    def known(self) -> dict[str, Array]:
        """Signal -> (samples,) stated value, else the reading; NaN where there is neither."""
        known = {name: np.where(np.isfinite(values), values, np.nan) for name, values in self.measured.items()}
        for name, values in self.stated.items():
            known[name] = np.where(np.isnan(values), known.get(name, np.nan), values)
        return known

    @cached_property
    def read(self) -> dict[str, NDArray[np.bool_]]:
        """Signal -> (samples,): whether its known value is a reading that a sensor effect may have changed."""
        changed = np.array([bool(sensor_effects(model)) for model in self.models])[self.of]
        readings = {}
        for name in sorted(self.known.keys() & _SENSOR_SIGNALS):
            here = changed & ~np.isnan(self.known[name])
            if name in self.stated:
                here &= np.isnan(self.stated[name])
            if here.any():
                readings[name] = here
        return readings

    def geometry(self, name: str) -> Array:
        """Returns (samples,) values of a parameter in `GEOMETRY`; NaN where the model lacks the parameter."""
        return np.array([model.parameters.get(name, np.nan) for model in self.models], dtype=np.float64)[self.of]

    def states(self, values: Mapping[str, Array], *, restart: bool = False) -> NDArray[np.void]:
        """Returns (samples,) states as C holds them; the signals in `read` have the true values `values`.

        `restart`: unmeasured values are NaN, so that they stay as simulated; else they are 0.
        """
        truth = self.known | {name: np.where(here, values[name], self.known[name]) for name, here in self.read.items()}
        unknown = np.nan if restart else 0.0
        layout = plant.layout("bp_state")
        made = np.full((len(self.age), layout.itemsize // 8), unknown, dtype=np.float64).view(layout)[:, 0]
        fields = _motor_state if self.models[0].vehicle == "motor" else _vehicle_state
        for name, own in fields(_Known(truth, unknown), self).items():
            if isinstance(own, tuple):
                made[name][:, 0], made[name][:, 1] = own
            else:
                made[name] = own
        if not restart:
            made["age"] = self.age
        return made


_Value = Array | float  # (samples,), or one value for all samples
_Fields = Mapping[str, _Value | tuple[_Value, _Value]]


@dataclass(frozen=True)
class _Known:
    """`values`: signal -> (samples,) true value, NaN where unknown. `unknown`: stands for these in a state."""

    values: Mapping[str, Array]
    unknown: float

    def get(self, name: str) -> _Value:
        """Returns a signal; NaN where it is not known."""
        return self.values.get(name, np.nan)

    def known(self, name: str) -> Array:
        """Returns a signal where it is known, else `unknown`."""
        value = self.get(name)
        return np.where(np.isnan(value), self.unknown, value)

    def first(self, name: str, other: str, scale: Array, unknown: float) -> Array:
        """Returns a signal where it is known, else `scale` times the signal `other`, else `unknown`."""
        value, instead = self.get(name), self.get(other) * scale
        return np.where(np.isnan(value), np.where(np.isnan(instead), unknown, instead), value)


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


def states(readings: Readings, *, restart: bool = False) -> NDArray[np.void]:
    """Returns (samples,) the states in which the models' sensors give the readings; see `Readings.states`.

    Each signal is solved on its own by the secant method, which is exact after three steps if a sensor only adds or
    scales. A signal that does not follow the state keeps its error. Examples are a clipped signal, or a yaw rate beside
    two wheel speeds.
    """
    read = readings.read
    if not read:
        return readings.states({}, restart=restart)
    here = np.column_stack([*read.values()])
    wanted = np.where(here, np.column_stack([readings.known[name] for name in read]), 0.0)
    values, slopes, given = wanted.copy(), np.ones_like(wanted), wanted.copy()
    built = plant.build_all(readings.models)

    def outputs(which: NDArray[np.intp]) -> Array:
        """Returns (which, read): the sensors' readings of these values, at zero input; 0 where no reading is needed."""
        start = readings.states(dict(zip(read, values.T, strict=True)))[which]
        models = [readings.models[k] for k in readings.of[which].tolist()]
        made = _sensor_outputs(models, start, tuple(read), built)
        return np.where(here[which] & ~np.isnan(made), made, wanted[which])

    unsolved = np.flatnonzero(here.any(axis=1))
    given[unsolved] = outputs(unsolved)
    for _ in range(_SECANT_STEPS):
        unsolved = unsolved[np.any(np.abs(wanted[unsolved] - given[unsolved]) > 1e-12, axis=1)]
        if not unsolved.size:
            break
        moved = (wanted[unsolved] - given[unsolved]) / slopes[unsolved]
        values[unsolved] += moved
        now = outputs(unsolved)
        changes = now - given[unsolved]
        given[unsolved] = now
        follows = (np.abs(moved) > 1e-9) & (np.abs(changes) > 0.1 * np.abs(moved))
        slopes[unsolved] = np.where(follows, changes / np.where(follows, moved, 1.0), slopes[unsolved])
        unsolved = unsolved[np.any(changes != 0.0, axis=1)]
    return readings.states(dict(zip(read, values.T, strict=True)), restart=restart)


def _sensor_outputs(
    models: Sequence[Model], start: NDArray[np.void], names: Sequence[str], built: Mapping[int, Any]
) -> Array:
    """Returns (models, names): what the sensors read in the states `start`, (models,), at zero input."""
    columns = 1 if models[0].vehicle == "motor" else 2
    standing, ordered = OpenLoopRun(np.zeros(1), np.zeros((1, columns))), plant.wanted_names(frozenset(names))
    requests = np.frombuffer(bytearray(standing.as_c(columns) * len(models)), dtype=plant.layout("bp_run"))
    requests["initial"] = start
    values = np.empty((len(models), len(ordered)))
    starts = np.arange(len(models)) * len(ordered)
    plant.simulate_into(values.reshape(-1), starts, models, requests, ordered, built=built)
    return values[:, [ordered.index(name) for name in names]]


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
    """Returns the slope of the first samples if they all move in one direction, else 0."""
    first = values[:_START_SAMPLES]
    change = np.diff(first)
    if len(first) < _START_SAMPLES or not (np.all(change > 0) or np.all(change < 0)):
        return 0.0
    return float(np.polyfit(time[:_START_SAMPLES] - time[0], first, 1)[0])


def _motor_state(known: _Known, readings: Readings) -> _Fields:
    radius, direct = readings.geometry("wheel_radius"), readings.geometry("force_per_volt") > 0
    per = 1 / np.where(np.isnan(radius) | (radius == 0), np.inf, radius)
    speed, angle = (
        # The plant gives the speed and angle of a linear motor in m/s and m.
        np.where(direct, known.known(linear), known.first(turning, linear, per, known.unknown))
        for turning, linear in (("speed", "velocity"), ("angle", "position"))
    )
    return {"wheel_speed": (speed, 0.0), "wheel_angle": (angle, 0.0), "current": (known.known("current"), 0.0)}


def _vehicle_state(known: _Known, readings: Readings) -> _Fields:
    radius, half_track = readings.geometry("wheel_radius"), readings.geometry("half_track")
    left = known.first("wheel_speed_left", "wheel_velocity_left", 1 / radius, np.nan)
    right = known.first("wheel_speed_right", "wheel_velocity_right", 1 / radius, np.nan)
    left_angle = known.first("wheel_angle_left", "wheel_travel_left", 1 / radius, known.unknown)
    right_angle = known.first("wheel_angle_right", "wheel_travel_right", 1 / radius, known.unknown)
    both = ~np.isnan(left + right)
    surge = np.where(both & np.isnan(known.get("surge")), radius * (left + right) / 2, known.known("surge"))
    yaw_of_wheels = radius * (left - right) / (2 * half_track)
    yaw_rate = np.where(both & np.isnan(known.get("yaw_rate")), yaw_of_wheels, known.known("yaw_rate"))
    # At a start, unmeasured wheels roll as the vehicle moves; at a restart (NaN), they stay as simulated.
    rolling = 0.0 if known.unknown == 0.0 else np.nan
    return {
        "heading": known.known("yaw_angle"),
        "surge": surge,
        "sway": known.known("sway"),
        "yaw_rate": yaw_rate,
        "wheel_speed": (
            np.where(both, left, (surge + half_track * yaw_rate) / radius + rolling),
            np.where(both, right, (surge - half_track * yaw_rate) / radius + rolling),
        ),
        "wheel_angle": (left_angle, right_angle),
        "current": (known.known("current_left"), known.known("current_right")),
    }
