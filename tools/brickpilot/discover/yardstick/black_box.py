"""Learns the error of a simulation on some runs and predicts it on others: how much of it is predictable at all.

Three kinds of model are tried: a ridge regression, for what is nearly linear; a ridge regression on 200 radial basis
functions beside it (Nystroem's kernel approximation, Williams & Seeger 2001), for what is smooth; boosted trees
(Friedman 2001), for bends and steps. The one that predicts unseen fit runs best is taken, or the mean of the last two.
Its prediction is scaled down by as much as it proved too bold there. Held-out runs play no part in any choice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_FOLDS = 4
_RIDGE_ALPHAS = (0.3, 3.0, 100.0)  # penalty on standardised columns; the larger, the smoother
_KERNEL_ALPHAS = (0.1, 1.0, 10.0)
_KERNEL_WIDTH = 0.3  # 1 over the squared distance, per column, at which the kernel has fallen to 1 / e
_KERNEL_FUNCTIONS = 200
_TREES: dict[str, Any] = {"max_iter": 40, "learning_rate": 0.12, "max_leaf_nodes": 8, "min_samples_leaf": 25}
_TREES |= {"l2_regularization": 5.0, "max_bins": 63, "early_stopping": False, "random_state": 0}
_TAUGHT_ROWS = 3000  # at most so many teach: the rest of a long log says the same again
_HOPELESS = 1.3  # trees that leave so many times more of the first fold than the others are not grown for the rest
_LEAST_ROWS = 20
_BEYOND = 0.1  # a column may leave the range that was taught by this share of it


@dataclass(frozen=True)
class Prediction:
    """The predicted error.

    Attributes:
        value: (rows,); of a fit row by models that have not seen its fold, of a held-out row by one of all fit runs.
        by: what predicts best: "ridge", "kernel", "trees", "kernel and trees" or "nothing".
        shuffled: group of columns -> (rows,) the prediction with the group's columns shuffled; 0 for held-out rows.
    """

    value: Array
    by: str
    shuffled: dict[str, Array]


@dataclass(frozen=True)
class Problem:
    """What is learned.

    Attributes:
        columns: (rows, columns).
        groups: the group of each column.
        folds: (rows,) 0.. of a fit row, -1 of a held-out row.
        seed: of the shuffling.
    """

    columns: Array
    groups: Sequence[str]
    folds: Indices
    seed: int = 0


Predict = Callable[[Array], Array]
"""Columns (rows, columns) -> predictions (rows, variants)."""

Learn = Callable[[Array, Array], Predict]
"""Columns (rows, columns) and what is learned (rows,) -> how it is predicted."""


def folds(part: Indices, is_fit: Mask, rows_of_block: Indices | None = None) -> Indices:
    """Returns (rows,) the fold of each row; rows of one part, a run or a block of time, share it.

    Parts go by turns to the fold with the fewest rows, the longest first.
    """
    found = np.full(len(part), -1, dtype=np.int64)
    sizes = {int(one): int(np.sum(is_fit & (part == one))) for one in np.unique(part[is_fit])}
    loads = np.zeros(min(_FOLDS, max(len(sizes), 1)), dtype=np.int64)
    for one in sorted(sizes, key=lambda key: (-sizes[key], key)):
        fold = int(np.argmin(loads))
        loads[fold] += sizes[one]
        found[is_fit & (part == one)] = fold
    return found


def predict(problem: Problem, error: Array, summed: Summed | None = None) -> Prediction:
    """Returns the prediction of `error` (rows,), NaN where it is not known.

    Args:
        summed: how an error that sums up is learned by its rate too; None: it does not sum up.
    """
    ways = [_Way(error, lambda values: values)]
    if summed is not None:
        ways.append(_Way(summed.rate, summed.total))
    tried = [one for way in ways for one in _tried(problem, way)]
    known = np.isfinite(error) & (problem.folds >= 0)
    if not tried or not known.any():
        return _nothing(problem)
    best = min(tried, key=lambda one: float(np.sum((error - one.value)[known] ** 2)))
    share = _boldness(error[known], best.value[known])
    if share <= 0:
        return _nothing(problem)
    value = share * best.value
    out = problem.folds < 0
    if out.any():
        taught = known & np.isfinite(best.way.target)
        value[out] = share * _all(best, problem.columns, taught, out)[out]
    shuffled = {group: share * one for group, one in _shuffled(problem, best).items()}
    return Prediction(value, best.by, shuffled)


@dataclass(frozen=True)
class Summed:
    """An error that sums up: its rate (rows,), and how a predicted rate (rows,) sums up to the error (rows,)."""

    rate: Array
    total: Callable[[Array], Array]


@dataclass(frozen=True)
class _Way:
    """What is learned, and how the error is made of it."""

    target: Array
    total: Callable[[Array], Array]


@dataclass(frozen=True)
class _Part:
    """One variant of a learner, with its models by fold."""

    learn: Learn
    variant: int
    models: tuple[Predict, ...]


@dataclass(frozen=True)
class _Tried:
    """A way of learning, the mean of its `parts`, with its prediction of unseen fit rows."""

    by: str
    way: _Way
    parts: tuple[_Part, ...]
    value: Array


def _nothing(problem: Problem) -> Prediction:
    return Prediction(np.zeros(len(problem.folds)), "nothing", {})


def _tried(problem: Problem, way: _Way) -> list[_Tried]:
    """Returns each kind of model for one way of learning; none where a fold would learn from nothing."""
    known = np.isfinite(way.target) & (problem.folds >= 0)
    count = int(problem.folds.max()) + 1
    if count < 2 or min(int(np.sum(known & (problem.folds != fold))) for fold in range(count)) < _LEAST_ROWS:
        return []
    ridge, kernel = (_best_variant(problem, way, known, by, learn) for by, learn in _LEARNERS.items())
    first = _one_fold(problem, way, known, _trees, 0)
    if _hopeless(problem, way, known, [ridge, kernel], first):
        return [ridge, kernel]
    trees = _best_variant(problem, way, known, "trees", _trees, first)
    both = _Tried("kernel and trees", way, kernel.parts + trees.parts, (kernel.value + trees.value) / 2)
    return [ridge, kernel, trees, both]


def _hopeless(problem: Problem, way: _Way, known: Mask, others: Sequence[_Tried], grown: Predict) -> bool:
    """Returns whether the trees grown for the first fold predict it so badly that none are grown for the rest."""
    first = known & (problem.folds == 0)
    target = way.target[first]

    def left(part: _Part) -> float:
        return float(np.sum((target - part.models[0](problem.columns[first])[:, part.variant]) ** 2))

    least = min(left(part) for one in others for part in one.parts)
    trees = left(_Part(_trees, 0, (grown,)))
    return trees > _HOPELESS * min(least, float(target @ target))


def _squares(way: _Way, where: Mask, value: Array) -> float:
    error = way.total(np.nan_to_num(way.target))
    return float(np.sum((error - value)[where] ** 2))


def _one_fold(problem: Problem, way: _Way, known: Mask, learn: Learn, fold: int) -> Predict:
    taught = known & (problem.folds != fold)
    return _taught(learn, problem.columns[taught], way.target[taught])


def _best_variant(
    problem: Problem, way: _Way, known: Mask, by: str, learn: Learn, first: Predict | None = None
) -> _Tried:
    """Returns the variant of a learner that predicts unseen rows best.

    Args:
        first: its model of the first fold, if there is one already.
    """
    folds = range(int(problem.folds.max()) + 1)
    models = [first or _one_fold(problem, way, known, learn, 0)]
    models += [_one_fold(problem, way, known, learn, fold) for fold in folds[1:]]
    found = [model(problem.columns[problem.folds == fold]) for fold, model in zip(folds, models, strict=True)]
    raw = np.zeros((len(known), found[0].shape[1]))
    for fold, one in zip(folds, found, strict=True):
        raw[problem.folds == fold] = one
    values = [way.total(column) for column in raw.T]
    best = int(np.argmin([_squares(way, known, value) for value in values]))
    return _Tried(by, way, (_Part(learn, best, tuple(models)),), values[best])


def _taught(learn: Learn, columns: Array, target: Array) -> Predict:
    every = -(-len(target) // _TAUGHT_ROWS)
    return learn(columns[::every], target[::every])


def _all(best: _Tried, columns: Array, taught: Mask, asked: Mask) -> Array:
    """Returns (rows,) the prediction by models that were taught all fit rows, for the rows that are asked."""
    found = np.zeros(len(columns))
    for part in best.parts:
        model = _taught(part.learn, columns[taught], best.way.target[taught])
        found[asked] += model(columns[asked])[:, part.variant] / len(best.parts)
    return best.way.total(found)


def _shuffled(problem: Problem, best: _Tried) -> dict[str, Array]:
    """Returns group -> (rows,) the prediction of the fit rows with the group's columns shuffled among all fit rows."""
    order = np.flatnonzero(problem.folds >= 0)
    mixed = np.random.default_rng(problem.seed).permutation(order)
    found = {}
    for group in dict.fromkeys(problem.groups):
        columns = np.array(problem.columns)
        which = np.flatnonzero([one == group for one in problem.groups])
        columns[np.ix_(order, which)] = problem.columns[np.ix_(mixed, which)]
        raw = np.zeros(len(columns))
        for part in best.parts:
            for fold, model in enumerate(part.models):
                asked = problem.folds == fold
                raw[asked] += model(columns[asked])[:, part.variant] / len(best.parts)
        found[group] = best.way.total(raw)
    return found


def _boldness(error: Array, predicted: Array) -> float:
    """Returns the factor, 0..1, by which the prediction fits the error best."""
    power = float(predicted @ predicted)
    return float(np.clip(error @ predicted / power, 0.0, 1.0)) if power > 0 else 0.0


def _standardised(columns: Array) -> Callable[[Array], Array]:
    """Returns how columns are centred and scaled, and held near the range that was taught."""
    middle, size = columns.mean(axis=0), columns.std(axis=0)
    size = np.where(size > 0, size, 1.0)
    low, high = columns.min(axis=0), columns.max(axis=0)
    low, high = low - _BEYOND * (high - low), high + _BEYOND * (high - low)
    return lambda asked: np.asarray((np.clip(asked, low, high) - middle) / size)


def _ridges(alphas: Sequence[float], columns: Array, target: Array) -> Predict:
    from sklearn.linear_model import Ridge

    copies = np.repeat(target[:, np.newaxis], len(alphas), axis=1)  # one target for each penalty: one call for all
    model = Ridge(alpha=np.array(alphas)).fit(columns, copies)
    return lambda asked: np.asarray(model.predict(asked))


def _ridge(columns: Array, target: Array) -> Predict:
    standard = _standardised(columns)
    model = _ridges(_RIDGE_ALPHAS, standard(columns), target)
    return lambda asked: model(standard(asked))


def _kernel(columns: Array, target: Array) -> Predict:
    from sklearn.kernel_approximation import Nystroem

    standard, root = _standardised(columns), columns.shape[1] ** 0.5
    basis = Nystroem(gamma=_KERNEL_WIDTH, n_components=min(_KERNEL_FUNCTIONS, len(columns)), random_state=0)
    basis.fit(standard(columns) / root)

    def wider(asked: Array) -> Array:
        plain = standard(asked)
        return np.hstack([plain, root * basis.transform(plain / root)])

    model = _ridges(_KERNEL_ALPHAS, wider(columns), target)
    return lambda asked: model(wider(asked))


def _trees(columns: Array, target: Array) -> Predict:
    from sklearn.ensemble import HistGradientBoostingRegressor

    model = HistGradientBoostingRegressor(**_TREES).fit(columns, target)
    return lambda asked: np.asarray(model.predict(asked))[:, np.newaxis]


_LEARNERS: dict[str, Learn] = {"ridge": _ridge, "kernel": _kernel}
