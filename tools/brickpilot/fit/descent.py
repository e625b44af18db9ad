"""The search of a fit: descents from several starts, because the output error has more than one minimum."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.problem import Problem

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]
Count = Callable[[str], None]

_SCREENED = 32  # number of random starts at which only the cost is evaluated
FOLLOWED = 2  # number of descents from the best random starts; both systematic starts have a descent, too
_EVALUATIONS = 20  # largest number of evaluations of the residual in one descent
ROUGH, FINE = 1e-4, 1e-7  # tolerances: a descent ends if a step changes the cost by less than this share
_STEP_TOLERANCE = 1e-2  # a descent also ends at a relative step length below this share of the tolerance
_SPREAD = 1.5  # sd of the random starts, in coordinates
VISIBLE = (0.03, 0.1, 0.3)  # shares of the signals' rms by which an effect's start sizes change the signals
_SIZES = 21  # number of sizes tried to find the start sizes, up to `_DECADES` decades below and above `Free.size`
_DECADES = 5.0


@dataclass(frozen=True)
class Start:
    """One start of the fit, and the cost (half the sum of squares) at the end of its descent."""

    name: str
    cost: float


def most_starts(added: int) -> int:
    """Returns the largest number of descents in one `search` and in `added` calls of `search_sizes` after it."""
    return 2 + FOLLOWED + 2 * len(VISIBLE) * added


def counted(progress: Progress | None, total: int) -> Count:
    """Returns a function to call when one of `total` stages of a fit begins: it reports the stage to `progress`."""
    done = itertools.count()
    return lambda text: progress(next(done), total, text) if progress is not None else None


def natural_start(problem: Problem) -> Array:
    """Returns the plan's start with other values for parameters that may be zero and are not stated.

    Each of these parameters gets the size at which it changes the signals by their rms.
    """
    free, start = problem.plan.free, problem.plan.start()
    rms = problem.data.by_signal(problem.data.rms)[:, np.newaxis]
    share = np.sqrt(np.mean((problem.sensitivity(start) / rms) ** 2, axis=0))
    moved = np.array([parameter.known is None and parameter.info.minimum == 0 for parameter in free]) & (share > 0)
    return np.clip(np.where(moved, start - np.log(np.where(moved, share, 1.0)), start), *_bounds(problem))


def search(problem: Problem, random: np.random.Generator, count: Count) -> tuple[Array, tuple[Start, ...]]:
    """Returns the end of the best descent, and all starts: two systematic starts and the best of many random starts."""
    starts = np.array([problem.plan.start(), natural_start(problem)])
    spread = np.array([_SPREAD if parameter.known is None else 0.0 for parameter in problem.plan.free])
    between = random.uniform(size=(_SCREENED, len(spread)))
    candidates = starts[0] + between * (starts[1] - starts[0]) + random.normal(size=between.shape) * spread
    named = [("nominal values", starts[0]), ("natural sizes", starts[1])]
    if spread.any():
        inside = np.clip(candidates, *_bounds(problem))
        order = np.argsort(problem.costs(inside), kind="stable")[:FOLLOWED]
        named += [(f"random start {int(i) + 1} of {len(inside)}", inside[i]) for i in order]
    return _follow(problem, named, count)


def search_sizes(problem: Problem, nominal: Array, count: Count) -> tuple[Array, tuple[Start, ...]]:
    """Adds effects to a fitted nominal model.

    Few effects are smooth at size 0. So descents start from larger sizes: those that change the signals by the shares
    `VISIBLE` of their rms. If an effect may have either sign, descents start from both signs.
    """
    added = problem.plan.free[len(nominal) :]
    base = np.concatenate([nominal, [one.to_coordinate(one.info.preset) for one in added]])
    sizes = np.array([_visible_sizes(problem, base, len(nominal) + k) for k in range(len(added))])
    signs = (1.0, -1.0) if any(one.signed for one in added) else (1.0,)
    named = []
    for share, column in zip(VISIBLE, sizes.T, strict=True):
        for sign in signs:
            values = [one.to_coordinate(sign * s if one.signed else s) for one, s in zip(added, column, strict=True)]
            name = f"effects {'of' if sign > 0 else 'of minus'} {100 * share:g} %"
            named.append((name, np.concatenate([nominal, values])))
    return _follow(problem, named, count)


def _visible_sizes(problem: Problem, base: Array, index: int) -> list[float]:
    """Returns, for each share in `VISIBLE`, the size of one parameter at which it changes the signals by this share."""
    parameter = problem.plan.free[index]
    sizes = parameter.size * np.logspace(-_DECADES, _DECADES, _SIZES)
    sizes = sizes[(sizes >= parameter.info.minimum) & (sizes <= parameter.info.maximum)]
    points = np.tile(base, (len(sizes), 1))
    points[:, index] = [parameter.to_coordinate(float(size)) for size in sizes]
    moved = problem.data.predict([problem.plan.at(point) for point in points])
    changes = np.sqrt(np.mean(((moved - moved[0]) / problem.data.by_signal(problem.data.rms)) ** 2, axis=1))
    logs = np.where(np.isfinite(changes), np.log(np.maximum(changes, 1e-12)), np.inf)
    return [float(sizes[int(np.argmin(np.abs(logs - np.log(share))))]) for share in VISIBLE]


def _follow(problem: Problem, named: list[tuple[str, Array]], count: Count) -> tuple[Array, tuple[Start, ...]]:
    ends = []
    for name, point in named:
        count(f"descending from {name}")
        try:
            end = descend(problem, point, ROUGH)
        except SimulationError:
            continue
        ends.append((problem.cost(end), name, end))
    if not ends:
        raise InputError("the plant diverges from every start: are units and nominal values right?", field="nominal")
    return min(ends, key=lambda one: one[0])[2], tuple(Start(name, cost) for cost, name, _ in ends)


def _bounds(problem: Problem) -> tuple[Array, Array]:
    low, high = np.array([parameter.bounds() for parameter in problem.plan.free]).T
    return low, high


def descend(problem: Problem, point: Array, tolerance: float) -> Array:
    """Returns the end of one descent within the bounds (trust region reflective, Branch, Coleman & Li 1999).

    A step to a point at which the plant diverges is taken back and shortened.

    Raises:
        SimulationError: the plant diverges at `point` itself.
    """
    low, high = _bounds(problem)
    margin = 1e-9 * (high - low)
    inside = np.clip(point, low + margin, high - margin)
    if not np.isfinite(problem.cost(inside)):
        raise SimulationError("the plant diverges at the point from which the fit should go on")
    found = least_squares(
        problem.residual,
        inside,
        jac=problem.jacobian,
        bounds=(low, high),
        max_nfev=_EVALUATIONS,
        ftol=tolerance,
        xtol=tolerance * _STEP_TOLERANCE,
        x_scale=np.array([parameter.reach for parameter in problem.plan.free]),
        tr_solver="exact",
    )
    return np.asarray(found.x)
