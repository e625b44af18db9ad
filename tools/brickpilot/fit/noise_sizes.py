"""How large the noise of each equation and sensor has to be: maximum likelihood of the innovations.

The slopes of the likelihood along every size come from one pass of the smoother (Koopman & Shephard 1992), so a fit of
a dozen sizes costs some dozens of passes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from brickpilot.errors import SimulationError
from brickpilot.fit.innovations import Innovations
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.predictor import LOADS, ProcessNoise

Array = NDArray[np.float64]

DECAYS_S = (0.03, 0.1, 0.3, 1.0, 3.0)
"""s: how long a load may last; the likelihood chooses."""
_DRIFT_DECAY_S = 1.0

_SMALLEST, _START, _LARGEST = (
    1e-4,
    3e-2,
    3.0,
)  # sd of a load over the torque at full voltage, or of a drift over the rms
_NOISE_RANGE = (0.5, 30.0)  # of a reading's stated or estimated sd
_PASSES, _FEW_PASSES = 25, 8
_DIVERGED = 1e12


@dataclass(frozen=True)
class Size:
    """One size that is fitted: a load by its name, or the drift or the noise of a signal."""

    kind: str  # "lasting", "drift" or "noise": a field of ProcessNoise
    name: str


@dataclass(frozen=True)
class FittedNoise:
    """The result of a fit.

    Attributes:
        sds: size -> sd, N m or N of a load, else the signal's unit; 0: held at nothing.
        log_likelihood: of all innovations.
        count: how many innovations there are.
    """

    sds: Mapping[Size, float]
    decay_s: float
    log_likelihood: float
    count: int

    @property
    def noise(self) -> ProcessNoise:
        return process_noise(self.sds, self.decay_s)

    def of(self, kind: str, name: str) -> float:
        return self.sds.get(Size(kind, name), 0.0)


def process_noise(sds: Mapping[Size, float], decay_s: float) -> ProcessNoise:
    """Returns the sizes as the filter takes them."""
    kinds: dict[str, dict[str, float]] = {"lasting": {}, "drift": {}, "noise": {}}
    for size, sd in sds.items():
        kinds[size.kind][size.name] = sd
    return ProcessNoise(
        noise=kinds["noise"],
        lasting=kinds["lasting"],
        decay_s=decay_s,
        drift=kinds["drift"],
        drift_decay_s=_DRIFT_DECAY_S,
    )


def scales(problem: Innovations, model: Model) -> dict[Size, float]:
    """Returns the natural scale of each size: the torque at full voltage, a signal's rms, or a reading's noise."""
    p = model.parameters
    volts = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in problem.inputs()) or 1.0
    direct = p.get("force_per_volt", 0.0) or p.get("torque_per_volt", 0.0)
    torque = volts * (direct or p["torque_constant"] / p["resistance"])
    found = {Size("lasting", LOADS[0]): torque}
    if model.vehicle != "motor":
        radius = p["wheel_radius"]
        most = (torque, torque, torque / radius, torque / radius * p["half_track"])
        found = {Size("lasting", load): one for load, one in zip(LOADS, most, strict=True)}
    found |= {Size("drift", name): problem.rms[name] for name in problem.signals}
    return found | {Size("noise", name): problem.noise[name] for name in problem.signals}


def start_noise(problem: Innovations, model: Model, decay_s: float = 0.3) -> FittedNoise:
    """Returns sizes to start a fit from."""
    sds = {size: scale * (1.0 if size.kind == "noise" else _START) for size, scale in scales(problem, model).items()}
    return FittedNoise(sds, decay_s, -np.inf, 0)


def fit_noise(
    problem: Innovations,
    model: Model,
    start: FittedNoise,
    *,
    without: Collection[Size] = (),
    passes: int = _PASSES,
) -> FittedNoise:
    """Returns the sizes of largest likelihood near `start`, at one model. A size below a ten-thousandth is nothing.

    Args:
        without: sizes that are held at 0.

    Raises:
        SimulationError: the plant diverges at `start`.
    """
    natural = scales(problem, model)
    free = [size for size in natural if size not in without]
    bounds = [_bounds(size, natural[size]) for size in free]
    low, high = np.array(bounds).T
    point = np.clip([np.log(max(start.sds.get(size, 0.0), 1e-300)) for size in free], low, high)

    def cost(at: Array) -> tuple[float, Array]:
        sds = dict(zip(free, np.exp(at), strict=True))
        try:
            found = problem.predict(model, process_noise(sds, start.decay_s), smooth=True)
        except SimulationError:
            return _DIVERGED, np.zeros(len(at))
        slope = np.zeros(len(at))
        for one in found:
            assert one.slopes is not None
            table = {"lasting": one.slopes.lasting, "drift": one.slopes.drift, "noise": one.slopes.noise}
            slope += [table[size.kind].get(size.name, 0.0) * 2 * sds[size] ** 2 for size in free]
        return -sum(one.log_likelihood for one in found), -slope

    end = minimize(
        cost, point, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxfun": passes, "ftol": 1e-7, "maxcor": 20}
    )
    if end.fun >= _DIVERGED:
        raise SimulationError("the plant diverges where the fit of its noise starts")
    fitted = dict.fromkeys(natural, 0.0)
    for size, at, least in zip(free, end.x, low, strict=True):
        fitted[size] = float(np.exp(at)) if size.kind == "noise" or at > least + 1e-3 else 0.0
    count = sum(one.count for one in problem.predict(model, process_noise(fitted, start.decay_s)))
    return FittedNoise(fitted, start.decay_s, -float(end.fun), count)


def fit_noise_and_decay(problem: Innovations, model: Model, *, without: Collection[Size] = ()) -> FittedNoise:
    """Returns the sizes of largest likelihood with the decay that suits them best. See `fit_noise`.

    Raises:
        SimulationError: as of `fit_noise`.
    """
    tried: dict[float, FittedNoise] = {}
    best = fit_noise(problem, model, start_noise(problem, model, DECAYS_S[2]), without=without)
    tried[best.decay_s] = best
    for direction in (1, -1):
        index = DECAYS_S.index(best.decay_s) + direction
        while 0 <= index < len(DECAYS_S) and DECAYS_S[index] not in tried:
            other = dataclasses.replace(best, decay_s=DECAYS_S[index])
            again = tried[other.decay_s] = fit_noise(problem, model, other, without=without, passes=_FEW_PASSES)
            if again.log_likelihood <= best.log_likelihood:
                break
            best, index = again, index + direction
    return fit_noise(problem, model, best, without=without)


def _bounds(size: Size, scale: float) -> tuple[float, float]:
    low, high = _NOISE_RANGE if size.kind == "noise" else (_SMALLEST, _LARGEST)
    return float(np.log(low * scale)), float(np.log(high * scale))
