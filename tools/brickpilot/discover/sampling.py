"""Whether an accelerometer gives the instant or the mean over a sample, where the data set does not state it.

Many log the acceleration at the time of the sample; one that sums up over its sample, or whose readings are averaged
before they are logged, gives the mean. The two are half a sample apart, which a fit would make up for by a motor that
is slower or faster than it is.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from brickpilot.data.dataset import Dataset
from brickpilot.data.description import Sampling
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.gates import LEAST_GAIN, PARAMETER_COST
from brickpilot.discover.prepare import Prepared
from brickpilot.fit.output_error import OutputError, Scale
from brickpilot.fit.replay import Replay

_ASSUMED: Sampling = "mean"
_WORDS: dict[Sampling, str] = {"instant": "the instant", "mean": "the mean since the sample before it"}


def sampling_note(prepared: Prepared, best: FittedModel) -> str | None:
    """Returns which of the two the fit runs show for the accelerometers, and how surely.

    None where no accelerometer is compared, or the data set states it. Both are fitted from `best` by one step of least
    squares, so the parameters adapt to either.
    """
    compared, error = prepared.compared, prepared.fine
    names = [name for name in error.signals if name.startswith("accel_")]
    stated = [compared.signals[name].sampling for name in names if name in compared.signals]
    if not names or any(one is not None for one in stated):
        return None
    costs = {kind: _fitted_cost(prepared, best, _with_sampling(compared, names, kind)) for kind in _WORDS}
    if not np.isfinite(list(costs.values())).all():
        return None
    likelier = min(costs, key=lambda kind: costs[kind])
    other = next(kind for kind in costs if kind != likelier)
    gain = costs[other] - costs[likelier]
    which = f"{', '.join(names)}: the data set does not state what a sample is."
    if gain < PARAMETER_COST:
        return (
            f"{which} The data cannot tell {_WORDS['instant']} from {_WORDS['mean']}; {_WORDS[_ASSUMED]} was assumed."
        )
    sure = "surely" if gain > LEAST_GAIN else "probably"
    end = "was assumed." if likelier == _ASSUMED else f'was assumed, so state sampling = "{likelier}" and repeat.'
    told = "It" if likelier == _ASSUMED else _WORDS[_ASSUMED].capitalize()
    return f"{which} It is {sure} {_WORDS[likelier]}: the cost is {gain:.0f} lower than with the other. {told} {end}"


def _with_sampling(dataset: Dataset, names: list[str], kind: Sampling) -> Dataset:
    described = {
        name: dataclasses.replace(one, sampling=kind) if name in names else one for name, one in dataset.signals.items()
    }
    return dataclasses.replace(dataset, signals=described)


def _fitted_cost(prepared: Prepared, best: FittedModel, compared: Dataset) -> float:
    """Returns the cost of `best` after one step of least squares, over samples: bins would hide half a sample."""
    runs = list(dict.fromkeys(block.run for block in prepared.fine.blocks))
    samples = prepared.part(compared, "fit")
    error = OutputError(Replay(compared), best.plan, runs, threads=prepared.jobs, measured=samples)
    noise, sizes = prepared.fine.sample_noise, prepared.fine.scales
    share = {name: max(1.0, sizes[name].size / sizes[name].noise) for name in noise}
    error.scales = {name: Scale(noise[name] * share[name], 1.0, noise[name]) for name in error.scales}
    rows, slopes = error.residual(best.point), error.jacobian(best.point)
    if not np.isfinite(rows).all():
        return float("inf")
    step = np.linalg.lstsq(slopes, -rows, rcond=1e-9)[0]
    return 0.5 * float(np.sum((rows + slopes @ step) ** 2))
