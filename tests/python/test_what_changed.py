"""`changed` finds what differs between recordings of one machine; they are simulated here or by an engine, or real."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.changed.change import Constant, change_of
from brickpilot.changed.differences import new_differences
from brickpilot.changed.recordings import spread_of, together
from brickpilot.changed.shared_values import shared_values
from brickpilot.fit.parameters import Plan
from brickpilot.report import changed_page
from brickpilot.vehicle.replay import Replay, in_recording
from click.testing import CliRunner
from command import brickpilot
from hidden import folder
from hidden.recipe import Onset
from lab import changed_sets

RESISTANCE, CONSTANT, INERTIA = 20.0, 0.3, 1e-3  # ohm, N m/A and V s/rad, kg m^2
KNOWN = {
    "resistance": RESISTANCE, "torque_constant": CONSTANT, "emf_constant": CONSTANT, "wheel_inertia": INERTIA,
}  # fmt: skip
STEP_S, FINE = 0.01, 20
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"

Course = Callable[[float], float]
"""Time, s -> a friction coefficient or torque at this time."""


def steady(value: float) -> Course:
    return lambda time: value


def driven(volts: np.ndarray, viscous: Course, dry: Course, gain: float = 1.0, load: float = 0.0) -> np.ndarray:
    """Returns (n,): the speed of a motor, rad/s, by Euler steps of 0.5 ms. Dry friction can hold the motor at rest.

    Args:
        volts: (n,) V.
        viscous, dry: viscous friction, N m s/rad, and dry friction, N m.
        gain: factor of all voltages.
        load: a constant torque against forward motion, N m.
    """
    speed, found, step = 0.0, [], STEP_S / FINE
    for sample, volt in enumerate(volts * gain):
        found.append(speed)
        friction, drag = dry(sample * STEP_S), viscous(sample * STEP_S)
        for _ in range(FINE):
            torque = CONSTANT * (volt - CONSTANT * speed) / RESISTANCE - drag * speed - load
            if speed == 0.0 and abs(torque) <= friction:
                continue
            side = np.sign(speed) if speed else np.sign(torque)
            after = speed + step * (torque - side * friction) / INERTIA
            speed = 0.0 if after * speed < 0 else after
    return np.array(found)


def recording(
    name: str, seed: int, viscous: Sequence[Course], dry: Sequence[Course], gains: Sequence[float] = (1.0, 1.0, 1.0),
    load: float = 0.0,
) -> bp.Dataset:  # fmt: skip
    """Returns a recording of a motor with one run for each entry of `viscous`, `dry` and `gains`, as in `driven`.

    A run lasts for 8 s; it has random steps of voltage, and a speed with noise.
    """
    random, time, frames = np.random.default_rng(seed), np.arange(0.0, 8.0, STEP_S), {}
    for number, (one, other, gain) in enumerate(zip(viscous, dry, gains, strict=True)):
        volts = np.repeat(random.uniform(-8, 8, 10), 80)
        speed = driven(volts, one, other, gain, load) + random.normal(0.0, 0.05, len(time))
        frames[f"run_{number}"] = pd.DataFrame({"time": time, "voltage": volts, "speed": speed})
    signals = {"voltage": "voltage", "speed": ("speed", "rad/s")}
    return bp.Dataset.from_frames(frames, vehicle="motor", signals=signals, nominal=KNOWN, name=name)


THRICE = 3
SMOOTH, ROUGH = [steady(1e-3)] * THRICE, [steady(2e-3)] * THRICE  # N m s/rad
EASY = [steady(0.01)] * THRICE  # N m
LOAD = 0.02  # N m
KV = {1e-3: (CONSTANT**2 + RESISTANCE * 1e-3) / CONSTANT, 2e-3: (CONSTANT**2 + RESISTANCE * 2e-3) / CONSTANT}


@pytest.fixture(scope="module")
def monday() -> bp.Dataset:
    return recording("monday", 1, SMOOTH, EASY)


@pytest.fixture(scope="module")
def friday() -> bp.Dataset:
    return recording("friday", 2, ROUGH, EASY)


@pytest.fixture(scope="module")
def braked(monday: bp.Dataset, friday: bp.Dataset) -> bp.Changed:
    loaded = recording("sunday", 8, SMOOTH, EASY, load=LOAD)
    return bp.changed(monday, recording("tuesday", 3, SMOOTH, EASY), friday, loaded)


def test_two_recordings_of_one_state_have_not_changed(monday: bp.Dataset) -> None:
    found = bp.changed(monday, recording("tuesday", 3, SMOOTH, EASY))
    assert found.verdict == "nothing"
    assert found.changes == ()
    assert "No change is larger than the usual difference" in repr(found)


def test_what_brakes_more_is_told_with_an_interval_that_holds_it(braked: bp.Changed) -> None:
    one = next(change for change in braked.changes if change.recording == "friday")
    assert (braked.verdict, one.what, one.mechanism, one.unit) == ("changed", "kV", "bearing", "V s/rad")
    truth = KV[2e-3] - KV[1e-3]
    assert one.change.ci95[0] < truth < one.change.ci95[1]
    assert one.change.ci95[1] - one.change.ci95[0] < truth / 2
    assert one.before == pytest.approx(KV[1e-3], rel=0.02)
    assert one.percent is not None
    assert one.percent.value == pytest.approx(100 * truth / KV[1e-3], abs=2)
    assert "braking that grows with speed rose by 18" in one.words
    assert one.since is None


def test_the_old_model_is_compared_before_anything_is_explained(braked: bp.Changed) -> None:
    (fit,) = braked.fits["friday"].values()
    assert fit.old_model_before is not None
    assert fit.old_model_before > 99
    assert fit.old_model_after is not None
    assert fit.old_model_after < 90
    assert fit.explained_after is not None
    assert fit.explained_after > 99


def test_the_other_direction_is_told_too(monday: bp.Dataset, friday: bp.Dataset) -> None:
    found = bp.changed(friday, monday)
    (one,) = found.changes
    assert one.what == "kV"
    assert one.change.ci95[0] < KV[1e-3] - KV[2e-3] < one.change.ci95[1]
    assert "fell" in one.words


def test_what_sets_in_within_a_run_is_told_with_its_moment(monday: bp.Dataset) -> None:
    begun = [steady(0.01), steady(0.01), lambda time: 0.01 if time < 3.0 else 0.02]
    found = bp.changed(monday, recording("thursday", 5, SMOOTH, begun))
    (one,) = found.changes
    assert one.mechanism == "bearing"
    assert one.since is not None
    assert one.since.run == "run_2"
    assert one.since.at_s == pytest.approx(3.0, abs=0.5)
    assert one.after / one.before == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("effect", ["speed_lag", "start_delay"])
def test_an_effect_that_is_gone_is_told(effect: str, tmp_path: Path) -> None:
    """The change is minus the whole earlier size: a larger decrease has no influence, so the interval excludes it."""
    pair = changed_sets.Pair("planar", effect, size=2.0, way="gone", index=1, seed_offset=64_000_000)
    before, after = (folder.write(one, tmp_path) for one in pair.recipes())
    (one,) = bp.changed(before, after).changes
    assert one.what == effect
    assert one.after == 0.0
    assert -1.1 * one.before < one.change.ci95[0] < one.change.ci95[1] < -0.9 * one.before


@pytest.mark.parametrize(
    ("run", "at_s", "right"),
    [(3, -0.4, True), (3, 0.4, True), (3, -0.6, False), (4, 1.4, True), (4, 1.6, False), (None, 0.0, False)],
)
def test_the_score_of_a_moment_waits_until_the_effect_shows(run: int | None, at_s: float, right: bool) -> None:
    """The effect begins in run 3, and first shows 1 s after the start of run 4."""
    pair = changed_sets.Pair("planar", "gyro_scale", size=2.0, way="begins", index=0, seed_offset=0)
    recipe = dataclasses.replace(pair.recipes()[1], begins=Onset(3, 2.0))
    names = [one.name for one in recipe.runs]
    since = None if run is None else {"run": names[run], "at_s": at_s + (2.0 if run == 3 else 0.0)}
    said = {"changes": [{"since": since}]}
    truth = {"regions": [{"run": names[4], "from_s": 1.0}, {"run": names[6], "from_s": 0.0}]}
    assert changed_sets.moment_is_right(said, recipe, truth) is right
    assert changed_sets.moment_is_right({"changes": []}, recipe, truth) is None


def test_a_change_within_what_runs_of_one_recording_differ_by_is_none() -> None:
    before = recording("before", 6, SMOOTH, EASY, gains=(0.92, 1.0, 1.08))
    after = recording("later", 7, SMOOTH, EASY, gains=(0.97, 1.04, 1.11))
    found = bp.changed(before, after)
    assert found.verdict == "nothing"


def test_several_later_recordings_each_have_an_answer(braked: bp.Changed) -> None:
    assert braked.verdicts == {"tuesday": "nothing", "friday": "changed", "sunday": "changed"}
    assert [(one.recording, one.what) for one in braked.changes] == [("friday", "kV"), ("sunday", "constant_offset")]
    assert {one.recording for one in braked.constants} == {"before", "tuesday", "friday", "sunday"}
    assert {"recording", "what", "low", "high"} <= set(braked.to_frame().columns)


def test_what_all_recordings_share_is_told_apart_from_what_one_has(braked: bp.Changed) -> None:
    shared = {one.what: one for one in braked.shared}
    assert {what: one.apart for what, one in shared.items() if one.apart} == {
        "kV": ("friday",), "speed per volt": ("friday",), "constant_offset": ("sunday",),
    }  # fmt: skip
    for what, truth in (
        ("kV", KV[1e-3]),
        ("dry friction in volts", 0.01 * RESISTANCE / CONSTANT),
        ("constant_offset", 0.0),
    ):
        low, high = shared[what].value.ci95
        assert low - 0.002 < truth < high + 0.002
        assert high - low < 0.05
    own = {one.recording: one for one in braked.constants if one.what == "constant_offset"}
    assert own["sunday"].ci95[0] < LOAD < own["sunday"].ci95[1]
    assert own["before"].ci95[0] < 0.0 < own["before"].ci95[1]
    text = "\n".join(changed_page.lines(braked))
    assert re.search(r"^kV +0\.36\d* V s/rad \(.*\) +friday$", text, re.MULTILINE), text
    assert re.search(r"^constant_offset +-?[\d.]+ [mµu]N m \(", text, re.MULTILINE), text
    assert re.search(r"<b>[^<]*</b>", changed_page.page(braked, "brickpilot changed"))


def drawn(random: np.random.Generator, between: float, own: float, fault: float, count: int = 6) -> list[Constant]:
    values = random.normal(1.0, between, count) + fault * (np.arange(count) == 2) + random.normal(0.0, own, count)
    half = 1.96 * own
    return [Constant(f"day {k}", "kV", "V s/rad", x, (x - half, x + half)) for k, x in enumerate(values.tolist())]


@pytest.mark.parametrize(("between", "own"), [(0.0, 0.01), (0.03, 0.01), (0.03, 0.05)])
def test_the_mean_over_recordings_holds_the_truth_and_a_fault_stands_apart(between: float, own: float) -> None:
    """Machines differ by `between`, and each is measured to `own`. A fault is ten times both together."""
    random, sd = np.random.default_rng(4), float(np.hypot(between, own))
    sound = [shared_values(drawn(random, between, own, 0.0))[0] for _ in range(300)]
    held = np.mean([one.value.ci95[0] < 1.0 < one.value.ci95[1] for one in sound])
    assert 0.85 < held < 0.99
    assert np.mean([bool(one.apart) for one in sound]) < 0.1
    faulty = [shared_values(drawn(random, between, own, 10 * sd))[0] for _ in range(300)]
    assert np.mean(["day 2" in one.apart for one in faulty]) > 0.9
    assert np.mean([one.value.value for one in faulty]) == pytest.approx(1.0, abs=0.3 * sd)


def test_two_recordings_do_not_tell_which_of_them_differs() -> None:
    assert shared_values(drawn(np.random.default_rng(1), 0.0, 0.01, 1.0, count=2)) == ()


def test_a_model_stands_for_what_was_before(friday: bp.Dataset, tmp_path: Path) -> None:
    dry = {"coulomb_friction": {"torque": 0.01}}
    old = bp.Model("as built", "motor", "coupled", {**KNOWN, "viscous_friction": 1e-3, "inductance": 0.0}, dry)
    bp.save_model(old, tmp_path / "old.toml")
    found = bp.changed(tmp_path / "old.toml", friday)
    assert [one.what for one in found.changes] == ["kV"]
    (fit,) = found.fits["friday"].values()
    assert fit.old_model_before is None
    assert fit.explained_after is not None
    assert fit.explained_after > 99


def test_the_spread_between_runs_is_that_of_random_effects() -> None:
    random = np.random.default_rng(1)
    true, own = 0.3, 0.1
    drawn = [
        spread_of([[(float(random.normal(0, np.hypot(true, own))), own**-2) for _ in range(4)] for _ in range(2)])
        for _ in range(400)
    ]
    assert np.sqrt(np.mean(np.square(drawn))) == pytest.approx(true * 0.5**0.5, rel=0.1)
    assert spread_of([[(0.0, 100.0), (0.01, 100.0)], [(0.0, 100.0), (0.02, 100.0)]]) == 0.0


def test_each_recording_is_simulated_as_its_own_machine(monday: bp.Dataset, friday: bp.Dataset) -> None:
    joint = together({"before": monday, "later": friday})
    shared = bp.Model(
        "m", "motor", "coupled", {**KNOWN, "viscous_friction": 1e-3}, {"coulomb_friction": {"torque": 0.0}}
    )
    said = {"viscous_friction": {"later": 1e-3}, "coulomb_friction.torque": {"later": 0.02}, "delay": {"later": 0.05}}
    model = dataclasses.replace(shared, by_run=said)
    runs = [run.name for run in joint.runs if run.recording == "later"]
    own, other = in_recording(model, "later", runs), in_recording(model, "before", [])
    assert (own.parameters["viscous_friction"], own.effects) == (2e-3, {"coulomb_friction": {"torque": 0.02}})
    assert own.by_run == {"delay": dict.fromkeys(runs, 0.05)}
    assert (other.parameters["viscous_friction"], other.effects) == (1e-3, {})
    late, early = (Replay(joint).simulate([one], only=[runs[0]])[0][runs[0]]["speed"] for one in (own, other))
    assert np.abs(late - early).max() > 1


def test_an_effect_that_both_recordings_have_in_their_own_size_stays_for_the_other() -> None:
    base = Plan(bp.Model("m", "motor", "coupled", {**KNOWN, "viscous_friction": 1e-3}), (), ())
    first, second = (
        next(one for one in new_differences(base.model, ["speed"], name) if one.what == "coulomb_friction")
        for name in ("before", "later")
    )
    both = second.starting(first.starting(base, {first.free[0]: 0.01}), {second.free[0]: 0.02})
    told = {"since": None, "rivals": (), "weight": 1.0}
    one = change_of(first, first.starting(base, {first.free[0]: 0.01}).model, None, 0.0, "before", "later", {}, **told)
    assert (one.before, one.after) == (0.01, 0.0)
    assert "is gone" in one.words
    left = first.removed_from(both.model)
    assert in_recording(left, "later", []).effects == {"coulomb_friction": {"torque": 0.02}}
    assert in_recording(left, "before", []).effects == {}
    assert second.removed_from(left).effects == {}


def test_the_command_says_what_changed_and_leaves_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from brickpilot.cli.main import cli

    monkeypatch.chdir(tmp_path)
    for name, seed, viscous in (("monday", 1, SMOOTH), ("friday", 2, ROUGH)):
        for number, run in enumerate(recording(name, seed, viscous, EASY).runs):
            frame = run.to_frame()
            frame["time"] += number * 20.0
            frame.to_csv(f"{name}.csv", index=False, mode="a" if number else "w", header=not number)
    maps = [word for one in ("time=time", "voltage=voltage", "speed=speed:rad/s") for word in ("--map", one)]
    known = [word for name, value in KNOWN.items() for word in ("--nominal", f"{name}={value}")]
    asked = ["changed", "monday.csv", "friday.csv", "--out", "out", "--vehicle", "motor", *maps, *known]
    ran = CliRunner().invoke(cli, asked)
    assert ran.exit_code == 0, ran.output
    assert "what changed: Braking that grows with speed rose by" in ran.output
    assert "page: out/changed.html" in ran.output
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"changed.html", "changed.json", "data_0", "data_1"}
    told = json.loads((tmp_path / "out/changed.json").read_text())
    assert {"verdict", "changes", "fit_percent", "seed", "version"} <= told.keys()
    one = told["changes"][0]
    assert {"what", "mechanism", "side", "parameter", "unit", "before", "after", "change", "percent"} <= one.keys()
    assert {"since", "rivals", "weight", "words"} <= one.keys()
    assert set(told["fit_percent"]["speed"]) == {"old_model_before", "old_model_after", "explained_after"}
    again = CliRunner().invoke(cli, [*asked, "--json"])
    assert json.loads(again.stdout) == told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.csv"], "AFTER"),
        (["nowhere.csv", "nothing.csv"], "nowhere.csv: no such file"),
        (["no.toml", "nothing.csv"], "no.toml"),
    ],
)
def test_a_wrong_argument_is_one_line(arguments: list[str], said: str, tmp_path: Path) -> None:
    ran = brickpilot("changed", *arguments, cwd=tmp_path)
    assert ran.returncode == 2
    assert said in ran.stderr
    assert "Traceback" not in ran.stderr
    assert not (tmp_path / "runs").exists()


def test_recordings_of_two_vehicles_are_refused(monday: bp.Dataset) -> None:
    robot = dataclasses.replace(monday, vehicle="diff_drive")
    with pytest.raises(bp.InputError, match="is of a diff_drive"):
        bp.changed(monday, robot)


def test_recordings_whose_inputs_mean_something_else_are_refused(monday: bp.Dataset) -> None:
    with pytest.raises(bp.InputError, match="input_timing: is 'linear', and that of"):
        together({"before": monday, "later": dataclasses.replace(monday, input_timing="linear")})


def test_other_nominal_values_of_a_later_recording_are_left_out_with_a_note(monday: bp.Dataset) -> None:
    other = dataclasses.replace(monday, name="friday", nominal={}, notes=("A note of friday.",))
    joint = together({"before": monday, "later": other})
    assert joint.nominal == monday.nominal
    assert "A note of friday." in joint.notes
    assert joint.notes[-1] == "The nominal values of monday are used: friday states others."
    assert [run.name for run in joint.runs if run.recording == "later"] == [f"later: run_{k}" for k in range(THRICE)]


@pytest.mark.parametrize(
    ("before", "after", "whats", "percent"),
    [
        ("shaft_damper_off", "shaft_damper_on", ["kV"], {"kV": (33, 43)}),
        ("shaft_damper_on", "shaft_damper_off", ["kV"], {"kV": (-30.1, -24.8)}),
        ("wheel_on_ground", "wheel_in_air", ["dry friction in volts", "kA"], {"kA": (-56.5, -28.6)}),
    ],
)
def test_real_machines_whose_change_is_known(
    before: str, after: str, whats: list[str], percent: dict[str, tuple[float, float]]
) -> None:
    for name in (before, after):
        if not (SHARED / name).is_dir():
            pytest.skip(f"the measured data set {name} is not here")
    found = bp.changed(SHARED / before, SHARED / after)
    assert found.verdict == "changed"
    assert sorted(one.what for one in found.changes) == whats
    for one in found.changes:
        if one.what in percent:
            low, high = percent[one.what]
            assert one.percent is not None
            assert one.percent.ci95[0] < high
            assert one.percent.ci95[1] > low
