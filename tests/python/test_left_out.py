"""The prediction of a left-out stretch and the cost of values far from their priors equal formulas written out here."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from brickpilot.discover import evidence
from brickpilot.discover.evidence import Evidence
from brickpilot.discover.explanation import Explanation
from brickpilot.fit.problem import Problem
from numpy.typing import NDArray
from test_criterion import ODDS
from test_density import Array, given


class Line(Problem):
    """A fit problem whose prediction is linear in the coordinates: `slopes` (values, parameters) times the point."""

    slopes: Array = np.zeros((0, 0))

    def columns(self, point: Array, which: Any) -> Array:
        return self.slopes[:, list(which)]

    def simulated(self, point: Array) -> Array:
        return np.asarray(self.slopes @ point)


class Cliff(Line):
    """A `Line` whose predictions are limited to -1..1, so that a linear extrapolation of a steep slope is far off."""

    def simulated(self, point: Array) -> Array:
        return np.clip(self.slopes @ point, -1.0, 1.0)


def plan_of(count: int) -> Any:
    """Returns a plan of `count` parameters, each with the prior 0 +- 0.7. The plan's model of a point is the point."""
    free = [
        SimpleNamespace(
            centred=False,
            name=f"x{k}",
            run="",
            reach=1e6,
            known=None,
            effect=None,
            bounds=lambda: (-1e6, 1e6),
            away=lambda x: x / 0.7,
        )
        for k in range(count)
    ]
    return SimpleNamespace(free=tuple(free), start=lambda: np.zeros(count), at=lambda point: point)


def test_a_prediction_without_a_stretch_is_that_of_a_fit_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a linear model with a squared loss, one step gives the fit without the stretch exactly."""
    judge, places = given(stretches=10, each=8)
    random, size = np.random.default_rng(3), len(judge.stretch)
    slopes, truth = random.normal(size=(size, 3)), np.array([0.3, -0.2, 0.5])
    measured = slopes @ truth + random.normal(size=size) * 0.3
    data = dataclasses.replace(judge.data, measured=measured, threads=1)
    plan = plan_of(3)
    monkeypatch.setattr(evidence, "Problem", Line)
    monkeypatch.setattr(Line, "slopes", slopes)
    loss = SimpleNamespace(pseudo_huber=lambda x: SimpleNamespace(value=x, slope=np.ones_like(x)))
    monkeypatch.setattr("brickpilot.fit.robust.pseudo_huber", loss.pseudo_huber)

    def fitted(rows: NDArray[np.bool_]) -> Array:
        """Returns (3,): the coordinates of a ridge regression on the values chosen by `rows` (values,)."""
        weight = 1 / np.concatenate([np.full(p.stop - p.start, data.scales[n].size) for n, p in places.items()])
        a = np.vstack([(slopes * weight[:, np.newaxis])[rows], np.eye(3) / 0.7])
        return np.asarray(np.linalg.lstsq(a, np.append((measured * weight)[rows], np.zeros(3)), rcond=None)[0])

    everything = fitted(np.ones(size, dtype=bool))
    found = dataclasses.replace(judge, data=data).of_explanation(Explanation((), plan, everything, 0.0))
    for stretch in range(judge.count):
        here = judge.stretch == stretch
        assert found.left_out[here] == pytest.approx(measured[here] - slopes[here] @ fitted(~here), abs=1e-5)
    assert found.by_stretch == pytest.approx(judge.density(found.left_out))
    assert found.away == pytest.approx(everything / 0.7, rel=1e-6)
    assert found.away_slopes == pytest.approx(np.eye(3) / 0.7, rel=1e-6)
    away = np.abs(everything / 0.7)
    expected = -sum(min(x**2 / 2, -math.log(ODDS["common"])) for x in away)
    assert found.log_prior(1.0) == pytest.approx(expected, rel=1e-6)


def test_a_stretch_whose_slopes_promise_more_than_it_holds_is_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fit is at 0 because of one steep stretch, and at 0.2 without this stretch. There, 0.2 predicts the limit 1,
    found by a simulation; the slopes predict 200."""
    judge, _ = given(stretches=10, each=8)
    here, data = judge.stretch == 4, dataclasses.replace(judge.data, threads=1)
    strength = data.weight() ** 2 / data.taus()
    slopes = np.where(here, 1000.0, 1.0)[:, np.newaxis]
    measured = np.where(here, -0.2 * strength[~here].sum() / (1000 * strength[here].sum()), 0.2)
    data = dataclasses.replace(data, measured=measured)
    monkeypatch.setattr(evidence, "Problem", Cliff)
    monkeypatch.setattr(Cliff, "slopes", slopes)
    monkeypatch.setattr(
        type(data), "predict", lambda self, points: np.array([slopes @ one for one in points]).clip(-1, 1)
    )
    found = dataclasses.replace(judge, data=data).of_explanation(Explanation((), plan_of(1), np.zeros(1), 0.0))
    assert found.left_out[here] == pytest.approx(measured[here] - 1.0)


def of_one_value(away: float, information: float, cost: float) -> Evidence:
    """Returns the evidence of an explanation with one parameter, fitted to 20 values; its prior has the sd 1.

    Args:
        away: distance of the fitted value from its prior, sd.
        information: second derivative of the data's cost.
        cost: cost of the fit.
    """
    unknown: Any = None
    found = Explanation((), unknown, np.zeros(0), cost)
    return Evidence(found, np.zeros(15), np.zeros(20), np.array([away]), np.eye(1), np.array([[information]]))


def test_a_value_that_the_error_of_a_law_moved_surprises_less() -> None:
    """A prior costs the smallest sum of the prior's cost and the rise of the data's cost divided by the temperature.

    So a value that the data determine poorly costs less at a high temperature.
    """
    known, poor = of_one_value(2.0, 1e4, 10.0), of_one_value(2.0, 5.0, 10.0)
    for found, information in ((known, 1e4), (poor, 5.0)):
        assert found.log_prior(1.0) == pytest.approx(-2.0)
        for temperature in (4.0, 40.0):
            # cost of the data: information / 2 (x - data)^2; cost of the prior: x^2 / 2; their sum is smallest at x = 2
            data = 2.0 + 2.0 / information
            x = np.linspace(0.0, 2.0, 200_001)
            losses = (information / 2 * (x - data) ** 2 - information / 2 * (2.0 - data) ** 2) / temperature + x**2 / 2
            assert -found.log_prior(temperature) == pytest.approx(losses.min(), abs=1e-4)
    assert -known.log_prior(40.0) > 1.95
    assert -poor.log_prior(40.0) < 0.4
    assert of_one_value(2.0, 5.0, 100.0).log_prior(4.0) == pytest.approx(poor.log_prior(40.0))


@pytest.mark.parametrize(
    ("away", "nats"), [([0.0, 0.0], 0.0), ([1.0, -2.0], 2.5), ([-24.477], 5.298), ([24.477, 4.895], 8.987)]
)
def test_a_wrong_statement_costs_a_common_effect_and_less_likely_the_further(away: list[float], nats: float) -> None:
    """The cost of a value is a parabola of its distance up to 2.4477 sd, 3.0 nats. Farther away it is a logarithm: ten
    times the distance costs ln 10 nats more."""
    assert evidence.surprise(np.array(away)) == pytest.approx(nats, abs=0.01)


def test_a_step_without_a_stretch_is_damped_to_where_the_model_holds() -> None:
    matrix, reach = np.diag([1e-6, 4.0]), np.ones(2)
    free = np.array([[-9.0, -9.0], [9.0, 9.0]])
    step, is_long = evidence._step(matrix, np.array([1e-3, 2.0]), reach, free)
    assert is_long
    assert 0 < step[0] < 1
    assert step[1] == pytest.approx(0.5, abs=0.2)
    assert evidence._step(matrix, np.array([1e-7, 2.0]), reach, free) == (pytest.approx([0.1, 0.5]), False)


def test_a_step_that_stops_at_a_bound_is_made_up_for_by_the_others() -> None:
    """The data determine only the sum of two parameters. One stops at its bound, so the other moves by the rest."""
    matrix = np.array([[1.0, 1.0], [1.0, 1.0]]) + 1e-9 * np.eye(2)
    room = np.array([[-9.0, -9.0], [0.05, 9.0]])
    step, _ = evidence._step(matrix, np.array([0.6, 0.6]), np.ones(2), room)
    assert step == pytest.approx([0.05, 0.55], abs=1e-6)


class Valley:
    """A prediction proportional to the product of two coordinates, so that the cost has a curved valley."""

    slopes: Array = np.zeros(0)

    def predict(self, points: list[Array]) -> Array:
        return np.array([self.slopes * point[0] * point[1] for point in points])


@pytest.mark.parametrize(
    ("step", "halvings"),
    [((0.008, 0.0), 0), ((1.0, -0.9), 4), ((0.0, -0.9), None)],  # a step along the valley's tangent lowers the product
)
def test_a_long_step_is_halved_until_it_fits_the_other_stretches_no_worse(
    step: tuple[float, float], halvings: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge, _ = given(stretches=10, each=8)
    here = np.flatnonzero(judge.stretch == 4)
    slopes = np.random.default_rng(3).normal(size=len(judge.stretch))
    monkeypatch.setattr(Valley, "slopes", slopes)
    monkeypatch.setattr(type(judge.data), "predict", lambda self, points: Valley().predict(points))
    judge = dataclasses.replace(judge, data=dataclasses.replace(judge.data, measured=1.005 * slopes))
    problem: Any = SimpleNamespace(
        plan=SimpleNamespace(at=lambda end: end), prior=lambda end: np.zeros(2), simulated=lambda end: slopes
    )
    found = list(judge._beyond(problem, np.ones(2), [(here, np.array(step))]))
    if halvings is None:
        assert found == []
        return
    ((stretch, left),) = found
    end = np.ones(2) + 0.5**halvings * np.array(step)
    assert np.array_equal(stretch, here)
    assert left == pytest.approx((1.005 - end[0] * end[1]) * slopes[here])
    assert abs(1.005 - end[0] * end[1]) <= 0.005
