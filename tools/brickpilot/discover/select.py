"""Fits candidates, compares them, and decides which effects the data ask for.

Forward: the best candidate is added while it takes away enough. All pairs of the best few compete with it, so that two
effects at once are not read as one in between. Backward: what the others make needless goes again.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.band import Band
from brickpilot.discover.candidates import (
    PARAMETER_COST,
    Candidate,
    Seen,
    Trial,
    candidates,
    read_limits,
    screen,
    sizes_of,
)
from brickpilot.errors import SimulationError
from brickpilot.fit.descent import descend
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Tell = Callable[[str], None]
_Item = TypeVar("_Item")

_ROUGH, _POLISHED = 1e-3, 1e-4
_DESCENTS, _GAINED = 6, 3e-4  # of one fit at the most, and share of the cost below which another one is not worth it
_FOLLOWED = 10  # candidates of a screen that are fitted
_POLISHED_COUNT = 5  # of those, that are fitted to the end
_STRUCTURED = 1.2  # times the cost of noise: more has structure, which the wrong effect may have left
_ORDERS_NEAR = np.linspace(-0.08, 0.08, 161).tolist()  # shares of an order, by which it may be off
_LOWER = 0.98  # of the cost: a valley that is worth a descent
_PAIRED = 5  # of those, of which all pairs are fitted
_ROUNDS = 5
_MOST = 4  # effects, before needless ones are removed
_BENT_SD = 5.0  # that a nominal value was moved by, to hide something
_BEYOND = 0.9  # of the largest reading: what limits a sensor is not less
_TIED = 0.05  # of the best one's charged cost
_LEAST_BESIDE = 0.1  # of a parameter: the least that the parameter which it adds to has to be
_CLOSE = 0.2  # of the best one's gain: those nearer to it than that are fitted to the end
_HOPE = 0.3  # of what an effect has to take away: a screened candidate that promises less is not fitted
_HELD = 0.25  # of the share it takes away from the fitted runs: what an effect has to take from the held-out ones
_LEAST_GAIN = 60.0  # of cost, for an effect
_LEAST_SHARE = 0.05  # of the cost that remains
_SHARE_OF_ALL = 0.004  # of what the effects before it took away
_SHARE_UNEXPLAINED = 0.2  # beside it, of what remains that is not noise


@dataclass(frozen=True, eq=False)
class Fitted:
    """One model fitted to the fit runs.

    Attributes:
        chosen: the candidates switched on beside what the base model holds.
        cost: half of all squared residuals and priors, in scales.
        charged: the cost with what its parameters have to be worth, which grows with what they leave unexplained.
        losses: (samples,) the data's share of the cost.
    """

    chosen: tuple[Candidate, ...]
    plan: Plan
    point: Array
    cost: float
    charged: float
    losses: Array

    @property
    def model(self) -> Model:
        return self.plan.at(self.point)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.effect for one in self.chosen)

    @property
    def repeats(self) -> bool:
        """Whether any of its effects repeats with a wheel's angle."""
        return any(one.repeats for one in self.chosen)


@dataclass(frozen=True)
class Step:
    """One round of the search: what it began with, every model tried, best first, and whether the best was taken."""

    before: Fitted
    tried: tuple[Fitted, ...]
    taken: bool


@dataclass(frozen=True)
class Selection:
    """`best`: what is kept. `nominal`: the base model refitted. `steps`: how it came to that."""

    nominal: Fitted
    best: Fitted
    steps: tuple[Step, ...]


def enough(before: float, after: float, trusted: float) -> bool:
    """Whether a fall of charged cost is more than clean data of a richer machine ever show."""
    return before - after > needed(after, trusted)


def _believed(band: Band, nominal: Fitted, current: Fitted, found: Fitted) -> bool:
    """Whether `found` goes beyond `current`: by more than an effect that is not quite as the library has it leaves.

    Where `current` bent a nominal value that `found` need not bend, what it gains is not of that kind.
    """
    gain = current.charged - found.charged
    unbent = _bent(band, current) > _BENT_SD > 2 * _bent(band, found)
    least = 0.0 if unbent else _SHARE_OF_ALL * (nominal.cost - current.cost)
    return enough(current.charged, found.charged, band.trusted()) and gain > least


def _bent(band: Band, found: Fitted) -> float:
    """sds that the nominal value is moved by that is moved most."""
    return float(np.abs(band.with_plan(found.plan).prior_rows(found.point)[0]).max(initial=0.0))


def needed(after: float, trusted: float) -> float:
    """How much of the cost an effect has to take away that leaves `after`.

    Where a model leaves much more than a model is trusted to, it is wrong in other ways too, and whatever moves takes
    some of that away. `trusted`: the cost of a residual of one scale throughout.
    """
    unexplained = max(0.0, 1 - trusted / after) if after > 0 else 0.0
    return max(_LEAST_GAIN, (_LEAST_SHARE + _SHARE_UNEXPLAINED * unexplained) * after)


def select(band: Band, nominal: Fitted, *, seen: Seen, jobs: int, tell: Tell) -> Selection:
    """Searches forward and backward from `nominal`. `band` may be coarse."""
    current, steps, noise = nominal, list[Step](), band.noise_cost()
    while len(current.chosen) < _MOST and len(steps) < _ROUNDS:
        tell(f"looking for effect {len(current.chosen) + 1}")
        tried = _round(band, current, seen, jobs)
        taken = bool(tried) and _believed(band, nominal, current, tried[0])
        if len(current.chosen) == 1 and (taken or current.cost > _STRUCTURED * noise):
            tried += _pairs(band, nominal, steps[-1].tried, jobs)
            if tried and min(one.cost for one in tried) > _STRUCTURED * noise:
                tried += [found for other in _tied(steps[-1].tried) for found in _round(band, other, seen, jobs)]
            tried = _best_first(tried)
            taken = bool(tried) and _believed(band, nominal, current, tried[0])
        if not taken and len(current.chosen) > 1 and current.cost > _STRUCTURED * noise:
            tried = _best_first(tried + _exchanged(band, current, seen, jobs))
            taken = bool(tried) and _believed(band, nominal, current, tried[0])
        steps.append(Step(current, tuple(tried), taken))
        if not taken:
            break
        current = tried[0]
        if seen.wheels and not seen.closely and current.cost > _STRUCTURED * noise and current.repeats:
            break  # over whole runs its wheels lose their phase, and what is tried beside it takes up that
    tell("removing what is not needed")
    return Selection(nominal, pruned(band, current, jobs), tuple(steps))


def fit(band: Band, chosen: Sequence[Candidate], plan: Plan, point: Array, tolerance: float) -> Fitted | None:
    """The end of a descent from `point`; None where the plant diverges there."""
    problem = band.with_plan(plan, threads=1)
    try:
        end = descend(problem, point, tolerance)
    except SimulationError:
        return None
    residual = problem.residual(end)
    losses = residual[: len(problem.measured)] ** 2 / 2
    cost = float(np.sum(residual**2)) / 2
    each = PARAMETER_COST * max(1.0, cost / problem.trusted())
    return Fitted(tuple(chosen), plan, end, cost, cost + each * sum(len(one.free) for one in chosen), losses)


def polish(band: Band, fits: Sequence[Fitted], jobs: int) -> list[Fitted]:
    """Fits each to the end, with sensitivities of its own; best first.

    Those of the nominal parameters, which cost most, are taken anew where a descent ends, until nothing is gained.
    """

    def one(found: Fitted) -> Fitted | None:
        for _ in range(_DESCENTS):
            own = band.with_plan(found.plan, threads=1)
            own.keep(found.point, len(found.point) - sum(len(candidate.free) for candidate in found.chosen))
            better = fit(own, found.chosen, found.plan, found.point, _POLISHED)
            if better is None:
                return None
            gain, found = found.cost - better.cost, better
            if gain < _GAINED * better.cost:
                break
        return found

    return _best_first(_each(one, fits, jobs))


def _round(band: Band, current: Fitted, seen: Seen, jobs: int) -> list[Fitted]:
    """The best candidates beside `current`, fitted.

    Where the fit had to bend nominal values far beyond what is known of them, candidates are tried from the stated ones
    too: an effect must not hide in a nominal value.
    """
    points = [current.point]
    if _bent(band, current) > _BENT_SD:
        points.append(_restated(current))
    rough = [found for point in points for found in _from(band, current, point, seen, jobs)]
    if rough and (first := _best_first(rough)[0]).chosen[-1].repeats and (other := _retuned(band, first)):
        rough.append(other)
    best = min((one.charged for one in rough), default=0.0)
    near = best + _CLOSE * max(current.cost - best, 0.0)
    close = [one for one in _best_first(rough) if one.charged < near][:_POLISHED_COUNT]
    polished = [one for one in polish(band, close, jobs) if _possible(one, seen)]
    return _best_first(polished + [one for one in rough if one not in close])


def _restated(current: Fitted) -> Array:
    """`current`'s point with the nominal parameters as they were stated."""
    start = current.plan.start()
    stated = [one.known is not None for one in current.plan.free]
    return np.where(stated, start, current.point)


def _from(
    band: Band,
    current: Fitted,
    point: Array,
    seen: Seen,
    jobs: int,
) -> list[Fitted]:
    """The most hopeful of `chosen`, or of all candidates, fitted beside `current` from `point`."""
    here = band.with_plan(current.plan)
    here.keep(point, len(point))
    first: dict[tuple[str, tuple[str, ...]], Trial] = {}
    for trial in screen(here, point, candidates(current.model), seen=seen):
        if _hopeful(trial, band.trusted()):
            first.setdefault((trial.candidate.effect, trial.candidate.free), trial)

    def one(trial: Trial) -> Fitted | None:
        plan = trial.candidate.starting(current.plan, trial.values)
        start = np.concatenate([point, plan.start()[len(point) :]])
        return fit(here, (*current.chosen, trial.candidate), plan, start, _ROUGH)

    fits = _each(one, list(first.values())[:_FOLLOWED], jobs)
    fits += _each(lambda pair: _apart(here, current, *pair), _one_phase(current, fits), jobs)
    return [found for found in fits if _possible(found, seen)]


def _one_phase(current: Fitted, fits: Sequence[Fitted]) -> list[tuple[Fitted, Candidate]]:
    """Those of `fits` that gave both wheels one phase, each with the candidate that gives them two."""
    return [
        (found, other)
        for found in fits
        for other in candidates(current.model)
        if other.effect == found.names[-1] and {*other.free} - {*found.chosen[-1].free} == {"phase_difference"}
    ]


def _apart(band: Band, current: Fitted, found: Fitted, candidate: Candidate) -> Fitted | None:
    """`candidate` beside `current` from where `found` ended.

    Two phases at once are not read off a line that begins at no effect, where the wheels stand and slip by turns.
    """
    plan = candidate.starting(current.plan, found.model.effects[candidate.effect])
    start = np.concatenate([found.point[: len(current.point)], plan.start()[len(current.point) :]])
    return fit(band, (*current.chosen, candidate), plan, start, _ROUGH)


def _retuned(band: Band, found: Fitted) -> Fitted | None:
    """`found`, whose last effect repeats, from the best order near its own; None where that is its own.

    Beside the right order lie others that are a turn off over the way, each with a valley that a descent stays in.
    """
    problem = band.with_plan(found.plan)
    index = [one.name for one in found.plan.free].index(f"{found.names[-1]}.order")
    along = np.eye(len(found.point))[index]
    starts = [found.point + off * along for off in _ORDERS_NEAR]
    costs = [float(problem.losses(found.plan.at(start)).sum()) for start in starts]
    best = int(np.argmin(costs))
    if costs[best] > _LOWER * float(problem.losses(found.model).sum()):
        return None
    return fit(problem, found.chosen, found.plan, starts[best], _ROUGH)


def _possible(found: Fitted, seen: Seen) -> bool:
    """Whether each effect is what its name says.

    A repetition repeats, nothing was read beyond what is called its limit, and what a breakaway torque comes down to
    when it moves is dry friction.
    """
    tables = found.model.effects
    repeats = all(tables[one.effect]["order"] >= seen.least_order for one in found.chosen if one.repeats)
    limits = [(tables[one.effect][name], of) for one in found.chosen for name, of in read_limits(one)]
    additions = [
        (table[info.only_with], table[info.name])
        for name, table in tables.items()
        for info in catalogue.effect(name).parameters
        if info.only_with
    ]
    return (
        repeats
        and all(limit > _BEYOND * seen.largest.get(of, 0.0) for limit, of in limits)
        and all(other > _LEAST_BESIDE * added for other, added in additions)
    )


def _hopeful(trial: Trial, trusted: float) -> bool:
    """Whether a candidate may take away enough, for all that its signature at one size says."""
    return trial.before - trial.after > _HOPE * needed(trial.after, trusted)


def _pairs(band: Band, nominal: Fitted, singles: Sequence[Fitted], jobs: int) -> list[Fitted]:
    """All pairs of the best few single candidates, each from where it stood alone."""
    best: dict[str, Fitted] = {}
    for single in singles:
        if len(single.chosen) == len(nominal.chosen) + 1:
            best.setdefault(single.names[-1], single)
    few = list(best.values())[:_PAIRED]

    def one(pair: tuple[Fitted, Fitted]) -> Fitted | None:
        joined = _joined(nominal, pair)
        own = band.with_plan(joined.plan, threads=1)
        own.keep(joined.point, len(nominal.point))
        return fit(own, joined.chosen, joined.plan, joined.point, _ROUGH)

    rough = _best_first(_each(one, list(itertools.combinations(few, 2)), jobs))
    return polish(band, rough[:2], jobs)


def _tied(tried: Sequence[Fitted]) -> list[Fitted]:
    """The next best of `tried` with other effects, if it does nearly as well: alone the wrong one may be ahead."""
    others = [one for one in tried if one.names != tried[0].names]
    return [one for one in others[:1] if one.charged < (1 + _TIED) * tried[0].charged]


def _exchanged(band: Band, current: Fitted, seen: Seen, jobs: int) -> list[Fitted]:
    """`current` with each of its effects in turn replaced by what is best beside the others."""
    found: list[Fitted] = []
    for fewer in polish(band, [_without(current, name) for name in current.names], jobs):
        found += _round(band, fewer, seen, jobs)[:2]
    return found


def _joined(nominal: Fitted, pair: tuple[Fitted, Fitted]) -> Fitted:
    """Both candidates' effects, from the mean of the nominal values that each alone led to."""
    count = len(nominal.point)
    first, second = pair
    model = dataclasses.replace(first.plan.model, effects={**first.plan.model.effects, **second.plan.model.effects})
    free: tuple[Free, ...] = (*first.plan.free, *second.plan.free[count:])
    point = np.concatenate(
        [(first.point[:count] + second.point[:count]) / 2, first.point[count:], second.point[count:]]
    )
    return Fitted((*first.chosen, second.chosen[-1]), Plan(model, free, ()), point, np.inf, np.inf, np.empty(0))


def pruned(band: Band, found: Fitted, jobs: int, unseen: Band | None = None) -> Fitted:
    """`found` without the effects that the others make needless, fitted again; at least one is left.

    Args:
        unseen: the held-out runs: an effect that does not help there is needless, however well it fits.
    """
    while len(found.chosen) > 1:
        shorter = polish(band, [_without(found, name) for name in found.names], jobs)
        needless = [one for one in shorter if not worth(band, one, found, unseen)]
        if not needless:
            return found
        found = needless[0]
    return found


def worth(band: Band, before: Fitted, after: Fitted, unseen: Band | None) -> bool:
    """Whether `after` is believed beside the smaller model `before`: on fitted runs, and on those it has not seen."""
    if not enough(before.charged, after.charged, band.trusted()):
        return False
    if unseen is None:
        return True
    fall = 1 - unseen.losses(after.model).sum() / max(float(unseen.losses(before.model).sum()), 1e-12)
    expected = 1 - after.losses.sum() / max(float(before.losses.sum()), 1e-12)
    return bool(fall > _HELD * expected)


def _without(found: Fitted, name: str) -> Fitted:
    kept = [index for index, one in enumerate(found.plan.free) if not one.name.startswith(f"{name}.")]
    effects = {key: table for key, table in found.plan.model.effects.items() if key != name}
    plan = Plan(
        dataclasses.replace(found.plan.model, effects=effects), tuple(found.plan.free[index] for index in kept), ()
    )
    chosen = tuple(one for one in found.chosen if one.effect != name)
    return Fitted(chosen, plan, found.point[kept], np.inf, np.inf, np.empty(0))


def without_parameter(found: Fitted, candidate: Candidate, name: str) -> Fitted:
    """`found` with one parameter of `candidate` held at zero; without the effect where no size of it is left."""
    left = tuple(one for one in candidate.free if one != name)
    smaller = dataclasses.replace(candidate, free=left, fixed={**candidate.fixed, name: 0.0})
    if not sizes_of(smaller):
        return _without(found, candidate.effect)
    kept = [index for index, one in enumerate(found.plan.free) if one.name != f"{candidate.effect}.{name}"]
    table = {**found.plan.model.effects[candidate.effect], name: 0.0}
    model = dataclasses.replace(found.plan.model, effects={**found.plan.model.effects, candidate.effect: table})
    plan = Plan(model, tuple(found.plan.free[index] for index in kept), ())
    chosen = tuple(smaller if one is candidate else one for one in found.chosen)
    return Fitted(chosen, plan, found.point[kept], np.inf, np.inf, np.empty(0))


def _each(work: Callable[[_Item], Fitted | None], items: Sequence[_Item], jobs: int) -> list[Fitted]:
    with ThreadPoolExecutor(jobs) as pool:
        return [found for found in pool.map(work, items) if found is not None]


def _best_first(fits: Sequence[Fitted]) -> list[Fitted]:
    return sorted(fits, key=lambda one: one.charged)
