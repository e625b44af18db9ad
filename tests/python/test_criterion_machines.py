"""On simulated machines the criterion is close to new fits without a stretch, and it changes none of its inputs."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.discover import evidence, numbers
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation, joined, refine
from brickpilot.discover.parts import library_parts
from brickpilot.discover.prepare import calibrate, prepare
from brickpilot.fit.residual import Residual, Scale
from numpy.typing import NDArray
from synthetic import motor, robot, write

Array = NDArray[np.float64]


def lacking(data: Residual, stretch: NDArray[np.int64], one: int) -> Residual:
    """Returns the residual with a negligible weight for one stretch, so that no fit depends on its values."""

    class Without(Residual):
        def weight(self) -> Array:
            return np.where(stretch == one, 1e-9, super().weight())

    return Without(**{field.name: getattr(data, field.name) for field in dataclasses.fields(data)})


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> tuple[Judge, Explanation]:
    """Returns the judge of a motor with dry friction, and its nominal model, whose predictions depend on the log."""
    truth = dataclasses.replace(motor(battery_voltage=9.0), effects={"coulomb_friction": {"torque": 0.004}})
    volts = {"low": (3.0, 0.0), "high": (6.0, 0.0), "back": (-4.0, 0.0), "fast_back": (-7.0, 0.0), "half": (4.5, 0.0)}
    known = {name: value for name, value in truth.parameters.items() if value and name != "drag_area"}
    nominal = "\n".join(f"{name} = {{ value = {1.03 * value}, sd = {0.1 * value} }}" for name, value in known.items())
    folder = write(tmp_path_factory.mktemp("bench") / "set", truth, {"speed": 0.05}, nominal, manoeuvres=volts)
    prepared, found = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    return Judge.of(prepared.coarse, 0), refine(prepared.coarse, [found], 1)[0]


@pytest.mark.parametrize("name", ["coulomb_friction", None])
def test_on_a_motor_it_is_near_that_of_a_fit_without_the_stretch(
    bench: tuple[Judge, Explanation], name: str | None
) -> None:
    """The step that leaves a stretch out changes prediction and density nearly as a new fit without it does."""
    judge, found = bench
    if name is not None:
        part = next(one for one in library_parts(found.model) if one.effect == name)
        (found,) = refine(judge.data, [joined(found, part, {"torque": 0.003})], 1)
    left_out = judge.of_explanation(found).left_out
    inside = judge.data.measured - judge.data.predict([found.model])[0]
    again = np.empty_like(left_out)
    for one in range(judge.count):
        here = judge.stretch == one
        (fit,) = refine(lacking(judge.data, judge.stretch, one), [found], 1)
        again[here] = (judge.data.measured - judge.data.predict([fit.model])[0])[here]
    moved, expected = left_out - inside, again - inside
    assert np.linalg.norm(expected) > 0.04 * np.linalg.norm(inside)  # a fit without the stretch differs
    # If a law is missing, the model is far from the data: one step goes the right way, but less far than a new fit.
    short = 0.15 if name is not None else 0.6
    assert np.linalg.norm(moved - expected) < short * np.linalg.norm(expected)
    assert moved @ expected > (1 - short) * 0.9 * (expected @ expected)
    if name is not None:
        assert judge.density(left_out) == pytest.approx(judge.density(again), abs=1.0)
    assert judge.density(left_out).sum() < judge.density(inside).sum()


def test_a_robot_s_noise_alone_is_the_top(tmp_path: Path) -> None:
    noise = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
    stated = "\n".join(f"{name} = {value}" for name, value in robot().parameters.items() if value and "per" not in name)
    data = reading.read(write(tmp_path / "s", robot(), noise, stated))
    prepared, nominal = calibrate(prepare(data, None, seed=0, jobs=1)[0])
    judge = Judge.of(prepared.coarse, 0)
    left = judge.top - judge.of_explanation(nominal).total
    assert abs(left) / len(judge.data.measured) < 0.5 * numbers.UNEXPLAINED_NATS


def test_weighing_and_judging_twice_gives_the_same_bytes(bench: tuple[Judge, Explanation]) -> None:
    """A repetition after other work gives the same bytes: no stage changes its inputs."""
    judge, found = bench
    measured = judge.data.measured.tobytes()
    scales = dict(judge.data.scales)
    first = judge.of_explanation(found)
    weight = evidence.weigh([first, first], 3.0)
    other = judge.data.weighed_by_size(found.model).with_raised_floors(found.model)
    refined = refine(judge.data, [found], 1)[0]
    Judge.of(other, 1).of_explanation(found)
    again = judge.of_explanation(found)
    assert again.by_stretch.tobytes() == first.by_stretch.tobytes()
    assert again.left_out.tobytes() == first.left_out.tobytes()
    assert evidence.weigh([first, first], 3.0).tobytes() == weight.tobytes()
    assert refine(judge.data, [found], 1)[0].point.tobytes() == refined.point.tobytes()
    assert judge.data.measured.tobytes() == measured
    assert dict(judge.data.scales) == scales


@pytest.mark.parametrize("name", ["scales", "rms"])
def test_the_weights_of_a_residual_cannot_be_changed_in_place(bench: tuple[Judge, Explanation], name: str) -> None:
    with pytest.raises(TypeError):
        getattr(bench[0].data, name)["speed"] = Scale(1.0, 1.0, 1.0, 1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(bench[0].data, name, {})


def test_the_values_of_a_residual_cannot_be_changed_in_place(bench: tuple[Judge, Explanation]) -> None:
    with pytest.raises(ValueError, match="read-only"):
        bench[0].data.measured[0] = 1.0


@pytest.mark.parametrize("name", ["by_stretch", "left_out"])
def test_evidence_cannot_be_changed_in_place(bench: tuple[Judge, Explanation], name: str) -> None:
    found = bench[0].of_explanation(bench[1])
    with pytest.raises(ValueError, match="read-only"):
        getattr(found, name)[0] = 1.0
