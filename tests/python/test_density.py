"""The density that `evidence` gives a residual, against a second implementation of the page that defines it.

The density is hyperbolic, p(x) = exp(-k^2 sqrt(1 + (x / (k s))^2)) / (2 k s K1(k^2)): square near zero and linear
beyond k scales. Here it is integrated by quadrature, and the scale is found as the maximum of a likelihood.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from brickpilot.discover import evidence
from brickpilot.discover.evidence import Judge
from brickpilot.fit.residual import Residual, Scale
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

KNEE = 2.0


def hyperbolic(x: Array | float, size: float) -> Any:
    """The unnormalised density of a residual of scale `size`."""
    return np.exp(-(KNEE**2) * (np.sqrt(1 + (np.asarray(x) / (KNEE * size)) ** 2) - 1))


NORM = quad(lambda x: float(hyperbolic(x, 1.0)), -math.inf, math.inf)[0]


def log_density(residual: Array, size: float) -> Array:
    return np.asarray(np.log(hyperbolic(residual, size)) - math.log(NORM * size))


def likeliest_scale(residual: Array, floor: float) -> float:
    """The maximum-likelihood scale of a residual, found by a search, or `floor` if this is larger."""
    sizes = (1e-3 * float(np.abs(residual).max()), 10 * float(np.abs(residual).max()))
    found = minimize_scalar(
        lambda x: -log_density(residual, math.exp(x)).sum(), bounds=np.log(sizes), method="bounded",
        options={"xatol": 1e-9},
    )  # fmt: skip
    return max(math.exp(found.x), floor)


def by_stretch(residual: Array, stretch: NDArray[np.int64], count: int, floor: float) -> Array:
    """The log density of each stretch of one signal; its scale is the weighted rms of the other stretches."""
    size = likeliest_scale(residual, floor)
    weighted = residual**2 / np.sqrt(1 + (residual / (KNEE * size)) ** 2)
    found = np.zeros(count)
    for one in range(count):
        others = weighted[stretch != one]
        own = max(float(np.sqrt(others.mean())) if len(others) else 0.0, floor)
        found[one] = log_density(residual[stretch == one], own).sum()
    return found


def given(stretches: int = 12, each: int = 30) -> tuple[Judge, dict[str, slice]]:
    """Returns a judge of two signals, the first twice as long as the second."""
    sizes = {"speed": 2 * stretches * each, "yaw_rate": stretches * each}
    places, start = {}, 0
    for name, size in sizes.items():
        places[name] = slice(start, start + size)
        start += size
    blocks = tuple(SimpleNamespace(run="run", signal=name, place=place) for name, place in places.items())
    scales = {"speed": Scale(0.3, 1.0, 0.2, 0.2), "yaw_rate": Scale(0.05, 1.0, 0.02, 0.02)}
    stretch = np.concatenate([np.repeat(np.arange(stretches), size // stretches) for size in sizes.values()])
    values = np.zeros(start)
    unknown: Any = None
    data = Residual(unknown, frozenset({"run"}), blocks, values, unknown, scales, dict.fromkeys(sizes, 1.0), (), 0.0)  # type: ignore[arg-type]
    return Judge(data, stretch, stretches, 0.0), places


def residuals(seed: int) -> Array:
    """A residual with outliers: its scale is far above the noise in one signal and below it in the other."""
    random = np.random.default_rng(seed)
    judge, places = given()
    found = np.empty(len(judge.stretch))
    found[places["speed"]] = 0.8 * random.standard_t(3, places["speed"].stop)
    found[places["yaw_rate"]] = 0.01 * random.normal(size=len(found) - places["speed"].stop)
    return found


@pytest.mark.parametrize("seed", range(3))
def test_the_density_of_each_stretch_is_that_of_the_reference(seed: int) -> None:
    judge, places = given()
    residual = residuals(seed)
    expected = sum(
        by_stretch(residual[place], judge.stretch[place], judge.count, judge.data.scales[name].noise)
        for name, place in places.items()
    )
    # The scale is iterated to a thousandth.
    assert judge.density(residual) == pytest.approx(expected, rel=1e-4, abs=0.02)


def test_a_stretch_is_judged_by_the_scale_of_the_others() -> None:
    """A stretch ten times as large as before is judged unlikely, though its own scale would make it usual."""
    judge, _ = given()
    residual = residuals(1)
    base, worse = residual.copy(), residual.copy()
    worse[judge.stretch == 4] *= 10
    fell = judge.density(base) - judge.density(worse)
    assert fell[4] > 100
    assert fell[4] > 20 * max(abs(np.delete(fell, 4)))


def test_a_model_that_predicts_every_stretch_better_makes_none_less_likely() -> None:
    """If each model had its own scale, the stretch that stays an outlier would count against the better model."""
    judge, _ = given()
    before = residuals(1)
    before[judge.stretch == 4] *= 20
    after = np.where(judge.stretch == 4, 0.9, 0.1) * before
    assert (judge.density(after) - judge.density(before))[4] < -100
    rises = judge.rises(before, after)
    assert np.all(rises > 0)
    assert np.all(judge.rises(after, before) < 0)
    assert judge.rises(before, before) == pytest.approx(np.zeros(judge.count))


def test_the_most_likely_scale_is_the_reference_s() -> None:
    random = np.random.default_rng(2)
    for residual in (0.4 * random.normal(size=900), 2.0 * random.standard_t(2, 900), random.uniform(-1, 1, 900)):
        assert evidence.scale_of_rest(residual, 1e-6) == pytest.approx(likeliest_scale(residual, 1e-6), rel=2e-3)
    assert evidence.scale_of_rest(0.01 * random.normal(size=900), 0.2) == 0.2
