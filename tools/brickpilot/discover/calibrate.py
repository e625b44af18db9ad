"""The second stage: fits the nominal model to the fit runs."""

from __future__ import annotations

import numpy as np

from brickpilot.discover.fitting import FittedModel, fit
from brickpilot.discover.prepare import Prepared
from brickpilot.errors import InputError
from brickpilot.fit.descent import Counter, search

_ROUGH, _FINE = 1e-4, 1e-5  # relative change of cost at which a descent ends


def calibrate(prepared: Prepared) -> FittedModel:
    """Returns the calibrated nominal model, fitted from several starts if some nominal value is not stated.

    Raises the noise floors of `prepared.coarse` to what the rough fit leaves from bin to bin.

    Raises:
        InputError: the plant diverges with the nominal values.
    """
    plan, error = prepared.plan, prepared.coarse
    start = plan.start()
    if any(one.known is None for one in plan.free):
        start, _ = search(error, np.random.default_rng(prepared.seed), Counter(None, 1))
    rough = fit(error, (), plan, start, _ROUGH)
    if rough is None:
        raise InputError(
            "the plant diverges with these values: are units and nominal values right?",
            file=prepared.measured.path,
            field="nominal",
        )
    error.raise_noise_floors(rough.point)
    return fit(error, (), plan, rough.point, _FINE) or rough
