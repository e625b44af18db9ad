"""One signal of one run in the stacked residual."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Segment:
    """One signal of one run in the stacked residual.

    Attributes:
        place: its rows.
        time: (n,) s since the run's first sample.
        age: s from power-on to the run's first sample.
        at: what the base model gives at these rows, by name: wheel angles, "x", or "angle" and "position" of a motor.
            Terms that depend on a missing one are not screened.
    """

    run: str
    signal: str
    place: slice
    time: NDArray[np.float64]
    age: float
    at: Mapping[str, NDArray[np.float64]]
