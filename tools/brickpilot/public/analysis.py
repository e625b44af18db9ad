"""The public functions check, calibrate, compare and discover; they check their arguments first."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding
from brickpilot.errors import InputError
from brickpilot.fit import calibration as calibrating
from brickpilot.fit import comparison as comparing
from brickpilot.fit.calibration import Calibration
from brickpilot.fit.comparison import Comparison
from brickpilot.fit.descent import Progress
from brickpilot.public.doors import Data, dataset_of, jobs_of, model_of, names_of, seed_of
from brickpilot.readiness import data_check as checking
from brickpilot.readiness.data_check import Check
from brickpilot.vehicle.model import Model


def check(dataset: Data, *, seed: int = 0, jobs: int = 2) -> Check:
    """Returns within seconds which values `dataset` determines, which effects would show in it, and what to drive next.

    Args:
        dataset: a data set, or its folder.
        seed: the seed of the nominal fit's random starts, which are used if nominal values are not given; 0 or more.
        jobs: simulations at the same time, 1..256.

    Raises:
        InputError: an argument is wrong, the model gives none of the measured signals, every run is held out, or the
            plant diverges with the nominal values.

    `brickpilot.readiness.data_check.check` has an example.
    """
    return checking.check(dataset_of(dataset), seed=seed_of(seed), jobs=jobs_of(jobs))


def calibrate(
    dataset: Data, *, effects: str | Iterable[str] = (), free: str | Iterable[str] = (), seed: int = 0, jobs: int = 2,
    progress: Progress | None = None,
) -> Calibration:  # fmt: skip
    """Fits the free nominal parameters to free runs, and returns them with their 95 % intervals.

    Args:
        dataset: a data set, or its folder.
        effects: effects to switch on, whose parameters are fitted; one name, or several.
        free: parameters to fit although the data set states their values.
        seed: the seed of the random starts, which are used if nominal values are not given; 0 or more.
        jobs: simulations at the same time, 1..256.
        progress: called with (done, total, text).

    Raises:
        InputError: an argument is wrong, or the data set cannot be fitted.
    """
    wanted, freed = names_of("effects", effects), names_of("free", free)
    data = dataset_of(dataset)
    return calibrating.calibrate(
        data, effects=wanted, free=freed, seed=seed_of(seed), threads=jobs_of(jobs), progress=progress
    )


def compare(
    dataset: Data, model: Model | str | Path | None = None, *, seed: int = 0, jobs: int = 2,
    progress: Progress | None = None,
) -> Comparison:  # fmt: skip
    """Simulates each run with its own inputs, and returns how much of each signal the model explains.

    Args:
        dataset: a data set, or its folder.
        model: a model, or its file; None: the calibrated nominal model.
        seed, jobs, progress: as in `calibrate`.

    Raises:
        InputError: an argument is wrong, or the model is of another vehicle than the data set.
    """
    data, chosen = dataset_of(dataset), model_of(model)
    return comparing.compare(data, chosen, seed=seed_of(seed), threads=jobs_of(jobs), progress=progress)


def discover(
    dataset: Data, model: Model | str | Path | None = None, *, seed: int = 0, jobs: int = 2,
    budget_s: float | None = None, predictor: bool = False, progress: Progress | None = None,
) -> Finding:  # fmt: skip
    """Finds what the simulator of `dataset` lacks.

    Args:
        dataset: a data set, or its folder.
        model: a model, or its file; the search starts with its values and effects; None: the nominal values.
        seed: the seed of the random starts, which are used if nominal values are not given; 0 or more.
        jobs: number of fits at the same time, 1..256.
        budget_s: the time in s, above 0, after which the best answer so far is returned; None: no limit.
        predictor: whether to also find the model that predicts best, `Finding.predictor`; its effects need not be real.
        progress: called with (done, total, text).

    Raises:
        InputError: an argument is wrong, the model gives none of the measured signals, or every run is held out.
        SimulationError: the plant diverges with the nominal values.

    A motor with dry friction of 0.6 V, which the nominal values do not contain:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 3.0, 0.01)
    >>> def bench(volts):
    ...     driven = 3 * (abs(volts) - 0.6) * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15))
    ...     coasting = np.maximum((driven[200] + 1.8) * np.exp(-(time - 2) / 0.15) - 1.8, 0)
    ...     speed = np.sign(volts) * np.where(time < 2, driven, coasting)
    ...     voltage = np.where((time > 0.195) & (time < 1.995), volts, 0.0)
    ...     noise = np.random.default_rng(1).normal(0, 0.1, time.size)
    ...     return pd.DataFrame({"time": time, "voltage": voltage, "speed": speed + noise})
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "inductance": 0.0}
    >>> runs = {"low": bench(3.0), "back": bench(-5.0), "high": bench(6.0)}
    >>> finding = bp.discover(bp.Dataset.from_frames(runs, vehicle="motor", nominal=known))
    >>> [effect.mechanism for effect in finding.effects]
    ['bearing']
    """
    if budget_s is not None and not budget_s > 0:
        raise InputError(f"needs seconds above 0, not {budget_s!r}", field="budget_s")
    data, start = dataset_of(dataset), model_of(model)
    return pipeline.discover(
        data, start, seed=seed_of(seed), jobs=jobs_of(jobs), budget_s=budget_s, predictor=predictor, progress=progress
    )
