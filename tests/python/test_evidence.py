"""At the end of discovery, held-out runs confirm the augmented model, contradict it, or do neither."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.discover import seal
from brickpilot.discover.evidence import Judge
from brickpilot.discover.finding import NOMINAL_VALUES, Evidence, Step
from brickpilot.discover.pipeline import discover
from brickpilot.discover.prepare import Prepared, calibrate, prepare
from brickpilot.discover.seal import Sealed, prove, unproved
from brickpilot.vehicle.model import Model
from numpy.typing import NDArray
from synthetic import robot, write

Array = NDArray[np.float64]

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
NOMINAL = "\n".join(
    f"{name} = {{ value = {robot().parameters[name]}, sd = {robot().parameters[name] * 0.02} }}"
    for name in ("mass", "yaw_inertia", "wheel_radius", "half_track", "resistance", "torque_constant", "emf_constant")
)
MOVES = {
    "straight": (4.0, 4.0), "straight_back": (-5.0, -5.0), "spin": (4.0, -4.0), "spin_back": (-5.0, 5.0),
    "again": (5.0, 5.0), "turned": (-4.5, 4.5),
}  # fmt: skip
ROLES = ["fit"] * 4 + ["held_out"] * 2
FRICTION = {"coulomb_friction": {"torque": 0.006}}


def truth(**effects: dict[str, float]) -> Model:
    return dataclasses.replace(robot(), effects=effects)


def written(folder: Path, held_out: Model, fitted: Model) -> Path:
    """Writes a data set with fit runs of the robot `fitted` and held-out runs of the robot `held_out`."""
    told = {"manoeuvres": MOVES, "roles": ROLES}
    write(folder, fitted, NOISE, NOMINAL, **told)
    other = write(folder.with_name(f"{folder.name}-held-out"), held_out, NOISE, NOMINAL, **told)
    for name, role in zip(MOVES, ROLES, strict=True):
        if role == "held_out":
            (folder / f"{name}.csv").write_bytes((other / f"{name}.csv").read_bytes())
    return folder


def ready(folder: Path) -> tuple[Prepared, Model, Sealed]:
    prepared, sealed = prepare(reading.read(folder), None, seed=0, jobs=1)
    prepared, nominal = calibrate(prepared)
    return prepared, nominal.model, sealed


def proved(folder: Path, held_out: Model, **claimed: dict[str, float]) -> Evidence:
    """Returns the evidence of held-out runs for the effects `claimed`; fit runs are of a robot with dry friction."""
    prepared, nominal, sealed = ready(written(folder, held_out, truth(**FRICTION)))
    found = prove(prepared, sealed, robot(), dataclasses.replace(robot(), effects=claimed), {}).evidence
    assert nominal.effects == {}
    assert found is not None
    return found


def test_runs_of_the_same_robot_confirm_the_claim(tmp_path: Path) -> None:
    found = proved(tmp_path / "set", truth(**FRICTION), **FRICTION)
    assert (found.kind, found.contradicted, found.draws) == ("held_out", False, 1.0)
    assert found.removed_fit == pytest.approx(1.0, abs=0.05)
    assert found.removed_held_out == pytest.approx(1.0, abs=0.05)
    shares = f"{100 * found.removed_held_out:.0f} % of their error above noise, and {100 * found.removed_fit:.0f} %"
    assert found.sentence == f"Held-out runs confirm it: it removes {shares} of that of the fit runs."


def test_runs_of_a_robot_without_it_contradict_the_claim(tmp_path: Path) -> None:
    found = proved(tmp_path / "set", robot(), **FRICTION)
    assert (found.kind, found.contradicted, found.draws) == ("fitted_only", True, 0.0)
    assert "do not confirm" in found.sentence
    assert found.removed_held_out is None or found.removed_held_out < 0


def test_runs_that_do_not_show_it_neither_confirm_nor_contradict(tmp_path: Path) -> None:
    found = proved(tmp_path / "set", truth(**FRICTION), gyro_bias={"bias": 1e-6})
    assert (found.kind, found.contradicted) == ("fitted_only", False)
    assert "do not excite" in found.sentence


@pytest.mark.parametrize(("fall", "contradicted", "said"), [(-3.0, False, "but not surely"), (-30.0, True, "do not")])
def test_runs_that_rather_speak_for_it_do_not_contradict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fall: float, contradicted: bool, said: str
) -> None:
    """Of four stretches, three gain 2 nats each. The claim is contradicted if the fourth loses 30 nats, not if 3."""
    monkeypatch.setattr(Judge, "rises", lambda judge, _, __: np.where(np.arange(judge.count) % 4, 2.0, fall))
    found = proved(tmp_path / "set", truth(**FRICTION), **FRICTION)
    assert (found.kind, found.contradicted) == ("fitted_only", contradicted)
    assert said in found.sentence
    assert found.draws is not None
    assert (found.draws < 0.5) is contradicted


def test_a_name_that_held_out_runs_do_not_surely_confirm_is_one_of_two(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The verdict is `ambiguous`: it keeps the effect, and reports the nominal model as a rival."""
    weak = Evidence("fitted_only", 0.9, 0.5, 0.8, False, "The held-out runs speak for it, but not surely.")
    monkeypatch.setattr(seal, "_evidence", lambda *_, **__: weak)
    found = discover(reading.read(written(tmp_path / "set", biased := truth(gyro_bias={"bias": 0.2}), biased)), jobs=1)
    assert found.steps[0].verdict == "named"
    assert found.verdict == "ambiguous"
    (effect,) = found.effects
    assert (effect.name, effect.claimed) == ("gyro_bias", True)
    assert [one.name for one in effect.equivalents] == [NOMINAL_VALUES]
    assert found.steps[-1] == Step("seal", "ambiguous", weak.sentence)


def test_without_held_out_runs_nothing_is_confirmed(tmp_path: Path) -> None:
    folder = write(tmp_path / "set", truth(**FRICTION), NOISE, NOMINAL, manoeuvres=MOVES, roles=["fit"] * 6)
    prepared, _, sealed = ready(folder)
    assert prepared.roles.tested() == []
    found = prove(prepared, sealed, robot(), truth(**FRICTION), {}).evidence
    assert found is not None
    assert (found.kind, found.contradicted, found.draws, found.removed_held_out) == ("fitted_only", False, None, None)
    assert "No run was held out" in found.sentence


def test_a_model_that_adds_nothing_needs_no_proof_and_what_fell_is_simulated_without_it(tmp_path: Path) -> None:
    prepared, _, sealed = ready(written(tmp_path / "set", robot(), truth(**FRICTION)))
    nominal = robot()
    proof = prove(prepared, sealed, nominal, truth(**FRICTION), {})
    plain = unproved(proof, nominal)
    assert proof.is_contradicted
    assert plain.simulated["augmented"] is plain.simulated["nominal"] is proof.simulated["nominal"]
    assert all(one.after == one.before for one in (*plain.gap.values(), *plain.by_signal.values()))
    again, _, other = ready(tmp_path / "set")
    assert prove(again, other, nominal, nominal, {}).evidence is None


def test_held_out_stretches_are_judged_with_the_values_of_their_runs(tmp_path: Path) -> None:
    """The held-out runs had 1.25 times the logged voltage. They confirm dry friction only if this factor is known."""
    held_out = [name for name, role in zip(MOVES, ROLES, strict=True) if role == "held_out"]

    def logged(run: str, table: dict[str, Array]) -> None:
        if run in held_out:
            table |= {name: table[name] / 1.25 for name in ("voltage_left", "voltage_right")}

    told = {"manoeuvres": MOVES, "roles": ROLES, "spoil": logged}
    folder = write(tmp_path / "set", truth(**FRICTION), NOISE, NOMINAL, **told)
    draws = []
    for by_run in ({}, {"supply_gain": dict.fromkeys(held_out, 0.25)}):
        prepared, _, sealed = ready(folder)
        found = prove(prepared, sealed, robot(), truth(**FRICTION), by_run).evidence
        assert found is not None
        draws.append(found.draws)
    assert draws == [0.0, 1.0]


def test_an_effect_of_the_fit_runs_alone_is_not_named(tmp_path: Path) -> None:
    """In the held-out run the other drive is the weaker one, so the law makes its error larger. The held-out run
    contradicts the law, and the verdict is `unknown`. The explanations of the fit runs do not change."""
    moves = {"straight": (4.0, 4.0), "straight_back": (-5.0, -5.0), "spin": (4.0, -4.0), "again": (5.0, 5.0)}
    told = {"manoeuvres": moves, "roles": ["fit", "fit", "fit", "held_out"]}
    honest = write(tmp_path / "honest", truth(motor_asymmetry={"difference": 0.1}), NOISE, NOMINAL, **told)
    other = write(tmp_path / "other", truth(motor_asymmetry={"difference": -0.1}), NOISE, NOMINAL, **told)
    found = discover(reading.read(honest), jobs=1)
    assert found.evidence is not None
    assert found.evidence.kind == "held_out"
    assert all(one.claimed for one in found.effects)

    (honest / "again.csv").write_bytes((other / "again.csv").read_bytes())
    swapped = discover(reading.read(honest), jobs=1)
    assert swapped.explanations == found.explanations  # held-out runs have no influence on them
    assert swapped.evidence is not None
    assert found.evidence.removed_held_out is not None
    assert swapped.evidence.removed_held_out is not None
    assert swapped.evidence.removed_held_out < found.evidence.removed_held_out
    assert swapped.steps[: len(found.steps)] == found.steps
    assert swapped.evidence.contradicted
    assert swapped.verdict == "unknown"
    assert swapped.steps[-1] == Step("seal", "unknown", swapped.evidence.sentence)
    assert not any(one.claimed for one in swapped.effects)
    assert swapped.augmented.effects == {}
    assert found.verdict in ("named", "ambiguous")


def test_a_predictor_is_judged_by_whole_runs_and_by_rms(tmp_path: Path) -> None:
    prepared, _, _ = ready(written(tmp_path / "set", truth(), truth()))
    judge = Judge.of(prepared.coarse, 0).leaving_out_runs()
    runs = [prepared.coarse.rows_of(name) for name, role in zip(MOVES, ROLES, strict=True) if role == "fit"]
    assert judge.count == len(runs)
    assert all(len(np.unique(judge.stretch[rows])) == 1 for rows in runs)
    floors = judge.data.by_signal({signal: judge.data.floor(signal) for signal in judge.data.signals})
    before = 4 * floors
    assert judge.changes(before, 2 * floors) == pytest.approx(np.log(0.5))
    assert judge.changes(before, 0.1 * floors) == pytest.approx(np.log(0.25))  # a smaller rms counts as the floor
    one_worse = np.where(runs[0], 8 * floors, 2 * floors)
    first, *draws = judge.changes(before, one_worse)
    share = runs[0].sum() / len(floors)
    assert first == pytest.approx(np.log((share * 64 + (1 - share) * 4) / 16) / 2)
    assert min(draws) < 0 < max(draws)
