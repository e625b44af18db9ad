"""What discovery finds in data of real machines. Nobody knows all their effects, but some of their physics is known."""

from __future__ import annotations

import dataclasses
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import planted
import pytest
from brickpilot.data import reading
from brickpilot.data.dataset import Dataset
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Effect, Finding
from brickpilot.fit import problem
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from brickpilot.vehicle.replay import Replay
from importing import import_wpilib
from test_dataset import measured

DRY = {"coulomb_friction", "stiction_stribeck", "actuator_deadband", "dead_time", "caster_drag"}
"""Effects that are equivalent while a vehicle drives one way only: with each, nothing moves below some voltage."""

Found = tuple[Dataset, Finding, Model]


@cache
def discovered(folder: Path, scratch: Path) -> Found:
    """Returns the data set, the finding, and the model as read from its file."""
    data = reading.read(folder)
    found = pipeline.discover(data)
    path = scratch / f"{data.name}.toml"
    model_file.save(found.augmented, path)
    return data, found, model_file.load(path)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("models")


def open_names(found: Finding) -> set[str]:
    """Returns every effect of the best explanation and of its rivals."""
    others = {name for effect in found.effects for other in effect.equivalents for name in other.name.split(" + ")}
    return {effect.name for effect in found.effects} | others


def sizes(effects: tuple[Effect, ...]) -> dict[str, float]:
    """Returns "effect.parameter" -> value, SI."""
    return {f"{one.name}.{name}": parameter.value for one in effects for name, parameter in one.parameters.items()}


def intervals(found: Finding) -> list[tuple[float, float]]:
    """Returns the interval of every named size, after a check that no interval contains zero.

    If no mass is stated, a torque is known only in proportion to the mass. Then the voltage that the torque takes has
    an interval, but the torque has none.
    """
    sizes = [one for effect in found.effects for one in effect.parameters.values()]
    given = [one.ci95 or one.identified.ci95 for one in sizes if one.ci95 is not None or one.identified is not None]
    assert all(low > 0 or high < 0 for low, high in given)
    return given


@pytest.fixture(scope="module")
def axis(scratch: Path) -> Found:
    return discovered(measured("linear_axis"), scratch)


def test_linear_axis_has_dry_friction_and_a_constant_load(axis: Found) -> None:
    """Janot, Gautier & Brunot 2019 fitted dry friction of 20.39 N and an offset of -3.16 N.

    The axis's friction depends on speed in a way that these two laws do not describe: the residual exceeds the noise.
    """
    _, found, _ = axis
    assert found.verdict == "named"
    assert found.law_differs
    assert found.term is None
    assert {one.name for one in found.effects if one.claimed} == {"coulomb_friction", "constant_offset"}
    assert found.augmented.effects.keys() == {"coulomb_friction", "constant_offset"}
    units = {parameter.unit for effect in found.effects for parameter in effect.parameters.values()}
    assert units == {"N"}  # the input commands a force
    sizes = {one.name: next(iter(one.parameters.values())) for one in found.effects}
    for name, published in (("coulomb_friction", 20.39), ("constant_offset", -3.16)):
        low, high = sizes[name].ci95
        assert low < published < high


def test_linear_axis_is_in_a_loop_that_tells_next_to_nothing(axis: Found) -> None:
    _, found, _ = axis
    assert found.closed_loop is not None
    assert found.closed_loop.gain < 0.1


def test_coupled_drives_swing_behind_a_sensor_that_knows_no_direction(scratch: Path) -> None:
    """Wigren & Schoukens 2017: two motors, a belt with springs, a pulse counter that does not know the sign.

    The data set states neither spring nor counter. The residual is compared after the first 10 samples of the run
    `test`, from which the state is found: a model without spring and counter leaves 0.22 ticks/s, and so does a
    published linear model.
    """
    data, found, model = discovered(measured("coupled_drives_1"), scratch)
    assert found.verdict in ("named", "ambiguous")
    sure = {"unsigned_sensor", "coupled_inertia"}
    assert sure <= {one.name for one in found.effects}
    assert all(sure <= {*one.effects} for one in found.explanations)
    assert model.effects["coupled_inertia"]["sensed"] == 1.0
    test = next(run for run in data.runs if run.name == "test")
    simulated = Replay(data).simulate([model])[0]["test"]["speed"]
    assert float(np.sqrt(np.mean((simulated - test.outputs["speed"])[10:] ** 2))) < 0.13


@pytest.fixture(scope="module")
def lego(scratch: Path) -> Found:
    return discovered(measured("lego_ev3_motor"), scratch)


def test_lego_motor_loses_a_part_of_its_voltage(lego: Found) -> None:
    """Below some voltage nothing moves, and the gain is not the same at small and at large duty.

    Dead band, dead time and dry friction have the same equation while a motor starts and turns only one way, as here.
    """
    _, found, _ = lego
    assert found.verdict == "ambiguous"
    assert found.mechanism in ("bearing", "drive")
    assert open_names(found) >= {"actuator_deadband", "coulomb_friction"}
    assert open_names(found) <= (DRY - {"caster_drag"}) | {"voltage_compression", "pwm_quantisation"}
    assert found.next_experiment is not None
    assert found.next_experiment.manoeuvre is not None
    volts = [volts for _, volts in found.next_experiment.manoeuvre.voltage_left]
    assert min(volts) < 0 < max(volts)  # reversing or coasting separates them
    assert intervals(found)


def test_lego_motor_starts_near_the_duty_that_is_lost(lego: Found) -> None:
    """The line through the steady speeds at 20 and 40 % duty, 77.1 and 216.4 deg/s, crosses zero speed at 9 % duty."""
    _, found, model = lego
    assert starting_voltage(model) / 9.0 == pytest.approx(0.085, abs=0.025)
    gap = found.gap["held_out"]
    assert gap.before is not None
    assert gap.after is not None
    assert gap.after < 0.6 * gap.before


def test_lego_motor_s_frozen_angle_is_a_fault_not_an_effect(lego: Found) -> None:
    _, found, _ = lego
    assert [(fault.run, fault.signal, fault.kind) for fault in found.faults] == [("duty_20", "angle", "frozen")]


def starting_voltage(model: Model) -> float:
    """Returns the voltage, V, at which a motor starts on a slow ramp: it reaches a thousandth of its speed at the end.

    This voltage is the size of the dry friction, whichever law the model has for the friction.
    """
    time = np.linspace(0.0, 60.0, 6001)
    volts = 4.0 * time / time[-1]
    run = OpenLoopRun(time=time, inputs=volts[:, np.newaxis])
    speed = plant.simulate([(model, run)])[0].outputs["speed"]
    return float(volts[int(np.argmax(speed > 1e-3 * speed[-1]))])


@pytest.fixture(scope="module")
def frc(scratch: Path, tmp_path_factory: pytest.TempPathFactory, full: bool) -> Found:
    """Discovery on every fourth sample (50 samples/s); with --full, on all samples. Both name the same effects."""
    logs = measured("frc_drivetrain")
    folder = tmp_path_factory.mktemp("frc") / "set"
    import_wpilib([logs / f"{name}-data.json" for name in ("linear", "angular")], folder)
    if not full:
        planted.thin(folder, 4)
    return discovered(folder, scratch)


def test_frc_drivetrain_has_dry_friction_among_the_best_names(frc: Found) -> None:
    """The log was made for a characterisation that fits a voltage for friction. Something else in the log drifts.

    No mass is stated, so no force has an interval in newtons; but the data cannot be explained without friction.
    """
    _, found, _ = frc
    assert found.verdict in ("ambiguous", "unknown")
    assert {effect.name for effect in found.effects} & (DRY - {"actuator_deadband", "dead_time"})
    assert found.term is None
    if found.verdict == "unknown":
        assert not any(one.claimed for one in found.effects)
        assert found.augmented.effects == {}


@pytest.fixture(scope="module")
def mouse_data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Every second sample of the log."""
    folder = tmp_path_factory.mktemp("mouse") / "set"
    shutil.copytree(measured("micromouse"), folder, copy_function=shutil.copyfile)
    planted.thin(folder, 2)
    return reading.read(folder)


@pytest.fixture(scope="module")
def mouse(mouse_data: Dataset) -> Finding:
    """Discovery on five of the seven runs, which takes a quarter of the time."""
    runs = tuple(run for run in mouse_data.runs if run.name not in ("t0_2", "r0_6"))
    return pipeline.discover(dataclasses.replace(mouse_data, runs=runs))


def test_micromouse_s_faults_are_reported_and_no_gyro_limit_lies_below_its_readings(
    mouse_data: Dataset, mouse: Finding
) -> None:
    """In two runs the gyro saturates at 34.6 rad/s, and such readings are left out: a smaller limit cannot be true."""
    kinds = {(fault.run, fault.signal, fault.kind) for fault in mouse_data.faults}
    assert kinds >= {
        ("r0_8", "yaw_rate", "clipped"),
        ("r1_0", "yaw_rate", "clipped"),
        ("r0_6", "battery_voltage", "dropout"),
        ("r1_0", "battery_voltage", "dropout"),
    }
    largest = max(float(np.nanmax(np.abs(run.outputs["yaw_rate"]))) for run in mouse.dataset.runs)
    assert sizes(mouse.effects).get("gyro_saturation.limit", largest) >= largest


def test_micromouse_is_not_explained_at_the_cost_of_held_out_runs(mouse: Finding) -> None:
    """The mouse collides, and its wheels slide in turns on the spot. Whichever effects are named, no gap may grow."""
    for gap in mouse.gap.values():
        assert gap.before is not None
        assert gap.after is not None
        assert gap.after <= gap.before * (1 + 1e-9)
    intervals(mouse)


def test_an_answer_does_not_hang_on_a_number_that_means_nothing(lego: Found, monkeypatch: pytest.MonkeyPatch) -> None:
    """The prior of an unstated value is so wide that it only fixes what the data leave open: sds of 30 and 20 agree.

    The linear axis would get the same names even with an sd of 1; with that sd the LEGO motor gets another name.
    """
    monkeypatch.setattr(problem, "_ANCHOR_SD", 20.0)
    data, found, _ = lego
    again = pipeline.discover(data)
    assert again.verdict == found.verdict
    assert [effect.name for effect in again.effects] == [effect.name for effect in found.effects]
