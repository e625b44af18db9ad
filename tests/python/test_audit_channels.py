"""The audit finds wrong signs and units of channels by physics, from other channels of the run or from other runs."""

from __future__ import annotations

import dataclasses
import re
from math import pi
from pathlib import Path

import numpy as np
import planted
import pytest
import synthetic
from brickpilot import catalogue
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from test_audit import measured as measured  # the fixture: copies of the measured sets
from test_audit import needs_data

DEGREES, RPM = 180 / pi, 30 / pi
WHEELS = ["wheel_speed_left", "wheel_speed_right"]
NOISE = {
    "accel_surge": 0.025, "accel_sway": 0.025, "yaw_rate": 0.014, "yaw_angle": 0.01,
    "wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "wheel_angle_left": 0.02, "wheel_angle_right": 0.02,
}  # fmt: skip
GEOMETRY = "wheel_radius = 0.041\nhalf_track = 0.069"  # a percent or two off
SOME = {**synthetic.MANOEUVRES, "pivot": (5.0, 0.0), "right": (-5.0, 6.0)}


def robot(folder: Path, factors: dict[str, float], *runs: str, noise: dict[str, float] = NOISE, **options) -> Dataset:
    """Returns a synthetic data set with columns multiplied by `factors`, in `runs` or, if none are given, in all."""

    def spoil(run: str, table: dict[str, np.ndarray]) -> None:
        if not runs or run in runs:
            for name, factor in factors.items():
                table[name] = table[name] * factor

    options = {"manoeuvres": SOME, "nominal": GEOMETRY, **options}
    nominal = options.pop("nominal")
    truth = options.pop("truth", synthetic.robot())
    return read(synthetic.write(folder, truth, noise, nominal, spoil=spoil, **options))


def is_mended(dataset: Dataset) -> bool:
    """Returns whether the data set has a wiring fault whose channel is corrected in sign or scale."""
    return any(one.is_mended for one in dataset.wiring)


def wrong(dataset: Dataset) -> dict[tuple[str, str], tuple[str, float | None]]:
    return {(fault.run, fault.signal): (fault.kind, fault.factor) for fault in dataset.faults}


@pytest.mark.parametrize("lone", [False, True])
@pytest.mark.parametrize("runs", [(), ("spin",)])
def test_a_wrong_unit_beyond_the_stated_range_is_no_clipping(runs: tuple[str, ...], lone: bool, tmp_path: Path) -> None:
    noise = {"yaw_rate": 0.014, "accel_surge": 0.025} if lone else NOISE
    robot(tmp_path / "s", {"yaw_rate": DEGREES}, *runs, noise=noise)
    toml = tmp_path / "s" / "dataset.toml"
    before = 'yaw_rate = { column = "yaw_rate",'
    text = toml.read_text(encoding="utf-8")
    assert before in text
    toml.write_text(text.replace(before, f"{before} range = [-12, 12],"), encoding="utf-8")
    dataset = read(tmp_path / "s")
    found = wrong(dataset)
    if lone and not runs:  # nothing determines the factor
        assert found == {(run, "yaw_rate"): ("unit", None) for run in SOME}
        assert (
            "all runs: yaw_rate is far beyond its stated range, so it may be in another unit; left out" in dataset.notes
        )
    else:
        assert found == {(run, "yaw_rate"): ("unit", pytest.approx(DEGREES)) for run in runs or SOME}
    for run in dataset.runs:
        assert np.isnan(run.outputs["yaw_rate"]).all() == ((run.name, "yaw_rate") in found and not is_mended(dataset))


@pytest.mark.parametrize("nominal", [GEOMETRY, "mass = 0.6"])
@pytest.mark.parametrize(("factor", "kind"), [(-1.0, "sign"), (DEGREES, "unit"), (1 / DEGREES, "unit"), (RPM, "unit")])
@pytest.mark.parametrize("signal", ["yaw_rate", "yaw_angle", "wheel_speed_left", "wheel_angle_right"])
@pytest.mark.parametrize("runs", [(), ("spin",), ("curve", "right")])
def test_a_channel_is_found_wrong_in_the_runs_it_is_wrong_in(
    signal: str, factor: float, kind: str, runs: tuple[str, ...], nominal: str, tmp_path: Path
) -> None:
    dataset = robot(tmp_path / "s", {signal: factor}, *runs, nominal=nominal)
    found = wrong(dataset)
    assert found == {(run, signal): (kind, pytest.approx(factor)) for run in runs or SOME}
    for run in dataset.runs:
        assert np.isnan(run.outputs[signal]).all() == ((run.name, signal) in found and not is_mended(dataset))
        assert np.isfinite(run.raw_outputs[signal]).all()


@pytest.mark.parametrize("factor", [-1.0, 1 / 9.80665, 1000.0])
@pytest.mark.parametrize("signal", ["accel_surge", "accel_sway"])
def test_an_acceleration_is_held_against_wheels_and_gyro(signal: str, factor: float, tmp_path: Path) -> None:
    found = wrong(robot(tmp_path / "s", {signal: factor}))
    assert found == {(run, signal): ("sign" if factor < 0 else "unit", pytest.approx(factor)) for run in SOME}


@pytest.mark.parametrize("runs", [(), ("curve",)])
def test_a_voltage_that_all_channels_go_against_is_itself_reversed(runs: tuple[str, ...], tmp_path: Path) -> None:
    dataset = robot(tmp_path / "s", {"voltage_left": -1.0, "voltage_right": -1.0}, *runs)
    named = {(run, f"voltage_{side}"): ("sign", -1.0) for run in runs or SOME for side in ("left", "right")}
    assert wrong(dataset) == named
    for run in dataset.runs:
        spoilt = (run.name, "voltage_left") in named
        lost = spoilt and not is_mended(dataset)
        assert all(np.isnan(values).all() == lost for values in run.outputs.values())
    assert is_mended(dataset) or any("nothing measured in" in note for note in dataset.notes)


def test_both_wheels_in_degrees_are_told_from_a_gyro_in_turns(tmp_path: Path) -> None:
    noise = {name: sd for name, sd in NOISE.items() if name in {*WHEELS, "yaw_rate", "accel_surge"}}
    found = wrong(robot(tmp_path / "s", dict.fromkeys(WHEELS, DEGREES), noise=noise))
    assert found == {(run, name): ("unit", pytest.approx(DEGREES)) for run in SOME for name in WHEELS}


def test_wheels_alone_are_held_against_the_other_runs(tmp_path: Path) -> None:
    noise = dict.fromkeys(WHEELS, 0.05)
    found = wrong(robot(tmp_path / "s", dict.fromkeys(WHEELS, DEGREES), "spin", noise=noise))
    assert found == {("spin", name): ("unit", pytest.approx(DEGREES)) for name in WHEELS}


def test_a_clock_in_milliseconds_is_found_by_angle_and_speed_or_by_the_other_runs(tmp_path: Path) -> None:
    for name, runs in (("all", ()), ("one", ("spin",))):
        found = wrong(robot(tmp_path / name, {"t": 1000.0}, *runs))
        assert found == {(run, "time"): ("clock", 1000.0) for run in runs or SOME}


def test_what_is_said_names_unit_factor_and_witness(tmp_path: Path) -> None:
    dataset = robot(tmp_path / "s", {"yaw_rate": DEGREES}, "spin")
    note = next(note for note in dataset.notes if "yaw_rate" in note)
    assert note.startswith(
        "run spin: yaw_rate seems to be in degrees per second: 57.3 times the value expected from yaw_angle"
    )
    assert note.endswith("; left out")
    fault = dataset.faults[0].to_json()
    assert fault["factor"] == pytest.approx(DEGREES)
    assert (fault["from_s"], fault["to_s"]) == (dataset.runs[2].time[0], dataset.runs[2].time[-1])


@pytest.mark.parametrize("frame", ["FRD", "FLU"])
def test_a_frame_stated_wrongly_turns_all_that_is_sideways(frame: str, tmp_path: Path) -> None:
    sideways = ("accel_sway", "yaw_angle", "yaw_rate")
    found = wrong(robot(tmp_path / "s", dict.fromkeys(sideways, -1.0), frame=frame))
    assert {signal for _, signal in found} >= {"yaw_angle", "yaw_rate"}
    assert {signal for _, signal in found} <= set(sideways)
    assert set(found.values()) == {("sign", -1.0)}


def test_the_only_channel_is_turned_back_and_not_lost(tmp_path: Path) -> None:
    dataset = robot(tmp_path / "s", {"wheel_speed_left": -1.0}, noise={"wheel_speed_left": 0.05})
    assert dataset.notes[0].startswith("wiring: ")
    assert all(np.isfinite(run.outputs["wheel_speed_left"]).all() for run in dataset.runs)
    assert not any("no sound sample is left" in note for note in dataset.notes)


def test_a_channel_that_states_its_error_is_no_fault(tmp_path: Path) -> None:
    """Counts without a sign contradict drives and other sensors in backward motion; once stated, they are no fault."""
    sensor = next(one for one in catalogue.effects() if one.stated_by and one.acts_on == "sensor")
    truth = dataclasses.replace(synthetic.robot(), effects={sensor.name: {}})
    assert {kind for kind, _ in wrong(robot(tmp_path / "s", {}, truth=truth)).values()} == {"sign"}
    toml = tmp_path / "s" / "dataset.toml"
    text = toml.read_text(encoding="utf-8")
    toml.write_text(re.sub(r"^(wheel_\w+ = {)", rf"\1 {sensor.stated_by} = true,", text, flags=re.M), encoding="utf-8")
    stated = read(tmp_path / "s")
    assert wrong(stated) == {}
    assert all(np.isfinite(values).all() for run in stated.runs for values in run.outputs.values())


@pytest.mark.parametrize("effect", [effect.name for effect in catalogue.effects() if not effect.stated_by])
@pytest.mark.parametrize("size", [1.0, 2.5])
def test_no_effect_is_taken_for_a_fault(effect: str, size: float, tmp_path: Path) -> None:
    """Neither a clearly visible effect nor a larger one is a fault, with roughly stated geometry and with none.

    Effects that a channel can state (`stated_by`) are left out: a reading without a sign is wrong in backward motion.
    """
    info = next(one for one in catalogue.effects() if one.name == effect)
    sizes = [size if number == 0 else 1.0 for number in range(len(info.parameters))]
    values = {
        one.name: float(np.clip(one.preset * by, one.minimum, one.maximum))
        for one, by in zip(info.parameters, sizes, strict=True)
    }
    truth = synthetic.robot()
    truth = type(truth)(truth.name, truth.vehicle, truth.profile, truth.parameters, {effect: values})
    for number, nominal in enumerate((GEOMETRY, "mass = 0.6")):
        dataset = robot(tmp_path / str(number), {}, truth=truth, nominal=nominal, seed=number, jitter=number == 1)
        assert wrong(dataset) == {}


@pytest.mark.parametrize("by", [0.5, 0.8, 1.2, 1.5])
@pytest.mark.parametrize("signal", ["yaw_rate", "wheel_speed_left", "wheel_angle_right", "accel_surge"])
def test_a_scale_that_no_unit_explains_is_left_to_physics(signal: str, by: float, tmp_path: Path) -> None:
    assert wrong(robot(tmp_path / "s", {signal: by})) == {}


EVERY = "every run"
IN_MEASURED = [
    ("lego_ev3_motor", ["speed_degps"], -1.0, EVERY, ["speed"]),
    ("lego_ev3_motor", ["speed_degps"], DEGREES, EVERY, ["speed"]),
    ("lego_ev3_motor", ["speed_degps"], 1 / RPM, "duty_60", ["speed"]),
    ("lego_ev3_motor", ["angle_deg"], DEGREES, "duty_m80", ["angle"]),
    ("lego_ev3_motor", ["angle_deg"], -1.0, "duty_100", ["angle"]),
    ("lego_ev3_motor", ["duty"], -1.0, "duty_80", ["duty"]),
    ("linear_axis", ["position_m"], -1.0, EVERY, ["position"]),
    ("linear_axis", ["position_m"], -1.0, "trajectory", ["position"]),
    ("linear_axis", ["position_m"], 1000.0, "trajectory_with_pulses", ["position"]),
    ("linear_axis", ["position_m"], RPM, "trajectory", ["position"]),
    ("micromouse", ["yaw_rate_radps"], -1.0, EVERY, ["yaw_rate"]),
    ("micromouse", ["yaw_rate_radps"], DEGREES, EVERY, ["yaw_rate"]),
    ("micromouse", ["yaw_rate_radps"], 1 / DEGREES, EVERY, ["yaw_rate"]),
    ("micromouse", ["yaw_rate_radps"], -1.0, "r0_8", ["yaw_rate"]),
    ("micromouse", ["yaw_rate_radps"], DEGREES, "r0_6", ["yaw_rate"]),
    ("micromouse", ["travel_left_m"], -1.0, EVERY, ["wheel_travel_left"]),
    ("micromouse", ["travel_right_m"], 1000.0, "t0_3", ["wheel_travel_right"]),
    ("micromouse", ["travel_left_m", "travel_right_m"], 1000.0, EVERY, ["wheel_travel_left", "wheel_travel_right"]),
    ("micromouse", ["travel_left_m", "travel_right_m"], 1000.0, "t0_2", ["wheel_travel_left", "wheel_travel_right"]),
    ("micromouse", ["accel_surge_mps2"], -1.0, EVERY, ["accel_surge"]),
    ("micromouse", ["accel_surge_mps2"], 1 / 9.80665, EVERY, ["accel_surge"]),
    ("micromouse", ["battery_V"], 1000.0, "t0_4", ["battery_voltage"]),
    ("frc", ["yaw_angle"], -1.0, EVERY, ["yaw_angle"]),
    ("frc", ["yaw_angle"], DEGREES, EVERY, ["yaw_angle"]),
    ("frc", ["yaw_angle"], 1 / DEGREES, "angular-data_slow-forward", ["yaw_angle"]),
    ("frc", ["wheel_velocity_left"], 1 / 0.0254, EVERY, ["wheel_velocity_left"]),
    ("frc", ["wheel_velocity_left"], RPM, "linear-data_slow-forward", ["wheel_velocity_left"]),
    ("frc", ["wheel_travel_right"], -1.0, "linear-data_fast-backward", ["wheel_travel_right"]),
    ("frc", ["voltage_left", "voltage_right"], -1.0, "linear-data_fast-backward", ["voltage_left", "voltage_right"]),
]  # fmt: skip


@needs_data
@pytest.mark.parametrize(("name", "columns", "factor", "where", "signals"), IN_MEASURED)
def test_wrong_columns_planted_in_measured_sets_are_found(
    name: str, columns: list[str], factor: float, where: str, signals: list[str], measured: Path, tmp_path: Path
) -> None:
    sound = planted.undamaged(measured / name)
    runs = [] if where == EVERY else [where]
    dataset = planted.plant(measured / name, tmp_path / "s", columns, lambda values: values * factor, *runs)
    kind = "sign" if factor < 0 else "unit"
    standing = {(fault.run, fault.signal) for fault in sound.faults if fault.kind == "frozen"}
    expected = {(run.name, signal, kind) for run in sound.runs for signal in signals if not runs or run.name in runs}
    found = planted.new_faults(dataset, sound)
    assert found <= expected
    # a channel that was already found frozen may show no second fault
    assert {(run, signal) for run, signal, _ in expected - found} <= standing
    named = [fault.factor for fault in dataset.faults if fault.kind == kind]
    np.testing.assert_allclose(named, factor, rtol=0.03)
