"""Learns the error of a simulation on some runs and predicts it on others: how much of it is predictable at all.

Three kinds of model are tried: a ridge regression, for what is nearly linear; a ridge regression on 200 radial basis
functions beside it (Nystroem's kernel approximation, Williams & Seeger 2001), for what is smooth; boosted trees
(Friedman 2001), for bends and steps. The one that predicts unseen fit runs best is taken, or the mean of the last two.
Its prediction is scaled down by as much as it proved too bold there. Held-out runs play no part in any choice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
_PROMISING = 0.99  # trees are grown for each fold where they leave at most this share of what others leave of the first
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
"""Columns (rows, columns) -> predictions (rows, targets, variants)."""

Learn = Callable[[Array, Array], Predict]
"""Columns (rows, columns) and what is learned (rows, targets) -> how it is predicted."""


@dataclass(frozen=True)
class Summed:
    """An error that sums up: its rate (rows,), and how a predicted rate (rows,) sums up to the error (rows,)."""

    rate: Array
    total: Callable[[Array], Array]


@dataclass(frozen=True)
class Error:
    """What is predicted.

    Attributes:
        value: (rows,); NaN where it is not known.
        summed: how an error that sums up is learned by its rate too; None: it does not sum up.
    """

    value: Array
    summed: Summed | None = None


def load() -> None:
    """Loads what learns. It takes a second, so that only what asks for predictions pays for it."""
    import sklearn.ensemble
    import sklearn.kernel_approximation
    import sklearn.linear_model  # noqa: F401


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


def predict(problem: Problem, errors: Sequence[Error]) -> list[Prediction]:
    """Returns the prediction of each error. Learned together, as most of the work is the same for all of them."""
    tried: list[list[_Tried]] = [[] for _ in errors]
    for table in _tables(problem, errors):
        for one in _tried(problem, table):
            tried[one.way.owner].append(one)
    chosen: dict[int, tuple[_Tried, float]] = {}
    for index, (error, found) in enumerate(zip(errors, tried, strict=True)):
        known = np.isfinite(error.value) & (problem.folds >= 0)
        if found and known.any():
            left = [float(np.sum((error.value - one.value)[known] ** 2)) for one in found]
            best = found[int(np.argmin(left))]
            chosen[index] = best, _boldness(error.value[known], best.value[known])
    bold = {index: best for index, (best, share) in chosen.items() if share > 0}
    held_out, shuffled = _held_out(problem, bold), _shuffled(problem, bold)
    found_of = []
    for index in range(len(errors)):
        if index not in bold:
            found_of.append(Prediction(np.zeros(len(problem.folds)), "nothing", {}))
            continue
        best, share = chosen[index]
        value = share * np.where(problem.folds < 0, held_out[index], best.value)
        mixed = {group: share * one for group, one in shuffled[index].items()}
        found_of.append(Prediction(value, best.by, mixed))
    return found_of


@dataclass(frozen=True)
class _Way:
    """What is learned for one of the errors, `owner`, and how the error is made of it."""

    owner: int
    target: Array
    total: Callable[[Array], Array]

    def left(self, value: Array, where: Mask) -> float:
        """Returns the sum of squares of the error less `value` (rows,) in some rows."""
        return float(np.sum((self.total(np.nan_to_num(self.target)) - value)[where] ** 2))


@dataclass(frozen=True, eq=False)
class _Table:
    """Ways whose targets are known in the same rows."""

    known: Mask
    ways: tuple[_Way, ...]


@dataclass(frozen=True, eq=False)
class _Models:
    """A learner's models of a table, one a fold, each taught by the other folds."""

    table: _Table
    learn: Learn
    by_fold: tuple[Predict, ...]


@dataclass(frozen=True)
class _Part:
    """One target and variant of a learner's models."""

    models: _Models
    target: int
    variant: int


@dataclass(frozen=True)
class _Tried:
    """A way of learning an error, the mean of its `parts`, with its prediction of unseen fit rows."""

    by: str
    way: _Way
    parts: tuple[_Part, ...]
    value: Array


def _tables(problem: Problem, errors: Sequence[Error]) -> list[_Table]:
    """Returns the ways of learning, by the rows in which they are known; none where a fold would learn from nothing."""
    by_rows: dict[bytes, list[_Way]] = {}
    for owner, error in enumerate(errors):
        ways = [_Way(owner, error.value, lambda values: values)]
        if error.summed is not None:
            ways.append(_Way(owner, error.summed.rate, error.summed.total))
        for way in ways:
            known = np.isfinite(way.target) & (problem.folds >= 0)
            by_rows.setdefault(known.tobytes(), []).append(way)
    count = int(problem.folds.max()) + 1
    tables = [_Table(np.frombuffer(key, dtype=np.bool_), tuple(ways)) for key, ways in by_rows.items()]

    def teaches(table: _Table) -> bool:
        rows = [int(np.sum(table.known & (problem.folds != fold))) for fold in range(count)]
        return count >= 2 and min(rows) >= _LEAST_ROWS

    return [table for table in tables if teaches(table)]


def _tried(problem: Problem, table: _Table) -> list[_Tried]:
    """Returns each kind of model for each way of a table; trees where they promise something."""
    ridges, kernels = (_best_variants(problem, by, _by_folds(problem, table, one)) for by, one in _LEARNERS.items())
    found = [*ridges, *kernels]
    for ridge, kernel in zip(ridges, kernels, strict=True):
        alone = _Table(table.known, (kernel.way,))
        first = _taught(_trees, problem, alone, table.known & (problem.folds != 0))
        if not _promising(problem, alone, [ridge, kernel], first):
            continue
        (trees,) = _best_variants(problem, "trees", _by_folds(problem, alone, _trees, first))
        both = _Tried("kernel and trees", kernel.way, kernel.parts + trees.parts, (kernel.value + trees.value) / 2)
        found += [trees, both]
    return found


def _promising(problem: Problem, table: _Table, others: Sequence[_Tried], first: Predict) -> bool:
    """Returns whether trees, grown for the first fold, predict it better than the others do, alone or with the last."""
    way, here = table.ways[0], problem.folds == 0
    raw = np.zeros(len(here))
    raw[here] = first(problem.columns[here])[:, 0, 0]
    trees = way.total(raw)
    left = min(way.left(one, table.known & here) for one in (trees, (trees + others[-1].value) / 2))
    return left < _PROMISING * min(way.left(one.value, table.known & here) for one in others)


def _by_folds(problem: Problem, table: _Table, learn: Learn, first: Predict | None = None) -> _Models:
    """Returns a learner's models of a table.

    Args:
        first: the model of the first fold, if there is one already.
    """
    models = [] if first is None else [first]
    for fold in range(len(models), int(problem.folds.max()) + 1):
        models.append(_taught(learn, problem, table, table.known & (problem.folds != fold)))
    return _Models(table, learn, tuple(models))


def _best_variants(problem: Problem, by: str, models: _Models) -> list[_Tried]:
    """Returns for each way of a table the variant that predicts unseen rows best."""
    table, raw = models.table, _by_unseen(problem, models, problem.columns)
    found = []
    for target, way in enumerate(table.ways):
        values = [way.total(column) for column in raw[:, target].T]
        best = int(np.argmin([way.left(value, table.known) for value in values]))
        found.append(_Tried(by, way, (_Part(models, target, best),), values[best]))
    return found


def _by_unseen(problem: Problem, models: _Models, columns: Array) -> Array:
    """Returns (rows, targets, variants) the prediction of each fit row by the model that has not seen its fold."""
    found = [model(columns[problem.folds == fold]) for fold, model in enumerate(models.by_fold)]
    raw = np.zeros((len(columns), *found[0].shape[1:]))
    for fold, one in enumerate(found):
        raw[problem.folds == fold] = one
    return raw


def _taught(learn: Learn, problem: Problem, table: _Table, rows: Mask) -> Predict:
    """Returns a model taught by some of the rows, thinned where they are many."""
    chosen = np.flatnonzero(rows)
    chosen = chosen[:: -(-len(chosen) // _TAUGHT_ROWS)]
    return learn(problem.columns[chosen], np.column_stack([way.target[chosen] for way in table.ways]))


def _mean_of(best: _Tried, raw_of: Mapping[_Models, Array]) -> Array:
    """Returns (rows,) the prediction of the error from what each of its learners predicts of its table."""
    parts = [raw_of[part.models][:, part.target, part.variant] for part in best.parts]
    return best.way.total(np.mean(parts, axis=0))


def _held_out(problem: Problem, chosen: Mapping[int, _Tried]) -> dict[int, Array]:
    """Returns error -> (rows,) the prediction of the held-out rows by models that were taught all fit rows."""
    out, raw = problem.folds < 0, dict[_Models, Array]()
    if not out.any():
        return {index: np.zeros(len(out)) for index in chosen}
    for models in dict.fromkeys(part.models for one in chosen.values() for part in one.parts):
        found = _taught(models.learn, problem, models.table, models.table.known)(problem.columns[out])
        raw[models] = np.zeros((len(out), *found.shape[1:]))
        raw[models][out] = found
    return {index: _mean_of(one, raw) for index, one in chosen.items()}


def _shuffled(problem: Problem, chosen: Mapping[int, _Tried]) -> dict[int, dict[str, Array]]:
    """Returns error -> group -> (rows,) the prediction of the fit rows with the group's columns shuffled among them."""
    order = np.flatnonzero(problem.folds >= 0)
    mixed = np.random.default_rng(problem.seed).permutation(order)
    used = dict.fromkeys(part.models for one in chosen.values() for part in one.parts)
    found: dict[int, dict[str, Array]] = {index: {} for index in chosen}
    for group in dict.fromkeys(problem.groups):
        columns = np.array(problem.columns)
        which = np.flatnonzero([one == group for one in problem.groups])
        columns[np.ix_(order, which)] = problem.columns[np.ix_(mixed, which)]
        raw = {models: _by_unseen(problem, models, columns) for models in used}
        for index, one in chosen.items():
            found[index][group] = _mean_of(one, raw)
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


def _ridges(alphas: Sequence[float], columns: Array, targets: Array) -> Predict:
    from sklearn.linear_model import Ridge

    count = targets.shape[1]
    penalties = np.tile(alphas, count)  # each target once for each penalty: one call for all
    model = Ridge(alpha=penalties).fit(columns, np.repeat(targets, len(alphas), axis=1))
    return lambda asked: np.asarray(model.predict(asked)).reshape(len(asked), count, len(alphas))


def _ridge(columns: Array, targets: Array) -> Predict:
    standard = _standardised(columns)
    model = _ridges(_RIDGE_ALPHAS, standard(columns), targets)
    return lambda asked: model(standard(asked))


def _kernel(columns: Array, targets: Array) -> Predict:
    from sklearn.kernel_approximation import Nystroem

    standard, root = _standardised(columns), columns.shape[1] ** 0.5
    basis = Nystroem(gamma=_KERNEL_WIDTH, n_components=min(_KERNEL_FUNCTIONS, len(columns)), random_state=0)
    basis.fit(standard(columns) / root)

    def wider(asked: Array) -> Array:
        plain = standard(asked)
        return np.hstack([plain, root * basis.transform(plain / root)])

    model = _ridges(_KERNEL_ALPHAS, wider(columns), targets)
    return lambda asked: model(wider(asked))


def _trees(columns: Array, targets: Array) -> Predict:
    from sklearn.ensemble import HistGradientBoostingRegressor

    models = [HistGradientBoostingRegressor(**_TREES).fit(columns, target) for target in targets.T]
    return lambda asked: np.column_stack([model.predict(asked) for model in models])[:, :, np.newaxis]


_LEARNERS: dict[str, Learn] = {"ridge": _ridge, "kernel": _kernel}
