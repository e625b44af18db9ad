"""Least squares of a residual: cost, derivatives by finite differences, and priors, in the coordinates of a plan."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brickpilot.fit import robust
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.residual import Residual

Array = NDArray[np.float64]

_EFFECT_STEP, _NOMINAL_STEP = 1e-2, 1e-4  # steps of finite differences, in coordinates
_ANCHOR_SD = 30.0  # sd, in coordinates, of a weak prior: it fixes only coordinates that the data do not determine
_COMMON_SD = 0.01  # prior sd, in coordinates, of the mean over all runs of a value that each run has of its own


def _kind(free: Free) -> str:
    """Returns the kind of a run's own value as "kind@"; the "@" tells it from a nominal parameter of the same name."""
    return "".join(free.name.partition("@")[:2])


@dataclass(frozen=True, eq=False)
class Problem:
    """Least squares of a residual in the coordinates of `plan.free`, priors included.

    If the plant diverges, the residual is NaN. If it diverges only after a finite difference's step, the slope is 0.

    Attributes:
        holds_priors: whether priors count in the cost. False while the residual's scale is unknown: priors enlarge the
            residual, and so the scale would come out too large.
        kept: number of a coordinate -> (values,) the fixed sensitivity to this coordinate; see `keeping`.
    """

    data: Residual
    plan: Plan
    holds_priors: bool = True
    kept: Mapping[int, Array] = field(default_factory=dict)

    def keeping(self, point: Array, count: int) -> Problem:
        """Returns the problem with the sensitivities of the first `count` coordinates fixed at their values at `point`.

        Sensitivities to nominal parameters take most of the time of a descent, and change little between candidates if
        the values are stated. If the plan has held parameters, sensitivities to parameters that are not stated are not
        fixed, because they may change much.
        """
        few = bool(self.plan.held)
        which = [k for k, one in enumerate(self.plan.free[:count]) if one.known or one.effect or not few]
        return dataclasses.replace(self, kept=dict(zip(which, self.columns(point, which).T, strict=True)))

    def of(self, plan: Plan, threads: int = 1) -> Problem:
        """Returns the problem of a plan with more parameters, on `threads` threads; fixed sensitivities stay fixed."""
        return dataclasses.replace(self, data=self.data.on_threads(threads), plan=plan)

    def residual(self, point: Array) -> Array:
        """Returns (values + parameters,): the robust residual of the data and the residual of the priors."""
        found = self._robust(point)
        return np.concatenate([found.value / self.data.taus() ** 0.5, self.prior(point)])

    def jacobian(self, point: Array) -> Array:
        """Returns (values + parameters, parameters): the Jacobian of `residual`."""
        found = self._robust(point)
        weight = -found.slope * self.data.weight() / self.data.taus() ** 0.5
        return np.vstack([self.sensitivity(point) * weight[:, np.newaxis], self.prior_slopes(point)])

    def _robust(self, point: Array) -> robust.RobustResidual:
        return robust.pseudo_huber((self.data.measured - self.simulated(point)) * self.data.weight())

    def cost(self, point: Array) -> float:
        """Returns half the sum of squares of `residual`; infinite if the plant diverges."""
        return self.costs([point])[0]

    def costs(self, points: Sequence[Array]) -> list[float]:
        """Returns the cost at each point; the points are simulated together."""
        sums, taus = [], self.data.taus()
        for scaled, point in zip(self.data.scaled_by([self.plan.at(one) for one in points]), points, strict=True):
            data, prior = robust.pseudo_huber(scaled).value ** 2 / taus, self.prior(point) ** 2
            sums.append(float(np.sum(data) + np.sum(prior)) / 2)
        return [one if np.isfinite(one) else float("inf") for one in sums]

    def simulated(self, point: Array) -> Array:
        """Returns (values,): the simulated values of the model at `point`."""
        return np.asarray(self.data.predict([self.plan.at(point)])[0])

    def sensitivity(self, point: Array) -> Array:
        """Returns (values, parameters): the derivatives of the simulated values, SI, by the coordinates."""
        fresh = [k for k in range(len(point)) if k not in self.kept]
        slopes = np.empty((len(self.data.measured), len(point)), order="F")
        slopes[:, fresh] = self.columns(point, fresh)
        for k, column in self.kept.items():
            slopes[:, k] = column
        return slopes

    def columns(self, point: Array, which: Sequence[int]) -> Array:
        """Returns (values, which): finite differences of the simulated signals along the coordinates `which`.

        A value of a single run, such as its delay, changes only the samples of this run. So one simulation with all
        delays changed gives the slopes along the delays of all runs.
        """
        moves: dict[str, tuple[Array | None, Array]] = {}
        for index in which:
            free = self.plan.free[index]
            if not free.run:
                moves[free.name] = self._difference_ends(point, index)
            elif _kind(free) not in moves:
                moves[_kind(free)] = (None, self._all_of_kind(point, _kind(free)))
        if not moves:
            return np.empty((len(self.data.measured), 0))
        lows = [low for low, _ in moves.values() if low is not None]
        ends = [point, *(high for _, high in moves.values()), *lows]
        base, *moved = self.data.predict([self.plan.at(end) for end in ends])
        above, below = dict(zip(moves, moved, strict=False)), iter(moved[len(moves) :])
        under = {name: base if low is None else next(below) for name, (low, _) in moves.items()}
        slopes = np.empty((len(self.data.measured), len(which)), order="F")
        for column, index in enumerate(which):
            free = self.plan.free[index]
            name = _kind(free) if free.run else free.name
            low, high = moves[name]
            slope = (above[name] - under[name]) / (high - (point if low is None else low))[index]
            slopes[:, column] = np.where(self.data.rows_of(free.run), slope, 0.0) if free.run else slope
        return np.where(np.isfinite(slopes), slopes, 0.0)

    def _all_of_kind(self, point: Array, kind: str) -> Array:
        """Returns `point` with one kind of value, such as the delay, changed by a step in all runs."""
        moved = np.array(point)
        for index, free in enumerate(self.plan.free):
            if free.run and _kind(free) == kind:
                moved[index] += _EFFECT_STEP if point[index] + _EFFECT_STEP <= free.bounds()[1] else -_EFFECT_STEP
        return moved

    def prior(self, point: Array) -> Array:
        """Returns (parameters + kinds,): the distance of each parameter from its prior's centre, in prior sd.

        Then comes a row for each centred kind of value, such as the delay: its mean over all runs, in sd of a prior
        about 0. This mean belongs in the model, because only the model applies to a held-out run.
        """
        centre = self.plan.start()
        terms = []
        for free, x, x0 in zip(self.plan.free, point, centre, strict=True):
            away = free.away(float(x)) if self.holds_priors else None
            terms.append((float(x) - float(x0)) / _ANCHOR_SD if away is None else away)
        common = [float(np.mean(point[here])) / _COMMON_SD for here in self._centred()]
        return np.array([*terms, *common])

    def prior_slopes(self, point: Array) -> Array:
        """Returns (parameters + kinds, parameters): derivatives of `prior`, stored by columns like sensitivities."""
        count, centred = len(point), self._centred()
        own = np.diag(((self.prior(point + _NOMINAL_STEP) - self.prior(point)) / _NOMINAL_STEP)[:count])
        rows = np.zeros((len(centred), count))
        for row, here in zip(rows, centred, strict=True):
            row[here] = 1 / (len(here) * _COMMON_SD)
        return np.asfortranarray(np.vstack([own, rows]))

    def _centred(self) -> list[list[int]]:
        """Returns the numbers of the coordinates that are `Free.centred`: a list for each kind of value."""
        kinds: dict[str, list[int]] = {}
        for index, free in enumerate(self.plan.free):
            if free.centred:
                kinds.setdefault(_kind(free), []).append(index)
        return list(kinds.values())

    def _difference_ends(self, point: Array, index: int) -> tuple[Array | None, Array]:
        """Returns the two points of a finite difference along one coordinate; None stands for `point` itself.

        The step of an effect's parameter is long, because a simulation resolves the crossing of a backlash only to a
        time step. The difference is central, because a descent with a slightly wrong slope leaves a narrow valley.
        """
        free = self.plan.free[index]
        length = _EFFECT_STEP * free.reach if free.effect is not None else _NOMINAL_STEP
        step = np.zeros(len(point))
        step[index] = length
        low, high = free.bounds()
        if point[index] + length > high:
            return None, point - step
        if free.effect is None or point[index] - length < low:
            return None, point + step
        return point - step, point + step


class Projection:
    """Removes from a scaled residual the part that the problem's parameters can explain.

    The problem, with its priors, is linearised at `point`. Source: score test, Rao 1948.
    """

    def __init__(self, problem: Problem, point: Array) -> None:
        whitened = problem.sensitivity(point) * problem.data.weight()[:, np.newaxis]
        self._prior = -problem.prior(point)
        self._basis, _ = np.linalg.qr(np.vstack([whitened, problem.prior_slopes(point)]))

    def remainder(self, residual: Array) -> Array:
        """Returns (values + parameters,): the remainder of a scaled residual (values,), then the rows of the priors."""
        return self._project(np.concatenate([residual, self._prior]))

    def signatures(self, changes: Sequence[Array] | Array) -> Array:
        """Returns (values + parameters, changes): the remainders of changes of the scaled signals, (values,) each."""
        return np.array([self._project(np.append(one, np.zeros(len(self._prior)))) for one in changes]).T

    def _project(self, rows: Array) -> Array:
        rest: Array = rows - self._basis @ (self._basis.T @ rows)
        return rest
