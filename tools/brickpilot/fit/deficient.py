"""Which equation of a model is deficient: the one whose noise, set to zero, costs the most likelihood.

A model that is right needs no process noise. Each equation gets an unknown load and each sensor an unknown drift; their
sizes are fitted (`noise_sizes`), and then each is left out in turn while the others are fitted again. The smoothed load
says against what the missing part varies (Kristensen, Madsen & Jorgensen 2004, section 4).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import outputs
from brickpilot.fit.explain import TIMES, WHEEL_ANGLE, Explained, LoadOfRun, explanations
from brickpilot.fit.innovations import Innovations
from brickpilot.fit.noise_sizes import FittedNoise, Size, fit_noise, fit_noise_and_decay, scales, start_noise
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.predictor import Predicted

Array = NDArray[np.float64]

_PASSES, _SECOND_PASSES = 8, 16  # of the smoother, where one size is left out, or another basis is tried
_LEAST_LOST, _LEAST_LOST_SHARE = 5.0, 0.03  # of log likelihood, and of the largest loss: less is not worth a load
_LEAST_EXPLAINED = 0.1  # of a load's mean square: a quantity that explains less explains nothing
_STEP = 0.05  # of the logarithm of a size, for its interval

EQUATIONS = {
    "torque_left": "left wheel",
    "torque_right": "right wheel",
    "force_surge": "surge",
    "moment_yaw": "yaw",
}
"""Load -> the equation that it acts on, of a vehicle."""

_YAWS = ("moment_yaw", "yaw_rate", "yaw_angle", "accel_sway")  # loads and signals whose own motion is the turning
_STILL = 0.01  # of the largest speed: below it there is no direction

_BASES = tuple(
    tuple(Size("lasting", load) for load in loads)
    for loads in (("torque_left", "torque_right"), ("force_surge", "moment_yaw"))
)


@dataclass(frozen=True)
class Deficient:
    """One equation, or one sensor, that needs an unknown load or drift.

    Attributes:
        equation: "left wheel", "right wheel", "surge", "yaw", of a motor "motor"; "sensor SIGNAL" of a sensor.
        size: sd of the load or drift.
        ci95: its interval, (low, high); None: it could not be determined.
        volts: the voltage at the motors that does as much; None: a sensor, or a drive that commands force or torque.
        over_full: `size` over the load at full voltage, or over the signal's rms.
        lost: the log likelihood that is lost without it.
        share: that, over the sum of what is lost without each.
        best: what it varies with, the best explanation first.
    """

    equation: str
    size: float
    unit: str
    ci95: tuple[float, float] | None
    volts: float | None
    over_full: float
    lost: float
    share: float
    best: tuple[Explained, ...]

    @property
    def explained(self) -> Explained | None:
        """The quantity that it varies with; None: with none of those that were tried."""
        return self.best[0] if self.best and self.best[0].share >= _LEAST_EXPLAINED else None

    def to_json(self) -> dict[str, Any]:
        """Returns its entry of verdict.json."""
        return {
            "equation": self.equation,
            "noise": {"value": self.size, "unit": self.unit, "ci95": self.ci95},
            "volts": self.volts,
            "share_of_likelihood": self.share,
            "best_explained_by": None if self.explained is None else self.explained.by,
            "explained": None if self.explained is None else self.explained.share,
        }


def deficient_equations(problem: Innovations, model: Model, least_over_full: float) -> tuple[Deficient, ...]:
    """Returns the equations and sensors that need more than `least_over_full`, the most deficient first.

    Raises:
        SimulationError: the plant diverges under `model`.
    """
    noise = _fewest(problem, model, _best_basis(problem, model), least_over_full)
    natural = scales(problem, model)
    needed = [size for size, sd in noise.sds.items() if size.kind != "noise" and sd > 0]
    lost = {size: _lost(problem, model, noise, size) for size in needed}
    smoothed = problem.predict(model, noise.noise, smooth=True) if needed else []
    found = [
        Deficient(
            _equation(size, model),
            noise.sds[size],
            _unit(size, model),
            _interval(problem, model, noise, size),
            _volts(size, noise.sds[size], model),
            noise.sds[size] / natural[size],
            lost[size],
            lost[size] / max(sum(lost.values()), 1e-9),
            tuple(explanations(_loads(problem, model, smoothed, size))),
        )
        for size in needed
    ]
    return tuple(sorted(found, key=lambda one: -one.lost))


def _best_basis(problem: Innovations, model: Model) -> FittedNoise:
    """Returns the fit with loads on both wheels or on surge and yaw, whichever is likelier.

    Where the wheels carry the body along, two loads are all that there are: those of the wheels say the same as those
    of the body, in other words. With all four each would take a part of what is one cause.
    """
    first = fit_noise_and_decay(problem, model, without=_BASES[1])
    if model.vehicle == "motor":
        return first
    start = start_noise(problem, model, first.decay_s)
    sds = {**first.sds, **{size: start.sds[size] for size in _BASES[1]}}
    second = fit_noise(problem, model, dataclasses.replace(first, sds=sds), without=_BASES[0], passes=_SECOND_PASSES)
    return max(first, second, key=lambda one: one.log_likelihood)


def _fewest(problem: Innovations, model: Model, noise: FittedNoise, least_over_full: float) -> FittedNoise:
    """Leaves out what is small, and then what costs next to nothing to leave out."""
    natural = scales(problem, model)
    without = [size for size, sd in noise.sds.items() if size.kind != "noise" and sd <= least_over_full * natural[size]]
    noise = fit_noise(problem, model, noise, without=without, passes=_PASSES)
    lost = {
        size: _lost(problem, model, noise, size) for size, sd in noise.sds.items() if size.kind != "noise" and sd > 0
    }
    least = max(_LEAST_LOST, _LEAST_LOST_SHARE * max(lost.values(), default=0.0))
    cheap = [size for size, one in lost.items() if one < least]
    return fit_noise(problem, model, noise, without=[*without, *cheap], passes=_PASSES) if cheap else noise


def _lost(problem: Innovations, model: Model, noise: FittedNoise, size: Size) -> float:
    """Returns the log likelihood that is lost where a size is nothing and the others are fitted again."""
    absent = [one for one, sd in noise.sds.items() if one.kind != "noise" and sd == 0]
    without = fit_noise(problem, model, noise, without=[*absent, size], passes=_PASSES)
    return max(noise.log_likelihood - without.log_likelihood, 0.0)


def _equation(size: Size, model: Model) -> str:
    if size.kind == "drift":
        return f"sensor {size.name}"
    return "motor" if model.vehicle == "motor" else EQUATIONS[size.name]


def _unit(size: Size, model: Model) -> str:
    if size.kind == "drift":
        return outputs()[size.name]
    linear = model.parameters.get("force_per_volt", 0.0) > 0
    return "N" if linear or size.name == "force_surge" else "N m"


def _volts(size: Size, sd: float, model: Model) -> float | None:
    """Returns the voltage at the motors that makes as much load."""
    p = model.parameters
    if size.kind == "drift" or p.get("force_per_volt", 0.0) > 0 or p.get("torque_per_volt", 0.0) > 0:
        return None
    per_torque = p["resistance"] / p["torque_constant"]
    lever = {"force_surge": p.get("wheel_radius", 0.0) / 2}
    if size.name == "moment_yaw":
        lever["moment_yaw"] = p["wheel_radius"] / (2 * p["half_track"])
    return sd * lever.get(size.name, 1.0) * per_torque


def _interval(problem: Innovations, model: Model, noise: FittedNoise, size: Size) -> tuple[float, float] | None:
    """Returns an interval of 95 % from the curvature of the likelihood along the size's logarithm."""

    def slope(factor: float) -> float:
        sds = {**noise.sds, size: noise.sds[size] * factor}
        at = FittedNoise(sds, noise.decay_s, 0.0, 0).noise
        total = 0.0
        for one in problem.predict(model, at, smooth=True):
            assert one.slopes is not None
            slopes = one.slopes.lasting if size.kind == "lasting" else one.slopes.drift
            total += slopes.get(size.name, 0.0)  # a run that lacks a signal says nothing of its drift
        return total * 2 * sds[size] ** 2

    curvature = (slope(np.exp(-_STEP)) - slope(np.exp(_STEP))) / (2 * _STEP)
    if curvature <= 0:
        return None
    away = 1.96 / curvature**0.5
    sd = noise.sds[size]
    return float(sd * np.exp(-away)), float(sd * np.exp(away))


def _loads(problem: Innovations, model: Model, smoothed: list[Predicted], size: Size) -> list[LoadOfRun]:
    """Returns the smoothed load or drift of each run with the quantities that it may vary with."""
    found = []
    for one, time, inputs, age in zip(smoothed, problem.times, problem.inputs(), problem.ages, strict=True):
        if size.kind == "drift" and size.name not in one.drift:
            continue  # the run lacks the signal
        load = one.smoothed[size.name] if size.kind == "lasting" else one.drift[size.name]
        sd = one.smoothed_sd[size.name] if size.kind == "lasting" else np.full(len(load), np.std(load))
        quantities = _quantities(one.smoothed, time, np.nan_to_num(inputs), size, model)
        quantities |= dict(zip(TIMES, (time - time[0], age + time - time[0]), strict=True))
        found.append(LoadOfRun(time, load, sd, quantities))
    return found


def _quantities(
    estimate: Mapping[str, Array], time: Array, inputs: Array, size: Size, model: Model
) -> dict[str, Array]:
    """Returns name -> values of what a load may vary with, the plainest first: its own motion, then others."""
    right = size.name.endswith("_right")
    own, word = estimate[f"wheel_speed_{'right' if right else 'left'}"], "wheel speed"
    volts: Array | None = inputs[:, 1 if right else 0]
    body: dict[str, Array] = {}
    if model.vehicle != "motor":
        body = {"forward speed": estimate["surge"], "turning": estimate["yaw_rate"]}
        if size.name in _YAWS:
            own, word, volts = estimate["yaw_rate"], "turning", None
        elif not size.name.endswith(("_left", "_right")):
            own, word, volts = estimate["surge"], "forward speed", None
        body |= {
            "speed times turning": estimate["surge"] * estimate["yaw_rate"],
            "sum of the voltages": inputs.sum(axis=1),
            "difference of the voltages": inputs[:, 0] - inputs[:, 1],
        }
    still = _STILL * max(float(np.max(np.abs(own))), 1e-12)
    return {
        "constant": np.zeros(len(time)),
        f"direction of {word}": np.where(np.abs(own) > still, np.sign(own), 0.0),
        word: own,
        "acceleration": np.gradient(own, time),
        **({} if volts is None else {"voltage": volts}),
        WHEEL_ANGLE: estimate[f"wheel_angle_{'right' if right else 'left'}"],
    } | body
