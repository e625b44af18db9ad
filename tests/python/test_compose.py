"""Composed terms are found in data of other equations, and are written as equations and in model files."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import reference_ode
from brickpilot.data.axes import Segment
from brickpilot.data.dataset import Dataset, Nominal, Run
from brickpilot.data.description import Signal
from brickpilot.data.signals import SIGNALS as MEASURABLE
from brickpilot.discover.compose import Atom, Composed, TermSource, atom, compose, find_atoms, with_terms
from brickpilot.discover.deadline import NO_LIMIT
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation, refine, without
from brickpilot.discover.prepare import Prepared, calibrate, prepare
from brickpilot.discover.search import Found, Search
from brickpilot.discover.verdict import Verdict, weigh
from brickpilot.fit.parameters import Plan
from brickpilot.report.composed_law import mathml
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle import plant
from brickpilot.vehicle.composed_terms import EFFECT, Term, basis, equation, legend, parameters, settings_of, terms_of
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from synthetic import motor, robot

BASIS = {one.name: one for one in basis()}

SIGNALS = {"accel_surge": 0.025, "yaw_rate": 0.014, "wheel_speed_left": 0.15, "wheel_speed_right": 0.15}
MOTOR_SIGNALS = {"velocity": 0.01}
RUNS = {
    "straight": [(0.2, 5.0, 5.0), (1.4, 8.0, 8.0), (2.6, 0.0, 0.0)],
    "back": [(0.2, -4.0, -4.0), (1.4, -8.0, -8.0)],
    "spin": [(0.2, 4.0, -4.0), (1.4, -7.0, 7.0), (2.8, 3.0, -5.0)],
    "curve": [(0.2, 7.0, 4.0), (1.4, 3.0, 8.0), (2.8, -6.0, -3.0)],
}
FREE = ("mass", "yaw_inertia", "resistance", "viscous_friction")
MOTOR_FREE = ("mass", "viscous_friction")


def drive(stages: Sequence[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(0.0, 4.0, 0.01)
    volts = np.zeros((len(time), 2))
    for start, left, right in stages:
        volts[time >= start] = (left, right)
    return time, volts


@dataclass(frozen=True)
class Data:
    """A data set ready for fits, with the nominal model that was calibrated on it."""

    prepared: Prepared
    base: Explanation

    def composed(self) -> Composed | None:
        """Returns the law that is composed if the search finds no effect of the library."""
        judge = Judge.of(self.prepared.coarse, 0)
        nothing = judge.of_explanation(self.base)
        found = Found(judge, nothing, {self.base.key: nothing})
        return compose(self.prepared, judge, weigh(found), str)

    def weighed(self) -> Verdict:
        """Returns the verdict of a search that tries atoms alone."""
        coarse, source = self.prepared.coarse, TermSource(self.prepared.coarse, self.base)
        search = Search(coarse, self.base, source, self.prepared.excitation, 2, NO_LIMIT, str)
        return weigh(search.run(Judge.of(coarse, 0)))


def data_of(measured: Callable[[np.ndarray, np.ndarray], Mapping[str, np.ndarray]], nominal: Model) -> Data:
    """Returns data of noisy runs. Some nominal values have an sd of 5 %; the others are known exactly."""
    noise = np.random.default_rng(5)
    is_motor = nominal.vehicle == "motor"
    sds = MOTOR_SIGNALS if is_motor else SIGNALS
    inputs = ["voltage"] if is_motor else ["voltage_left", "voltage_right"]
    runs = []
    for name, stages in RUNS.items():
        time, volts = drive(stages)
        columns = dict(zip(inputs, volts.T, strict=False))
        outputs = measured(time, volts[:, : len(inputs)])
        noisy = {signal: outputs[signal] + noise.normal(0.0, sd, len(time)) for signal, sd in sds.items()}
        runs.append(Run(name, Path(name), "fit", time, columns, noisy, noisy, 0.01, None, {}))
    signals = {name: Signal(name, name, MEASURABLE[name].unit, 1.0, 0.0, sd, None, None) for name, sd in sds.items()}
    free = MOTOR_FREE if is_motor else FREE
    known = {n: Nominal(v, 0.05 * v if n in free else 0.0) for n, v in nominal.parameters.items()}
    dataset = Dataset("made", Path("made"), nominal.vehicle, "FRD", signals, known, {}, tuple(runs), 0.01, (), ())
    return Data(*calibrate(prepare(dataset, None, seed=0, jobs=2)[0]))


def by_plant(truth: Model | None = None, nominal: Model | None = None, **effects: Mapping[str, float]) -> Data:
    """Returns data of the plant with effects, at its finest steps. The nominal mass and resistance are wrong."""
    truth = dataclasses.replace(truth or robot(mass=0.92, resistance=22.5), effects=effects)

    def measured(time: np.ndarray, volts: np.ndarray) -> Mapping[str, np.ndarray]:
        return plant.simulate([(truth, OpenLoopRun(time, volts))])[0].outputs

    return data_of(measured, nominal or robot())


def by_reference(mass: float = 0.92) -> Data:
    """Returns data of the textbook equations of `reference_ode`, whose air drag a test replaces."""
    values = {**robot(mass=mass, inductance=1e-3).parameters, "drag_area": 0.0}

    def measured(time: np.ndarray, volts: np.ndarray) -> Mapping[str, np.ndarray]:
        solved = reference_ode.solve(reference_ode.coupled(values), time, volts)
        change = np.diff(solved["surge"], prepend=0.0) / 0.01
        return {**solved, "accel_surge": change}

    return data_of(measured, robot(inductance=1e-3))


def text_of(found: Composed) -> str:
    return equation(found.terms, found.settings)


def coefficient(found: Composed | None, name: str) -> float:
    assert found is not None
    assert [term.basis.name for term in found.terms] == [name], text_of(found)
    return found.terms[0].coefficient


def test_a_cubic_drag_of_other_equations_is_found_and_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference_ode, "_air", lambda _, speed: 1.2 * speed**3)
    data = by_reference()
    found = data.composed()
    assert coefficient(found, "surge_loss_u2") == pytest.approx(1.2, rel=0.05)
    assert found is not None
    assert "u³" in text_of(found)
    before, after = (data.prepared.fine.scaled(one.model).std() for one in (data.base, found.explanation))
    assert before > 3
    assert after < 1.1


def test_a_square_drag_is_not_taken_for_a_cubic_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference_ode, "_air", lambda _, speed: 0.9 * speed * abs(speed))
    assert coefficient(by_reference().composed(), "surge_loss_abs_u") == pytest.approx(0.9, rel=0.05)


def test_a_harmonic_of_the_wheel_is_found_with_its_order() -> None:
    found = by_plant(cogging={"torque": 0.004, "order": 2.5, "phase": 0.6}).composed()
    assert found is not None
    assert {term.basis.name for term in found.terms} == {"wheel_push_sin_angle", "wheel_push_cos_angle"}
    amplitude = np.hypot(*(term.coefficient for term in found.terms))
    assert amplitude == pytest.approx(0.004, rel=0.05)
    assert found.settings["order"] == pytest.approx(2.5, rel=1e-3)
    assert "θ" in text_of(found)


def test_a_term_is_found_for_a_linear_axis_too() -> None:
    axis = {"force_per_volt": 35.0, "wheel_inertia": 0.0, "viscous_friction": 150.0}
    data = by_plant(motor(**axis, mass=96.0), motor(**axis, mass=94.0), quadratic_drag={"drag": 90.0})
    assert coefficient(data.composed(), "surge_loss_abs_u") == pytest.approx(90.0, rel=0.05)


def test_wrong_nominal_values_alone_are_no_term() -> None:
    assert by_plant().composed() is None


def test_equivalent_terms_are_named_as_rivals() -> None:
    found = by_plant(composed_term={"drive_add_sin_time": 0.15, "frequency": 1.3}).weighed()
    assert found.kind == "ambiguous"
    names = [one.key for one in (found.best, *found.rivals)]
    assert {"drive_add_sin_time and drive_add_cos_time"} in names
    assert {"surge_push_sin_time and surge_push_cos_time"} in names


def fitted_from(data: Data, one: Atom, **values: float) -> Explanation:
    plan = one.starting(data.base.plan, values)
    start = np.concatenate([data.base.point, plan.start()[len(data.base.point) :]])
    return refine(data.prepared.fine, [Explanation((one,), plan, start)], 1)[0]


def test_a_fit_ends_at_the_truth() -> None:
    data = by_plant(composed_term={"surge_push_sprung": 0.08, "frequency": 2.0, "damping": 0.1})
    sprung = atom((BASIS["surge_push_sprung"],), (("frequency", 2.15), ("damping", 0.15)))
    found = fitted_from(data, sprung, surge_push_sprung=0.05)
    table = found.model.effects[EFFECT]
    assert table["surge_push_sprung"] == pytest.approx(0.08, rel=0.05)
    assert table["frequency"] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("size", [0.4, -0.4])
def test_a_coefficient_keeps_its_sign_and_moves_in_its_logarithm(size: float) -> None:
    plan = atom((BASIS["surge_loss_linear"],)).starting(Plan(robot(), (), ()), {"surge_loss_linear": size})
    assert plan.start() == pytest.approx([0.0])
    assert plan.at(np.log([2.0])).effects[EFFECT]["surge_loss_linear"] == pytest.approx(2 * size)
    low, high = plan.free[0].bounds()
    assert low < 0 < high
    assert abs(plan.free[0].to_value(low)) < 1e-6
    assert plan.free[0].to_value(high) * size > 1


def test_no_term_repeats_less_than_once_in_the_longest_run_and_no_load_swings_slowly() -> None:
    time = np.arange(0.0, 4.0, 0.03)
    segments = [Segment("run", "yaw_rate", slice(0, len(time)), time, 0.0, {})]
    swings = [one for one in find_atoms("diff_drive", segments, np.sin(9 * time)) if "frequency" in one.free]
    assert len(swings) > 5
    for one in swings:
        plan = one.starting(Plan(robot(), (), ()), dict.fromkeys(one.names, 0.1))
        frequency = next(free for free in plan.free if free.name == f"{EFFECT}.frequency")
        least = 0.5 if "damping" in one.free else 1 / time[-1]
        assert frequency.to_value(frequency.bounds()[0]) == pytest.approx(least)
    assert {"damping" in one.free for one in swings} == {True, False}


def test_each_term_has_the_odds_of_a_rare_effect() -> None:
    plain, wave = atom((BASIS["surge_loss_linear"],)), ("surge_push_sin_time", "surge_push_cos_time")
    both = atom(tuple(BASIS[name] for name in wave), (("frequency", 1.3), ("clock", 1.0)))
    assert plain.log_odds == pytest.approx(np.log(0.01))
    assert both.log_odds == pytest.approx(3 * plain.log_odds)  # two terms, and a frequency picked from many


def test_an_atom_that_is_removed_leaves_the_settings_that_another_needs() -> None:
    shared = (("frequency", 1.3), ("clock", 1.0))
    first = atom((BASIS["surge_push_sin_time"], BASIS["surge_push_cos_time"]), shared)
    second = atom((BASIS["drive_add_sin_time"], BASIS["drive_add_cos_time"]), shared)
    data = by_plant()
    begun = first.starting(data.base.plan, {"surge_push_sin_time": 0.3, "surge_push_cos_time": 0.1})
    both = second.starting(begun, {"drive_add_sin_time": 0.2, "drive_add_cos_time": 0.0})
    assert second.joins(begun.model.effects[EFFECT])
    assert not first.joins(begun.model.effects[EFFECT])
    found = Explanation((first, second), both, both.start())
    assert found.parameter_count == len(both.free) - len(data.base.plan.free) == 5
    left = without(found, first)
    table = {"drive_add_sin_time": 0.2, "drive_add_cos_time": 0.0, "frequency": 1.3, "clock": 1.0}
    assert left.model.effects[EFFECT] == pytest.approx(table)
    assert left.parameter_count == 3
    assert EFFECT not in without(left, second).model.effects


@pytest.mark.parametrize("name", ["yaw_loss_linear", "wheel_loss_diff_linear"])
def test_plain_linear_losses_are_terms(name: str) -> None:
    size = {"yaw_loss_linear": 0.004, "wheel_loss_diff_linear": 3e-4}[name]
    assert coefficient(by_plant(composed_term={name: size}).composed(), name) == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize(("name", "power"), [("drive_gain_v2", "V³"), ("wheel_loss_w2", "w³")])
def test_cubes_of_voltage_and_wheel_speed_are_terms(name: str, power: str) -> None:
    assert power in equation([Term(BASIS[name], 0.5)], {})


def test_the_basis_is_the_plants_table() -> None:
    coefficients = {info.name for info in parameters() if "[" in info.meaning}
    assert set(BASIS) == coefficients
    assert {one.place for one in basis()} == {
        *("drive", "wheel", "surge", "yaw", "floor", "encoder", "gyro", "accel_surge", "accel_sway")
    }
    assert all(one.sided == ("_diff_" in one.name) for one in basis())
    assert BASIS["surge_push_sprung"].tuned == ("frequency", "damping")
    assert BASIS["wheel_dry_diff_sin_angle"].tuned == ("order",)
    assert BASIS["gyro_add_t2"].tuned == ("clock",)


def test_every_term_can_be_written() -> None:
    for one in basis():
        written = [Term(one, 0.25)], settings_of([one], {})
        assert "0.25" in equation(*written), one.name
        assert ElementTree.fromstring(mathml(*written)).tag == "math", one.name
        assert legend(*written).endswith("SI units."), one.name


def test_an_equation_reads_as_on_paper() -> None:
    chosen = [
        Term(BASIS["surge_loss_u2"], 1.25),
        Term(BASIS["surge_push_sin_time"], -0.5),
        Term(BASIS["surge_push_tether"], 0.3),
        Term(BASIS["wheel_dry_diff_constant"], 0.01),
    ]
    settings = {"frequency": 1.5, "clock": 1.0}
    assert equation(chosen, settings) == (
        "ΔX = \u22121.25 u³ \u2212 0.5 sin(2 π · 1.5 t) \u2212 0.3 (x cos(ψ) + y sin(ψ)); ΔT = \u22120.01 s sgn(w)"
    )
    assert "power-on" in legend(chosen, settings)
    assert "s is 1 at the left" in legend(chosen, settings)


def test_a_model_file_holds_only_the_terms_that_are_there(tmp_path: Path) -> None:
    table = {"surge_loss_u2": 1.5, "surge_push_sin_time": 0.1, "frequency": 2.0}
    before = with_terms(robot(), table)
    model_file.save(before, tmp_path / "model.toml")
    text = (tmp_path / "model.toml").read_text(encoding="utf-8")
    assert text[text.index(f"[effects.{EFFECT}]") :].count("value =") == len(table)
    after = model_file.load(tmp_path / "model.toml")
    assert {name: value for name, value in after.effects[EFFECT].items() if name in table} == table
    assert [term.basis.name for term in terms_of(after.effects[EFFECT])] == ["surge_loss_u2", "surge_push_sin_time"]
    run = OpenLoopRun(*drive(RUNS["curve"]))
    one, other = plant.simulate([(before, run), (after, run)])
    assert all(np.array_equal(one.outputs[name], other.outputs[name], equal_nan=True) for name in one.outputs)


def terms(**coefficients: float) -> list[Term]:
    return [Term(BASIS[name], value) for name, value in coefficients.items()]
