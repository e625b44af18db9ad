"""The stochastic grey-box form of a run: the plant predicts, and what was measured corrects it.

`bp_predict` in the C interface has the equations. Every equation may get an unknown load and every sensor an unknown
drift; how large they have to be shows which equation of the model is deficient.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import output_table
from brickpilot.compiled import interface
from brickpilot.errors import SimulationError
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import TROUBLE, OpenLoopRun, build, fill_run

Array = NDArray[np.float64]

LOADS = ("torque_left", "torque_right", "force_surge", "moment_yaw")
"""The unknown loads, one an equation: of the left and right wheel, of surge and of yaw. A motor has the first alone."""


@dataclass(frozen=True)
class ProcessNoise:
    """How far the equations and the sensors may be wrong.

    Attributes:
        white: load -> N m or N, times root of a second: noise without memory.
        lasting: load -> N m or N: sd of a load that lasts about `decay_s`.
        decay_s: s, above 0.
        drift: signal -> its unit: sd of a sensor's error that lasts about `drift_decay_s`.
        noise: signal -> its unit: sd of the error of each reading, above 0.
    """

    noise: Mapping[str, float]
    lasting: Mapping[str, float] = field(default_factory=dict)
    decay_s: float = 0.3
    white: Mapping[str, float] = field(default_factory=dict)
    drift: Mapping[str, float] = field(default_factory=dict)
    drift_decay_s: float = 1.0


@dataclass(frozen=True)
class Readings:
    """What is predicted: a run, what was measured in it, and how well its start is known.

    Attributes:
        measured: signal -> (n,) SI; NaN: a blank.
        start_sd: name of an estimate, as "wheel_speed_left" -> sd of the run's initial state.
    """

    run: OpenLoopRun
    measured: Mapping[str, Array]
    start_sd: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Slopes:
    """Slopes of the log likelihood along the variances of a `ProcessNoise`, by the same names.

    That of a lasting load is along the square of its sd. They are exact for a linear plant.
    """

    noise: Mapping[str, float]
    lasting: Mapping[str, float]
    white: Mapping[str, float]
    drift: Mapping[str, float]


@dataclass(frozen=True)
class Predicted:
    """The result of `predict` for one run. Arrays are (n,).

    Attributes:
        innovation: signal -> reading less prediction; NaN where nothing was measured.
        innovation_sd: signal -> its sd.
        log_likelihood: of all innovations, and how many `count` there are.
        ahead: signal -> predictions that start from the estimate every `horizon_s` s; empty unless asked for.
        filtered, smoothed, smoothed_sd: estimate -> values; the last two, `drift` and `slopes` only if asked for.
    """

    innovation: Mapping[str, Array]
    innovation_sd: Mapping[str, Array]
    log_likelihood: float
    count: int
    ahead: Mapping[str, Array]
    filtered: Mapping[str, Array]
    smoothed: Mapping[str, Array]
    smoothed_sd: Mapping[str, Array]
    drift: Mapping[str, Array]
    slopes: Slopes | None


@cache
def estimate_names() -> tuple[str, ...]:
    """Returns the names of what is estimated, in the order of the C interface."""
    library = interface()[1]
    string: Any = interface()[0].string
    return tuple(string(library.bp_estimate_name(index)).decode() for index in range(library.BP_ESTIMATES))


def predict(
    model: Model,
    readings: Sequence[Readings],
    noise: ProcessNoise,
    *,
    horizon_s: float | None = None,
    smooth: bool = False,
    threads: int = 2,
) -> list[Predicted]:
    """Filters each run under one model, on up to `threads` threads.

    Args:
        horizon_s: s between the starts of `Predicted.ahead`; 0: one free run; None: `ahead` is not wanted.
        smooth: also smooth, and compute the slopes of the likelihood. It takes about twice as long.

    Raises:
        SimulationError: of the first run that failed, e.g. because its state diverged.
        InputError: a model the plant refuses.
    """
    built = build(model)

    def one(numbered: tuple[int, Readings]) -> Predicted:
        return _predict(built, model, numbered, noise, horizon_s, smooth)

    if threads < 2:
        return [one(numbered) for numbered in enumerate(readings)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(one, enumerate(readings)))


def _predict(
    built: Any,
    model: Model,
    numbered: tuple[int, Readings],
    noise: ProcessNoise,
    horizon_s: float | None,
    smooth: bool,
) -> Predicted:
    """Fills the C request of one run, and reads its answer."""
    ffi, library = interface()
    index, readings = numbered
    signals, samples = list(readings.measured), len(readings.run.time)
    outputs = [name for name, _ in output_table()]
    request: Any = ffi.new("bp_prediction *")
    tables = {
        "innovation": np.empty((samples, len(signals))),
        "innovation_variance": np.empty((samples, len(signals))),
        "filtered": np.empty((samples, library.BP_ESTIMATES)),
    }
    if smooth:
        tables |= {name: np.empty((samples, library.BP_ESTIMATES)) for name in ("smoothed", "smoothed_sd")}
        tables["smoothed_drift"] = np.empty((samples, len(signals)))
    ahead = np.empty((samples if horizon_s is not None else 0, len(outputs)))
    alive = [fill_run(request.run, built, model, readings.run, ahead)]
    if horizon_s is None:
        request.run.output = ffi.NULL
    request.horizon = horizon_s or 0.0
    alive.append(_fill_noise(request, readings, noise))
    for name, table in tables.items():
        alive.append([ffi.from_buffer("double[]", table.data)])
        setattr(request, name, alive[-1][0])
    status = library.bp_predict(request)
    if status:
        raise SimulationError(f"{model.name}, run {index}: {TROUBLE.get(status, status)}", index, status)
    return _answer(request, readings, noise, tables, {name: ahead[:, k] for k, name in enumerate(outputs)})


def _fill_noise(request: Any, readings: Readings, noise: ProcessNoise) -> list[Any]:
    """Fills what is measured and how large every noise is. Returns what must stay alive while the request is used."""
    ffi = interface()[0]
    signals = list(readings.measured)
    codes = {name: code for code, (name, _) in enumerate(output_table())}
    measured = np.ascontiguousarray(np.column_stack([readings.measured[name] for name in signals]), dtype=np.float64)
    drift_rate = (2 / noise.drift_decay_s) ** 0.5
    alive = [
        ffi.new("int[]", [codes[name] for name in signals]),
        ffi.from_buffer("double[]", measured.data),
        ffi.new("double[]", [noise.noise[name] for name in signals]),
        ffi.new("double[]", [noise.drift.get(name, 0.0) * drift_rate for name in signals]),
    ]
    request.measured_count = len(signals)
    request.measured_output, request.measured, request.noise, request.drift = alive
    request.decay, request.drift_decay = noise.decay_s, noise.drift_decay_s
    for index, load in enumerate(LOADS):
        request.white[index] = noise.white.get(load, 0.0)
        request.walk[index] = noise.lasting.get(load, 0.0) * (2 / noise.decay_s) ** 0.5
    for index, name in enumerate(estimate_names()[: -len(LOADS)]):
        request.start_sd[index] = readings.start_sd.get(name, 0.0)
    return [*alive, measured]


def _answer(
    request: Any, readings: Readings, noise: ProcessNoise, tables: Mapping[str, Array], ahead: Mapping[str, Array]
) -> Predicted:
    signals = list(readings.measured)
    by_signal = {"innovation", "innovation_variance", "smoothed_drift"}
    columns = {
        name: dict(zip(signals if name in by_signal else estimate_names(), np.ascontiguousarray(table.T), strict=True))
        for name, table in tables.items()
    }
    slopes = None
    if "smoothed" in tables:
        # A lasting load of sd s is driven by s root(2 / decay) per root of a second.
        slopes = Slopes(
            noise={name: request.noise_slope[k] for k, name in enumerate(signals)},
            lasting={name: request.walk_slope[k] * 2 / noise.decay_s for k, name in enumerate(LOADS)},
            white={name: request.white_slope[k] for k, name in enumerate(LOADS)},
            drift={name: request.drift_slope[k] * 2 / noise.drift_decay_s for k, name in enumerate(signals)},
        )
    return Predicted(
        innovation=columns["innovation"],
        innovation_sd={name: np.sqrt(values) for name, values in columns["innovation_variance"].items()},
        log_likelihood=request.log_likelihood,
        count=request.innovation_count,
        ahead={name: values for name, values in ahead.items() if name in readings.measured},
        filtered=columns["filtered"],
        smoothed=columns.get("smoothed", {}),
        smoothed_sd=columns.get("smoothed_sd", {}),
        drift=columns.get("smoothed_drift", {}),
        slopes=slopes,
    )
