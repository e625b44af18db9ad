"""Evidence: how well an explanation predicts stretches of time that it was not fitted to. It ranks explanations.

1. Each stretch is predicted by a fit to the other stretches: one Gauss-Newton step from the fit to all runs, with the
   stretch's rows deleted (the infinitesimal jackknife; Giordano and others 2019, AISTATS). A step is too long if it
   leaves the linear range or changes the predicted stretch by more than the stretch's residual. Such a step is halved
   until the other stretches fit no worse than before the step.
2. The residual has a hyperbolic density. The scale of a signal in a stretch comes from its residual in the other
   stretches, and is at least the floor of noise and simulator error. A signal that no model explains has a large scale.
3. Values of a residual are not independent, and no law is exact. So `temperature` nats count as one nat.
4. The weights of explanations come from a Bayesian bootstrap over the stretches and from prior odds (BB-pseudo-BMA of
   Yao, Vehtari, Simpson & Gelman 2018, Bayesian Analysis 13). A difference in one stretch alone is not sure.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import k1e, logsumexp

from brickpilot.discover import numbers
from brickpilot.discover.explanation import Explanation
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual
from brickpilot.fit.robust import correlation_time, pseudo_huber_loss

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_Moved = tuple[Indices, Array]  # indices of a stretch's values; a step (parameters,), or the stretch's residual

_LOG_NORM = float(np.log(2 * numbers.KNEE * k1e(numbers.KNEE**2)))
_DRAWS = 1000  # number of draws of the bootstrap
_ROUNDS, _SETTLED = 20, 1e-3  # the search for the likeliest scale ends after these rounds, or at this relative change
_LEAST_STRETCHES = 10
_LEAST_RUNS = 4  # least number of runs that are left out in turn for a predictor; fewer runs are cut into pieces
_DAMPED = 4.0  # factor by which the damping grows until a step is short enough
_HALVINGS = 5  # number of lengths at which a long step is tried, each half of the previous length
_FAR = 3.0  # multiple of the scale to which a residual is clipped before its correlation time is computed


@dataclass(frozen=True, eq=False)
class Evidence:
    """How well one explanation predicts the fit runs, and how far its values are from their priors.

    Attributes:
        by_stretch: (stretches,) log density of each stretch, predicted by a fit without this stretch.
        left_out: (values,) the residual of these predictions, SI.
        away: (priors,) distance of the fitted values from their priors, in sd.
        away_slopes: (priors, parameters) the derivative of `away`.
        information: (parameters, parameters) second derivative of the cost of the data.
    """

    explanation: Explanation
    by_stretch: Array
    left_out: Array
    away: Array
    away_slopes: Array
    information: Array

    def __post_init__(self) -> None:
        for values in (self.by_stretch, self.left_out, self.away, self.away_slopes, self.information):
            values.flags.writeable = False

    def __reduce__(self) -> tuple[type[Evidence], tuple[Any, ...]]:
        """Makes unpickling call the constructor, so that the arrays are read-only again."""
        return Evidence, tuple(getattr(self, one.name) for one in dataclasses.fields(self))

    @property
    def total(self) -> float:
        return float(self.by_stretch.sum())

    def log_weight(self, temperature: float) -> float:
        """Returns the log of the weight up to a constant: evidence, prior odds, and the cost of values far from priors.

        A wrong law weakens no prior, so the cost of a prior is not divided by the temperature. But a wrong law moves
        the fitted values. So the prior is evaluated at a fit in which the data's cost is divided by the temperature.
        """
        return self.total / temperature + self.log_prior(temperature)

    def nat(self, temperature: float) -> float:
        """Returns the amount of `Explanation.cost` that counts as one nat.

        The cost uses the scales of the fit, but evidence uses the scales of the explanation's own residual.
        """
        return temperature * max(2 * self.explanation.cost / max(len(self.left_out), 1), 1.0)

    def log_prior(self, temperature: float) -> float:
        """Returns `log_weight` without the evidence: the prior odds and the cost of values far from priors."""
        nat = self.nat(temperature)
        pulled = self.away_slopes.T @ self.away  # gradient of the priors; at the fit, the data's gradient balances it
        step = _solved(self.information / nat + self.away_slopes.T @ self.away_slopes, -pulled * (1 - 1 / nat))
        lost = float(step @ (self.information @ step / 2 - pulled)) / nat
        moved = surprise(self.away + self.away_slopes @ step) + max(lost, 0.0)
        return self.explanation.log_odds - min(moved, surprise(self.away))


@dataclass(frozen=True, eq=False)
class Judge:
    """Computes the evidence of explanations from their residuals on the same compared values.

    Attributes:
        stretch: (values,) the number of the stretch in which each compared value lies.
        top: the evidence of a residual that is noise alone.
        shape: `numbers.LAW_SHAPE`, or 0 if the floors already include the error that wrong shapes of laws may leave.
    """

    data: Residual
    stretch: Indices
    count: int
    top: float
    shape: float = numbers.LAW_SHAPE

    @classmethod
    def of(cls, data: Residual, seed: int, shape: float = numbers.LAW_SHAPE) -> Judge:
        """Returns the judge of a residual. `seed`: for the random noise whose evidence is `top`."""
        stretch, count = data.stretches(numbers.STRETCH_S, _LEAST_STRETCHES)
        noise = data.by_signal({signal: one.noise for signal, one in data.scales.items()})
        drawn = np.random.default_rng(seed).normal(size=len(data.measured)) * noise
        top = float(cls(data, stretch, count, 0.0).density(drawn).sum())
        return cls(data, stretch, count, top, shape)

    def leaving_out_runs(self) -> Judge:
        """Returns a judge whose stretches are whole runs, or quarters of the data if there are fewer than four runs."""
        stretch, count = self.data.stretches(np.inf, _LEAST_RUNS)
        return dataclasses.replace(self, stretch=stretch, count=count)

    def changes(self, before: Array, after: Array) -> Array:
        """Returns (1 + draws,): log(rms of `after` / rms of `before`). Both are residuals, (values,).

        The result is the mean over the signals. Entry 0 gives equal weight to all stretches; each other entry uses one
        draw of weights of a Bayesian bootstrap. An rms below a signal's floor counts as the floor.
        """
        weights = np.vstack([np.ones(self.count), bootstrap(self.count)])
        total = np.zeros(len(weights))
        for signal in self.data.signals:
            rows = self._rows(signal)
            least = weights @ np.bincount(self.stretch[rows], minlength=self.count) * self.data.floor(signal) ** 2
            squares = (np.bincount(self.stretch[rows], residual[rows] ** 2, self.count) for residual in (before, after))
            first, then = (np.maximum(weights @ of_stretch, least) for of_stretch in squares)
            total += np.log(then / first) / 2
        return np.asarray(total / len(self.data.signals))

    def density(self, residual: Array) -> Array:
        """Returns (stretches,): the log density of a residual (values,), SI."""
        total = np.zeros(self.count)
        for signal in self.data.signals:
            rows = self._rows(signal)
            total += _density(residual[rows], self.stretch[rows], self.count, self.data.floor(signal))
        return total

    def _rows(self, signal: str) -> Indices:
        """Returns the indices of a signal's values among the compared values."""
        return np.concatenate([np.arange(b.place.start, b.place.stop) for b in self.data.blocks if b.signal == signal])

    def rises(self, before: Array, after: Array) -> Array:
        """Returns (stretches,): the rise of the log density from residual `before` to `after`, (values,) each.

        Both densities use the scale of `before`. The scale of `after` is smaller if a model predicts most stretches
        better; with this smaller scale, an unchanged error in the other stretches would look worse.
        """
        total = np.zeros(self.count)
        for signal in self.data.signals:
            size = scale_of_rest(np.concatenate(self.data.parts(before, signal)), self.data.floor(signal))
            for block in self.data.blocks:
                if block.signal == signal:
                    scaled = [(residual[block.place] / (numbers.KNEE * size)) ** 2 for residual in (before, after)]
                    rise = numbers.KNEE**2 * (np.sqrt(1 + scaled[0]) - np.sqrt(1 + scaled[1]))
                    total += np.bincount(self.stretch[block.place], rise, self.count)
        return total

    def of_explanation(self, found: Explanation) -> Evidence:
        """Returns the evidence of a fitted explanation."""
        problem = Problem(self.data, found.plan)
        rows, slopes = problem.residual(found.point), problem.jacobian(found.point)
        count, moved = len(self.data.measured), problem.sensitivity(found.point)
        left_out = self.data.measured - problem.simulated(found.point)
        reach = np.array([one.reach for one in found.plan.free])
        normal = slopes.T @ slopes + np.diag(1 / np.maximum(reach, 1e-12) ** 2)  # holds parameters that move no signal
        bounds = np.array([one.bounds() for one in found.plan.free]).reshape(-1, 2)
        of_run = np.array([bool(one.run) for one in found.plan.free], dtype=bool)
        ends = np.cumsum(np.bincount(self.stretch, minlength=self.count))
        far: list[_Moved] = []
        for here in np.split(np.argsort(self.stretch, kind="stable"), ends[:-1]):
            own = slopes[:count][here]
            matrix, pull = normal - own.T @ own, own.T @ rows[:count][here]
            # A value of one run stays fixed if most of its information is in this stretch: the rest tells little of it.
            alone = of_run & (np.square(own).sum(axis=0) > normal.diagonal() / 2)
            matrix[alone], matrix[:, alone], pull[alone] = 0.0, 0.0, 0.0
            step, is_long = _step(matrix, pull, reach, bounds.T - found.point)
            change = moved[here] @ step
            outweighs = change @ change > left_out[here] @ left_out[here]  # the leverage of the stretch is above 1/2
            if is_long or outweighs:
                far.append((here, step))
            if not outweighs:
                left_out[here] -= change
        for here, values in self._beyond(problem, found.point, far):
            left_out[here] = values
        away, away_slopes = problem.prior(found.point), np.array(problem.prior_slopes(found.point))
        information = slopes[:count].T @ slopes[:count]
        return Evidence(found, self.density(left_out), left_out, away, away_slopes, information)

    def _beyond(self, problem: Problem, point: Array, far: Sequence[_Moved]) -> Iterator[_Moved]:
        """Yields each stretch of `far` with its residual, simulated at the end of its step.

        A step is halved while the other stretches fit worse at its end than at its start: such a step leaves a curved
        valley of the cost, which a fit without this stretch would follow. If even the shortest step fits worse, the
        stretch is not yielded: it keeps its linear prediction or, if the change is larger, its residual at `point`.

        Args:
            far: stretches, each with the step (parameters,) from `point` to the fit without this stretch.
        """
        weight, taus = self.data.weight(), self.data.taus()

        def losses(values: Array) -> Array:
            return pseudo_huber_loss((self.data.measured - values) * weight) / taus

        at_fit = losses(problem.simulated(point)) if far else np.empty(0)
        for halvings in range(_HALVINGS):
            ends = [point + 0.5**halvings * step for _, step in far]
            simulated, worse = self.data.predict([problem.plan.at(end) for end in ends]), []
            for (stretch, step), end, values in zip(far, ends, simulated, strict=True):
                rises = losses(values) - at_fit
                priors = float(np.sum(problem.prior(end) ** 2) - np.sum(problem.prior(point) ** 2)) / 2
                if rises.sum() - rises[stretch].sum() + priors <= 0:
                    yield stretch, (self.data.measured - values)[stretch]
                else:
                    worse.append((stretch, step))
            far = worse
            if not far:
                break

    def correlation(self, evidence: Evidence) -> float:
        """Returns the residual's correlation time, as a number of values: a mean over signals, weighted by `counts`."""
        total = 0.0
        for signal in self.data.signals:
            parts = self.data.parts(evidence.left_out, signal)
            size = scale_of_rest(np.concatenate(parts), self.data.floor(signal))
            limited = [np.clip(part / size, -_FAR, _FAR) for part in parts]
            total += sum(map(len, parts)) * correlation_time(limited, about_mean=False)
        return total / len(self.data.measured)

    def temperature(self, best: Evidence, nothing: Evidence) -> float:
        """Returns how many nats count as one nat: the larger of the residual's correlation time and `law_error`."""
        return max(self.correlation(best), self.law_error(best, nothing))

    def law_error(self, best: Evidence, nothing: Evidence) -> float:
        """Returns the number of nats that count as one nat because no law is exact; at least 1.

        A difference in evidence decides nothing if it is below one of two limits. One is a share of the best
        explanation's gain over `nothing`. The other is the gain of a law that removes a share of the error above noise.
        """
        own_error, shared = numbers.LAW_ERROR * (best.total - nothing.total), 0.0
        for signal in self.data.signals:
            above_noise = 1 - self.data.floor(signal) ** 2 / self.squares(best, signal)
            shared -= self.counts[signal] * float(np.log(1 - numbers.SHARED_REST * above_noise)) / 2
        return max(1.0, own_error / numbers.CHANCE_NATS, shared / numbers.CHANCE_NATS)

    def excess(self, evidence: Evidence, least: float = 1.0) -> Array:
        """Returns (signals,): each signal's remaining squared error above noise, in squares of the signal's floor.

        `least`: the least scale, as a share of the floor. Below 1, the result of a signal below its floor is < 0.
        """
        squares = {one: self.squares(evidence, one, least) / self.data.floor(one) ** 2 for one in self.data.signals}
        return np.array([self.counts[signal] * (square - 1) for signal, square in squares.items()])

    def squares(self, evidence: Evidence, signal: str, least: float = 1.0) -> float:
        """Returns the squared scale of a signal's residual; the scale is at least `least` times the floor."""
        left = np.concatenate(self.data.parts(evidence.left_out, signal))
        return scale_of_rest(left, least * self.data.floor(signal)) ** 2

    @property
    def counts(self) -> dict[str, int]:
        """Signal -> number of its compared values."""
        return {signal: sum(map(len, self.data.parts(self.data.measured, signal))) for signal in self.data.signals}


def _step(matrix: Array, pull: Array, reach: Array, room: Array) -> tuple[Array, bool]:
    """Returns the Gauss-Newton step (parameters,) to the fit without a stretch, and whether it had to be shortened.

    Args:
        matrix: (parameters, parameters) the normal matrix without the stretch.
        pull: (parameters,) the gradient of the stretch; at the fit it balances the gradient of the other stretches.
        reach: (parameters,) how far the linear model holds: a longer step is damped to this length (Levenberg 1944).
        room: (2, parameters) the distance to the ends of each parameter's range, down and up.
    """
    damping, is_long = 0.0, False
    while np.any(np.abs(step := _solved(matrix + damping * np.diag(reach**-2.0), pull)) > reach):
        damping, is_long = max(_DAMPED * damping, 1.0), True
    stopped = (step < room[0]) | (step > room[1])
    if stopped.any():  # solve again for the others: the range of a stopped parameter makes its step shorter
        step = np.where(stopped, np.clip(step, *room), 0.0)
        others = ~stopped
        rest = pull[others] - matrix[others][:, stopped] @ step[stopped]
        step[others] = _solved(matrix[others][:, others], rest)
        step = np.clip(step, np.maximum(room[0], -reach), np.minimum(room[1], reach))
    return step, is_long


def _solved(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-12)[0])


def surprise(away: Array) -> float:
    """Returns the cost, in nats, of values that are `away` (parameters,) sd from their priors.

    A stated value may simply be wrong, with the prior odds of a common effect. The log of its distance then has a flat
    prior: a value n times further away is n times less likely (Jeffreys 1961, sec. 3.1).
    """
    wrong = -np.log(numbers.COMMON)
    further = np.log(np.maximum(np.abs(away) / np.sqrt(2 * wrong), 1.0))
    return float(np.sum(np.minimum(away**2 / 2, wrong + further)))


def weigh(table: Sequence[Evidence], temperature: float) -> Array:
    """Returns (explanations,): the weight of each explanation. The weights sum to 1."""
    rows = np.array([evidence.by_stretch for evidence in table])
    odds = np.array([evidence.log_prior(temperature) for evidence in table])
    total = bootstrap(rows.shape[1]) @ rows.T / temperature + odds
    return np.asarray(np.exp(total - logsumexp(total, axis=1, keepdims=True)).mean(axis=0))


def bootstrap(count: int) -> Array:
    """Returns (draws, stretches): random weights with mean 1 in each draw (Rubin 1981, Annals of Statistics 9)."""
    return np.asarray(np.random.default_rng(0).dirichlet(np.ones(count), _DRAWS) * count)


def held_by(table: Sequence[Evidence], weights: Array) -> dict[str, float]:
    """Returns a part's name -> the summed weight of the explanations with this part: see `Explanation.says`."""
    parts = {part.name: part for one in table for part in one.explanation.parts}
    weighed = list(zip(table, weights.tolist(), strict=True))
    return {name: sum(weight for one, weight in weighed if one.explanation.says(part)) for name, part in parts.items()}


def _weighted(residual: Array, size: float | Array) -> Array:
    """Returns the squares of a residual, each times its weight under the hyperbolic density (< 1 for large values)."""
    return np.asarray(residual**2 / np.sqrt(1 + (residual / (numbers.KNEE * size)) ** 2))


def scale_of_rest(residual: Array, floor: float) -> float:
    """Returns the most likely scale of the hyperbolic density of a residual (values,), never below the floor, SI."""
    size = max(1.4826 * float(np.median(np.abs(residual))), floor)
    for _ in range(_ROUNDS):
        size, before = max(float(np.sqrt(_weighted(residual, size).mean())), floor), size
        if abs(size / before - 1) < _SETTLED:
            break
    return size


def _density(residual: Array, stretch: Indices, count: int, floor: float) -> Array:
    """Returns (stretches,): the log density of one signal, with the scale of each stretch from the other stretches."""
    weighted = _weighted(residual, scale_of_rest(residual, floor))
    sums, sizes = np.bincount(stretch, weighted, count), np.bincount(stretch, minlength=count)
    others = (sums.sum() - sums) / np.maximum(sizes.sum() - sizes, 1)
    own = np.sqrt(np.maximum(others, floor**2))[stretch]
    knee = numbers.KNEE
    density = -np.log(own) - _LOG_NORM - knee**2 * (np.sqrt(1 + (residual / (knee * own)) ** 2) - 1)
    return np.asarray(np.bincount(stretch, density, count), dtype=np.float64)
