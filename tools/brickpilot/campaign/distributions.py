"""The distributions of a campaign's inputs: each is a function from shares of its probability to values.

Every design draws shares in 0..1 and gets the values here, so that all designs know all distributions. They are those
of `scipy.stats`. A distribution without ends is cut off at the physical limits, and the rest keeps its shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.toml_file import Key, TomlFile

Array = NDArray[np.float64]

NUMBERS = {
    "uniform": ("low", "high"),
    "loguniform": ("low", "high"),
    "normal": ("mean", "sd"),
    "lognormal": ("median", "sd_of_log"),
}
"""Distribution of a number -> the numbers that it needs. `normal` and `lognormal` may have `low` and `high` too."""

KINDS = (*NUMBERS, "choice", "fixed")

_LEAST_KEPT = 0.01  # of a distribution's probability: if less is left, the file is probably wrong


@dataclass(frozen=True)
class Range:
    """The physical range, low to high, in `unit`; `whole`: whole numbers alone."""

    low: float
    high: float
    unit: str
    whole: bool = False


@dataclass(frozen=True)
class Distribution:
    """A distribution of numbers.

    Attributes:
        kind: of KINDS; `values` has its values; those of `choice` are equally likely, or have `weights`.
        first, second: the numbers that the kind needs, in the order of NUMBERS.
        low, high: where it is cut off.
        listed: the file gives a plain list: an axis of a grid.
    """

    kind: str
    first: float = 0.0
    second: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    values: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    whole: bool = False
    listed: bool = False

    @property
    def varies(self) -> bool:
        """Whether runs can differ in its value."""
        return self.kind != "fixed"

    def at(self, shares: Array) -> Array:
        """Returns the values below which these shares (n,) of the probability lie."""
        if self.kind == "fixed":
            return np.full(len(shares), self.values[0])
        if self.kind == "choice":
            ends = np.cumsum(self.weights or np.full(len(self.values), 1.0 / len(self.values)))
            index = np.searchsorted(ends / ends[-1], shares, side="right")
            return np.array(self.values)[np.minimum(index, len(self.values) - 1)]
        law = self._law()
        below, above = law.cdf(self.low), law.cdf(self.high)
        found = np.clip(law.ppf(below + shares * (above - below)), self.low, self.high)
        return np.asarray(np.round(found) if self.whole else found, dtype=np.float64)

    def kept(self) -> float:
        """Returns the share of the probability within low..high."""
        law = self._law()
        return float(law.cdf(self.high) - law.cdf(self.low))

    def _law(self) -> Any:
        from scipy import stats

        one, two = self.first, self.second
        if self.kind == "uniform":
            return stats.uniform(one, two - one)
        if self.kind == "loguniform":
            return stats.loguniform(one, two)
        return stats.norm(one, two) if self.kind == "normal" else stats.lognorm(two, scale=one)


def parse(toml: TomlFile, key: Key, entry: object, physical: Range) -> Distribution:
    """Reads a distribution: a number, a list of numbers, or a table with the key `distribution`.

    Raises:
        InputError: naming file, line and key, e.g. a range that goes beyond what is physical.
    """
    if isinstance(entry, list):
        return _choice(toml, key, entry, physical, listed=True)
    if not isinstance(entry, dict):
        return Distribution("fixed", values=(_number(toml, key, entry, physical),))
    if "distribution" not in entry:
        toml.refuse((*key, "distribution"), f"is missing: {', '.join(KINDS)}; or give a number, or a list")
    kind = toml.choice((*key, "distribution"), entry["distribution"], KINDS)
    if kind == "fixed":
        toml.known_keys(key, entry, ("distribution", "value"))
        return Distribution("fixed", values=(_number(toml, (*key, "value"), entry.get("value"), physical),))
    if kind == "choice":
        toml.known_keys(key, entry, ("distribution", "values", "weights"))
        found = _choice(toml, (*key, "values"), entry.get("values"), physical, listed=False)
        return _weighted(toml, key, entry, found)
    return _continuous(toml, key, kind, entry, physical)


def _number(toml: TomlFile, key: Key, value: object, physical: Range) -> float:
    if value is None:
        toml.refuse(key, "is missing")
    number = toml.number(key, value, physical.low, physical.high, physical.unit)
    if physical.whole and number != round(number):
        toml.refuse(key, f"{value} is not a whole number")
    return number


def _choice(toml: TomlFile, key: Key, values: object, physical: Range, *, listed: bool) -> Distribution:
    if not isinstance(values, list) or not values:
        toml.refuse(key, "needs a list of one value or more")
    found = tuple(_number(toml, key, one, physical) for one in values)
    if len(set(found)) < len(found):
        toml.refuse(key, "has a value twice")
    return Distribution("choice", values=found, listed=listed)


def _weighted(toml: TomlFile, key: Key, entry: dict[str, Any], found: Distribution) -> Distribution:
    weights = entry.get("weights", [1.0] * len(found.values))
    if not isinstance(weights, list) or len(weights) != len(found.values):
        toml.refuse((*key, "weights"), f"needs {len(found.values)} numbers, one for each value")
    numbers = tuple(toml.number((*key, "weights"), one, 1e-6, 1e6) for one in weights)
    return Distribution("choice", values=found.values, weights=numbers if "weights" in entry else ())


def _continuous(toml: TomlFile, key: Key, kind: str, entry: dict[str, Any], physical: Range) -> Distribution:
    toml.known_keys(key, entry, {"distribution", *NUMBERS[kind], "low", "high"})
    for name in NUMBERS[kind]:
        if name not in entry:
            toml.refuse((*key, name), f"is missing: {kind} needs {' and '.join(NUMBERS[kind])}")
    low = _number(toml, (*key, "low"), entry.get("low", physical.low), physical)
    high = _number(toml, (*key, "high"), entry.get("high", physical.high), physical)
    if low >= high:
        toml.refuse((*key, "high" if "high" in entry else "low"), f"low = {low:g} is not below high = {high:g}")
    if kind == "loguniform" and low <= 0:
        toml.refuse((*key, "low"), "loguniform needs a low above 0")
    if kind in ("uniform", "loguniform"):
        first, second = low, high
    else:
        centre, width = NUMBERS[kind]
        first = toml.number((*key, centre), entry[centre], 1e-12 if kind == "lognormal" else -1e9, 1e9, physical.unit)
        second = toml.number((*key, width), entry[width], 1e-12, 1e9)
    found = Distribution(kind, first, second, low, high, whole=physical.whole)
    if found.kept() < _LEAST_KEPT:
        toml.refuse(key, f"less than {_LEAST_KEPT:.0%} of it lies within {low:g}..{high:g} {physical.unit}".rstrip())
    return found
