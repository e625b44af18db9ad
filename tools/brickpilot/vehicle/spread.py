"""The distribution of a fitted model's values about their estimates, from which robots are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """A normal distribution of the coordinates of all fitted parameters about their estimates.

    Attributes:
        names: "mass" or "effect.parameter".
        values: estimates, SI.
        units: the units, SI: a coordinate is (value - estimate) / unit. None: a coordinate is log(value / estimate).
        covariance: the covariance of the coordinates, (parameters, parameters).
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    units: tuple[float | None, ...]
    covariance: Array

    @property
    def correlation(self) -> Array:
        """The correlation of the coordinates, (parameters, parameters)."""
        sd = np.sqrt(np.diag(self.covariance))
        some = np.where(sd > 0, sd, 1.0)
        return np.asarray(self.covariance / np.outer(some, some))

    def at(self, coordinates: Array) -> dict[str, float]:
        """Returns name -> value in SI at these coordinates; values may be outside the parameters' ranges."""
        rows = zip(self.names, self.values, self.units, coordinates.tolist(), strict=True)
        return {
            name: value * math.exp(min(x, 700.0)) if unit is None else value + x * unit for name, value, unit, x in rows
        }

    def to_json(self) -> dict[str, Any]:
        """Returns the object that `from_json` reads."""
        return {
            "parameters": list(self.names),
            "values": list(self.values),
            "units": list(self.units),
            "covariance": self.covariance.tolist(),
        }


def from_json(given: Mapping[str, Any]) -> Spread:
    """Returns the spread that an object in calibrate.json or verdict.json holds.

    Raises:
        ValueError: the object holds no spread, or its covariance is not valid.
    """
    try:
        names, values, units = (tuple(given[key]) for key in ("parameters", "values", "units"))
        covariance = np.array(given["covariance"], dtype=float).reshape(len(names), len(names))
        numbers = np.array([*values, *(1.0 if unit is None else unit for unit in units)], dtype=float)
    except (KeyError, TypeError) as error:
        raise ValueError(f"lacks {error}") from error
    if not all(isinstance(name, str) for name in names):
        raise ValueError("has a parameter whose name is no text")
    if not len(names) == len(values) == len(units) or not (
        np.isfinite(numbers).all() and np.isfinite(covariance).all()
    ):
        raise ValueError("has a parameter without value, unit or covariance")
    if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance).min(initial=0.0) < -1e-6 * (
        1 + np.trace(covariance)
    ):
        raise ValueError("its covariance is not symmetric, or has a negative variance")
    return Spread(names, values, units, covariance)
