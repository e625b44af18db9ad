"""What the free parameters of a model can take up of its residual."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.binned_error import BinnedOutputError

Array = NDArray[np.float64]


class Projection:
    """Removes from a whitened residual what the parameters of `error.plan` can take up, from `point`.

    It is linear and includes the priors.
    """

    def __init__(self, error: BinnedOutputError, point: Array) -> None:
        prior, slopes = error.prior_rows(point)
        whitened = error.sensitivity(point) * error.weight()[:, np.newaxis]
        self._prior = -prior
        self._basis, _ = np.linalg.qr(np.vstack([whitened, slopes]))

    def remainder(self, residual: Array) -> Array:
        """Returns (samples + parameters,) from (samples,). The rows of the priors come last."""
        return self._project(np.concatenate([residual, self._prior]))

    def signatures(self, changes: Iterable[Array]) -> Array:
        """Returns (samples + parameters, changes) from changes of the simulated signals, (samples,) each, in scales."""
        return np.array([self._project(np.append(one, np.zeros(len(self._prior)))) for one in changes]).T

    def _project(self, rows: Array) -> Array:
        rest: Array = rows - self._basis @ (self._basis.T @ rows)
        return rest
