"""How time grows with size: the exponent of a power law, as the slope of a straight line on two logarithmic axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

LINEAR = 0.1
"""Growth is called linear where the exponent's 95 % interval lies within 1 +- this, ..."""

NARROW = 0.3
"""... or holds 1 and reaches this far to each side at most: that leaves out the root, 0.5, and the square, 2."""


@dataclass(frozen=True)
class PowerLaw:
    """seconds = ``seconds_of_one`` * size ** ``exponent``, with the exponent's 95 % interval."""

    exponent: float
    low: float
    high: float
    seconds_of_one: float

    @property
    def verdict(self) -> str:
        """In words: "linear", "less than linear", "more than linear", or "not determined" by these times."""
        within = self.low >= 1 - LINEAR and self.high <= 1 + LINEAR
        if within or (self.low <= 1 <= self.high and self.high - self.low <= 2 * NARROW):
            return "linear"
        if self.high < 1:
            return "less than linear"
        return "more than linear" if self.low > 1 else "not determined"


def fit(sizes: Sequence[float], seconds: Sequence[Sequence[float]]) -> PowerLaw:
    """Fits a power law to the smallest time of each size.

    The smallest is the one that other programs on the machine disturbed least. The interval comes from the scatter of
    the sizes about the line (Student's t), so that it holds what the repeats of one size do not show.

    Args:
        sizes: three or more, above 0.
        seconds: the times of each size, above 0.
    """
    x, y = np.log(sizes), np.log([min(times) for times in seconds])
    line = stats.linregress(x, y)
    half = float(stats.t.ppf(0.975, len(sizes) - 2) * line.stderr)
    slope = float(line.slope)
    return PowerLaw(slope, slope - half, slope + half, float(np.exp(line.intercept)))
