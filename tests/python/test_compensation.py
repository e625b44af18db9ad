"""With a compensation, the firmware of the packaged robot flies another robot: values, file, and effect on missions."""

from __future__ import annotations

import dataclasses
import json
import math
import random
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import robot_study
from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.vehicle import compensation, flight, flight_figures, scenario
from brickpilot.vehicle.model import Model, rcx, save
from command import brickpilot
from compensation_study import ANOTHER, CROSS, MISSIONS, POSITION, PRESETS, Mission, compensation_of, mean, robot

ROOT = Path(__file__).resolve().parents[2]
SEEDS = 4
UNDONE = {one.name: found for one in catalogue.effects() if (found := compensation.undone(one.name))}


@pytest.mark.parametrize("mission", MISSIONS, ids=lambda mission: f"{mission.title}, {mission.sensors}")
def test_the_mission_errs_less_with_the_compensation(mission: Mission) -> None:
    without, compensated = (mission.fly(known, SEEDS) for known in (False, True))
    for measure in mission.shrinks:
        before, after = mean(without, measure), mean(compensated, measure)
        assert after < before, f"{measure}: {before:.4f} without, {after:.4f} with"
    if mission.rest > 0:  # without a rest, the firmware cannot measure the gyro's bias
        assert mean(compensated, "waypoints_reached") == 8


def test_every_setting_of_a_compensation_has_a_value() -> None:
    """For each row of hal/wire/settings.toml with the key `compensation`, compensation.py has an equation."""
    assert set(compensation.si_values(rcx(), rcx())) == set(compensation.FORMATS)


def test_every_effect_that_is_undone_flies_above() -> None:
    flown = {name for mission in MISSIONS for model in mission.plants for name in model.effects}
    assert flown == set(UNDONE)


def test_a_battery_that_sags_a_little_is_undone_by_measuring_it() -> None:
    """The mixer uses the measured battery voltage, but at least `battery_floor`. Without a compensation, a sag down to
    this voltage hardly increases the position error, and a larger sag does.

    The firmware learns a part of a larger sag as friction (firmware/estimator/friction.h): a third of the error stays.
    """
    firm, little, much = (
        mean(Mission("", (robot({"battery_sag": {"resistance": ohm}}),), "imu", 6.0).fly(False, SEEDS), POSITION)
        for ohm in (0.0, 4.0, 16.0)
    )
    assert little < 1.2 * firm
    assert much > 1.2 * firm


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_friction_misjudged_by_a_fifth_is_still_better_told(share: float) -> None:
    known = compensation_of(robot({"coulomb_friction": {"torque": 0.005 * share}}))
    mission = scenario.load(scenario.packaged()["mission"])
    for seed in range(SEEDS):
        plan = flight.plan(
            mission, robot({"coulomb_friction": {"torque": 0.005}}), sensors="imu", seed=seed, compensation=known
        )
        figures = flight_figures.summary(flight.fly(plan))
        assert figures["waypoints_reached"] == 8
        assert figures[POSITION] < 0.08


def test_all_effects_at_once_are_undone_together() -> None:
    sizes = {"coulomb_friction": 0.004, "actuator_deadband": 0.4, "motor_asymmetry": -0.1, "gyro_scale": 0.05}
    sizes |= {"torque_constant_asymmetry": 0.1, "wheel_radius_mismatch": 0.05, "encoder_scale": -0.1, "gyro_bias": 0.1}
    model = robot({name: {next(iter(PRESETS[name])): size} for name, size in sizes.items()}, resistance=20.0)
    figures = Mission("", (model,), "imu+encoders").fly(True, SEEDS)
    assert mean(figures, "waypoints_reached") == 8
    assert mean(figures, CROSS) < 0.04


def test_friction_is_the_voltage_that_holds_it() -> None:
    found = compensation_of(robot({"coulomb_friction": {"torque": 0.005}}))
    assert found.raw["left_friction_mv"] == found.raw["right_friction_mv"] == round(1e3 * 0.005 * 22 / 0.195)
    assert found.raw["left_gain_q15"] == found.raw["left_emf_mv_q15"] == 0
    assert found.sources["left_friction_mv"] == ("coulomb_friction",)
    assert found.value("left_friction_mv") == pytest.approx(0.564)


def test_a_stronger_flux_needs_less_voltage_at_rest_and_more_at_speed() -> None:
    found = compensation_of(robot({"torque_constant_asymmetry": {"difference": 0.1}}))
    for side, flux in (("left", 1.05), ("right", 0.95)):
        gain, emf = found.value(f"{side}_gain_q15"), found.value(f"{side}_emf_mv_q15")
        assert gain == pytest.approx(1 / flux - 1, abs=1e-4)
        # K_t flux (V - K_e flux w) = K_t (u - K_e w): torque of this motor at voltage V, and of the nominal motor at u;
        # w = v / r
        assert (1 + gain) * emf == pytest.approx(0.245 / 0.0408 * (flux - 1 / flux), abs=1e-3)


def test_sensors_are_scaled_back() -> None:
    found = compensation_of(
        robot({"gyro_scale": {"error": 0.1}, "encoder_scale": {"error": -0.1}, "gyro_bias": {"bias": -0.07}})
    )
    assert found.value("gyro_scale_q15") == pytest.approx(1 / 1.1 - 1, abs=1e-4)
    assert found.value("travel_scale_q15") == pytest.approx(1 / 0.9 - 1, abs=1e-4)
    assert found.raw["gyro_bias_mrad_s"] == -70
    assert found.sources["travel_scale_q15"] == ("encoder_scale",)


def test_a_mirrored_robot_gets_the_mirrored_parameters() -> None:
    odd = {"motor_asymmetry": "difference", "torque_constant_asymmetry": "difference"}
    odd |= {"wheel_radius_mismatch": "mismatch", "gyro_bias": "bias"}
    one, other = (compensation_of(robot({name: {key: sign * 0.07} for name, key in odd.items()})) for sign in (1, -1))
    for name, raw in one.raw.items():
        swapped = name.replace("left", "x").replace("right", "left").replace("x", "right")
        negated = name in ("gyro_bias_mrad_s", "count_mismatch_q15")
        assert other.raw[swapped] == (-raw if negated else raw)


def test_nothing_to_undo_is_none() -> None:
    assert compensation.from_model(rcx()) is None
    assert compensation.from_model(robot({"yaw_scrub": {"moment": 0.01}})) is None
    friction = {"coulomb_friction": {"torque": 0.005}}
    assert compensation.from_model(robot(friction, torque_constant=0.0)) is None
    assert compensation.from_model(dataclasses.replace(robot(friction), profile="paper")) is None
    assert compensation.from_model(Model("m", "motor", "coupled", catalogue.presets("motor"), friction)) is None


def test_what_is_not_undone_is_named() -> None:
    stiction = PRESETS["stiction_stribeck"]
    found = compensation_of(robot({"stiction_stribeck": stiction, "input_delay": PRESETS["input_delay"]}))
    assert found.left_out == ("stiction_stribeck.breakaway", "stiction_stribeck.stribeck_speed", "input_delay")


def test_an_effect_keeps_its_preset_where_the_model_leaves_it_out() -> None:
    found = compensation_of(dataclasses.replace(rcx(), effects={"coulomb_friction": {}}))
    assert found.raw["left_friction_mv"] == 564


def test_another_belief_changes_what_has_to_be_undone() -> None:
    assert compensation.from_model(ANOTHER, dataclasses.replace(ANOTHER, effects={})) == dataclasses.replace(
        compensation_of(robot({"coulomb_friction": {"torque": 0.005 * 0.195 / 0.25}})), name=ANOTHER.name
    )
    found = compensation_of(robot({}, wheel_radius=0.0408 * 0.9))
    assert found.sources["travel_scale_q15"] == (compensation.NOMINAL,)
    assert found.undone == ()
    assert compensation_of(ANOTHER).undone == ("coulomb_friction",)
    assert found.value("travel_scale_q15") == pytest.approx(-0.1, abs=1e-4)


def test_what_the_format_cannot_hold_is_cut_and_named() -> None:
    found = compensation_of(robot({"coulomb_friction": {"torque": 1.0}}))
    assert found.raw["left_friction_mv"] == compensation.FORMATS["left_friction_mv"].high
    assert found.limited == ("left_friction_mv", "right_friction_mv", "reserve_mv")
    assert found.remarks[0].startswith("left_friction_mv: this robot needs 113 V (")
    assert found.remarks[0].endswith("), but 32 is the limit")


def test_what_no_setting_carries_is_said() -> None:
    """A remark names each value that no setting can compensate. All robots have friction, which is compensated."""

    def remarks(effects: dict[str, dict[str, float]], **parameters: float) -> tuple[str, ...]:
        friction = {"coulomb_friction": {"torque": 0.001}}
        return compensation_of(robot(friction | effects, **parameters)).remarks

    assert remarks({}) == ()
    assert remarks({}, yaw_inertia=3 * 0.006) == ()
    (turns,) = remarks({}, yaw_inertia=4 * 0.006)
    assert turns.startswith("yaw_inertia: 0.024 kg m^2 at a half-track of 0.07 m")
    (narrow,) = remarks({}, half_track=0.3 * 0.07)
    assert narrow.startswith("yaw_inertia: 0.006 kg m^2 at a half-track of 0.021 m")
    (battery,) = remarks({}, battery_voltage=24.0)
    assert battery.startswith("battery_voltage: 24 V is outside the 5 to 20 V")
    left, right = remarks({"constant_offset": {"torque": 0.002}})
    assert left.startswith("left_offset_mv: a load of 0.002 N m exceeds the dry friction of 0.001 N m")
    assert right.startswith("right_offset_mv: ")
    assert remarks({"input_delay": {"delay": 0.02}}) == ("input_delay: no setting of the firmware undoes it",)


@pytest.mark.parametrize(("times", "whole"), [(3.0, True), (4.0, False)])
def test_the_remark_on_turns_parts_robots_that_fly_from_those_that_do_not(times: float, whole: bool) -> None:
    model = robot({"coulomb_friction": {"torque": 0.001}}, yaw_inertia=times * 0.006)
    figures = Mission("", (model,), "imu+encoders").fly(True, SEEDS)
    assert all(flown["waypoints_reached"] == 8 for flown in figures) == whole
    assert (compensation_of(model).remarks == ()) == whole


EVERYTHING = robot(
    {name: PRESETS[name] | dict.fromkeys(parameters, 0.05) for name, parameters in UNDONE.items()}
    | {"input_delay": PRESETS["input_delay"]},
    resistance=21.0,
)


@pytest.mark.parametrize("seed", range(200))
def test_whatever_the_plant_takes_fits_the_formats(seed: int) -> None:
    draw = random.Random(seed)

    def extreme(info: catalogue.ParameterInfo) -> float:
        return draw.choice([info.minimum, info.maximum, info.preset])

    infos = [i for i in catalogue.parameters() if i.name in catalogue.presets("diff_drive")]
    nominal = {i.name: extreme(i) if draw.random() < 0.4 else i.preset for i in infos}
    chosen = [effect for effect in catalogue.effects() if effect.name in UNDONE and draw.random() < 0.4]
    effects = {effect.name: {info.name: extreme(info) for info in effect.parameters} for effect in chosen}
    found = compensation.from_model(dataclasses.replace(rcx(), parameters=nominal, effects=effects))
    if found is not None:
        assert all(how.low <= found.raw[name] <= how.high for name, how in compensation.FORMATS.items())


def test_a_saved_compensation_is_read_back_exactly(tmp_path: Path) -> None:
    before = compensation_of(dataclasses.replace(EVERYTHING, name='näme = "odd"'))
    before.save(tmp_path / "compensation.toml")
    assert compensation.load(tmp_path / "compensation.toml") == before
    assert [path.name for path in tmp_path.iterdir()] == ["compensation.toml"]
    assert all(before.raw.values())


def test_an_older_file_stays_whole_when_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "compensation.toml"
    compensation_of(EVERYTHING).save(target)
    text = target.read_text()

    def fail(*_: object) -> str:
        raise OSError("disk full")

    monkeypatch.setattr(compensation, "render", fail)
    with pytest.raises(OSError, match="disk full"):
        compensation_of(ANOTHER).save(target)
    assert target.read_text() == text
    assert [path.name for path in tmp_path.iterdir()] == ["compensation.toml"]


def test_the_c_calls_are_taken_by_a_compiler(tmp_path: Path) -> None:
    found = compensation_of(EVERYTHING)
    text = compensation.render(found)
    calls = [line.removeprefix("# ") for line in text.splitlines() if line.startswith("# parameters_write(")]
    source = tmp_path / "found.c"
    body = "".join(f"    {call}\n" for call in calls)
    source.write_text(
        '#include "app/parameters.h"\nvoid tell(parameters_t *given);\n'
        f"void tell(parameters_t *given)\n{{\n#define parameters *given\n{body}}}\n"
    )
    folders = [f"-I{ROOT / folder}" for folder in ("firmware", "hal/include", "hal")]
    subprocess.run(
        ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *folders, str(source)], check=True
    )
    assert len(calls) == len(found.raw)
    assert text.endswith("".join(f"# {call}\n" for call in calls))


Change = Callable[[str], str]
BAD: dict[str, tuple[Change, str]] = {
    "an unknown key": (lambda text: "other = 1\n" + text, "c.toml:1: other: unknown key"),
    "an unknown parameter": (
        lambda text: text.replace("[parameters]", "[parameters]\nspeed = { raw = 1 }"),
        "parameters.speed: unknown key",
    ),
    "a raw number outside its format": (
        lambda text: text.replace("raw = 564", "raw = 32001", 1),
        "parameters.left_friction_mv: 32.001 V is outside 0 to 32 V: raw 0..32000",
    ),
    "a raw number that is none": (lambda text: text.replace("raw = 564", "raw = 1.5", 1), "is not a whole number"),
    "no raw number": (lambda text: text.replace("raw = 564, ", "", 1), "left_friction_mv.raw: is missing"),
    "another format": (lambda text: text.replace('format = "mV"', 'format = "q15"', 1), "'q15' should be 'mV'"),
    "another unit": (lambda text: text.replace('unit = "V"', 'unit = "mV"', 1), "'mV' should be 'V'"),
    "a value that contradicts": (lambda text: text.replace("0.564", "0.7", 1), "does not agree with raw = 564"),
    "sources that are no texts": (lambda text: text.replace('["coulomb_friction"]', "[1]", 1), "not a list of texts"),
    "no name": (lambda text: text.replace('name = "rcx"', ""), "name: is missing"),
    "no parameters": (lambda _: 'name = "rcx"\n', "parameters: is missing"),
    "no TOML": (lambda text: text + "=", "is not TOML"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_with_its_place(name: str, tmp_path: Path) -> None:
    change, message = BAD[name]
    path = tmp_path / "c.toml"
    path.write_text(change(compensation.render(compensation_of(robot({"coulomb_friction": {"torque": 0.005}})))))
    with pytest.raises(InputError) as refused:
        compensation.load(path)
    assert message in str(refused.value)
    assert str(refused.value).startswith(str(path))


def test_a_file_may_hold_a_part_of_the_parameters(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('name = "c"\n[parameters]\ndeadband_mv = { raw = 300 }\n')
    found = compensation.load(tmp_path / "c.toml")
    assert {name: raw for name, raw in found.raw.items() if raw} == {"deadband_mv": 300}


def test_what_discover_finds_of_another_robot_lets_the_packaged_firmware_fly_it(tmp_path: Path) -> None:
    """Robot 1 of `robot_study` weighs 0.7 kg, and its drives lose 0.17 V. Its log is not simulated by the plant."""
    found = robot_study.study(1, tmp_path, seeds=2)
    assert "actuator_deadband" in found["found"]
    for sensors in robot_study.SENSORS:
        assert robot_study.missions(found, f"{sensors}, with") == 2
    assert robot_study.missions(found, "imu+encoders, without") == 0  # with `imu` the firmware learns this loss


def test_run_flies_an_augmented_model_with_its_compensation(tmp_path: Path) -> None:
    model = robot({"coulomb_friction": {"torque": 0.032}})  # more than the firmware can learn
    save(model, tmp_path / "model.toml")
    compensation_of(model).save(tmp_path / "compensation.toml")
    flying = ("run", "--model", "model.toml", "--sensors", "imu", "--json")
    without = brickpilot(*flying, "--out", "without", cwd=tmp_path)
    compensated = brickpilot(*flying, "--compensation", "compensation.toml", "--out", "with", cwd=tmp_path)
    assert (without.returncode, compensated.returncode) == (1, 0), without.stderr + compensated.stderr
    before, after = json.loads(without.stdout), json.loads(compensated.stdout)
    assert (before["waypoints_reached"], after["waypoints_reached"]) == (0, 8)
    assert after[CROSS] < before[CROSS]
    assert before["compensation"] is None
    assert after["compensation"] == compensation_of(model).raw
    assert "--compensation compensation.toml" in (tmp_path / "with" / "report.html").read_text()


@pytest.mark.parametrize("extra", [("--profile", "paper"), ("fig4",)])
def test_run_refuses_a_compensation_that_it_has_no_use_for(extra: tuple[str, ...], tmp_path: Path) -> None:
    compensation_of(robot({"coulomb_friction": {"torque": 0.005}})).save(tmp_path / "c.toml")
    run = brickpilot("run", *extra, "--compensation", "c.toml", cwd=tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == "brickpilot: compensation: needs a mission in the profile coupled\n"
    assert not (tmp_path / "runs").exists()


def test_the_reserve_is_of_the_robot_s_own_battery() -> None:
    """If the drive needs 10 % more voltage, controllers may use 10/11 of the battery voltage: the reserve is 1/11."""
    for battery in (6.0, 9.0, 14.0):
        found = compensation_of(robot({}, resistance=22.0 * 1.1, battery_voltage=battery))
        assert found.value("reserve_mv") == pytest.approx(battery / 11, abs=1e-3)


def test_the_reserve_is_what_the_weaker_side_lacks() -> None:
    found = compensation_of(robot({"motor_asymmetry": {"difference": 0.1}}))
    assert found.value("reserve_mv") == pytest.approx(9 - 9 * 0.95, abs=1e-3)
    assert math.isclose(found.value("right_gain_q15"), 1 / 0.95 - 1, abs_tol=1e-4)
