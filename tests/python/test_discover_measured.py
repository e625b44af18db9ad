"""What discovery finds for real machines. Nobody knows their truth, but some of their physics is known."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import planted
import pytest
from brickpilot.data import dataset
from brickpilot.data.dataset import Dataset
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Effect, Finding
from brickpilot.fit.compare import compare
from brickpilot.fit.rates import measured_rates
from brickpilot.importers.wpilib import import_wpilib
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from test_dataset import measured

DRY = {"coulomb_friction", "stiction_stribeck", "actuator_deadband", "dead_time", "caster_drag"}
"""Effects that are equivalent while a vehicle drives one way only: below some voltage nothing moves."""

Found = tuple[Dataset, Finding, Model]


@cache
def discovered(folder: Path, scratch: Path) -> Found:
    """Returns the data set, the finding, and the model as its file says."""
    data = dataset.read(folder)
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
    """ "effect.parameter" -> value, SI."""
    return {f"{one.name}.{name}": parameter.value for one in effects for name, parameter in one.parameters.items()}


def intervals(found: Finding) -> list[tuple[float, float]]:
    """Returns the interval of every named size, after a check that none holds zero.

    If nobody stated the mass, a torque is known only in proportion to it, and has no interval in newton metres.
    """
    given = [one.ci95 for effect in found.effects for one in effect.parameters.values() if one.ci95 is not None]
    assert all(low > 0 or high < 0 for low, high in given)
    return given


@pytest.fixture(scope="module")
def axis(scratch: Path) -> Found:
    return discovered(measured("linear_axis"), scratch)


def test_linear_axis_has_dry_friction_and_differs_forward_and_backward(axis: Found) -> None:
    """Published: dry and viscous friction and an offset; with a friction of its own in each direction fits better."""
    _, found, _ = axis
    names = {effect.name for effect in found.effects}
    assert found.verdict == "named"
    assert {"coulomb_friction", "direction_asymmetry"} <= names <= {
        "coulomb_friction", "direction_asymmetry", "constant_offset"
    }  # fmt: skip
    assert len(intervals(found)) == len(sizes(found.effects))
    units = {parameter.unit for effect in found.effects for parameter in effect.parameters.values()}
    assert units <= {"N", "N s/m"}  # the input commands a force


def test_linear_axis_has_the_published_parameters(axis: Found) -> None:
    """Janot, Gautier & Brunot 2019: 95.11 kg, 203.5 N s/m, 20.39 N, an offset of -3.16 N.

    They fitted one friction and an offset. Here forward and backward have losses of their own, so that the offset is
    the mean difference: what is constant, half the difference of the dry friction, and half that of the viscous one at
    the mean speed. A constant load, ours, counts against forward motion as theirs does.
    """
    data, found, model = axis
    size = {"constant_offset.torque": 0.0, "direction_asymmetry.torque": 0.0, "direction_asymmetry.drag": 0.0}
    size |= sizes(found.effects)
    # Theirs is a regression of the force. A free run of the position trades a little of the mass for the losses: 92.2
    # kg with 200.9 N s/m and 21.1 N. Before runs started from averaged states the losses were 179 N s/m and 23.2 N,
    # and the position on the test file was 6.12 mm off; now it is 3.85.
    assert model.parameters["mass"] == pytest.approx(95.11, rel=0.04)
    assert model.parameters["viscous_friction"] == pytest.approx(203.5, rel=0.05)
    dry = size["coulomb_friction.torque"] + size["direction_asymmetry.torque"] / 2
    assert dry == pytest.approx(20.39, rel=0.08)
    low, high = found.effects[0].parameters["torque"].ci95 or (0.0, 0.0)
    assert low < 20.39 < high
    run = next(run for run in data.runs if run.role == "fit")
    speed = np.abs(measured_rates(run)["velocity"])
    mean_speed = float(np.mean(speed[speed > 0.01]))
    offset = size["constant_offset.torque"] + size["direction_asymmetry.torque"] / 2
    mean_offset = offset + size["direction_asymmetry.drag"] / 2 * mean_speed
    # The published offset is the mean of an asymmetry, so that 3 % cannot be asked: -2.9 N is found.
    assert mean_offset == pytest.approx(-3.16, rel=0.1)


def test_linear_axis_is_followed_in_open_loop(axis: Found) -> None:
    """Velocity in windows of 1 s from the measured state: from a sixth to a twentieth and less, on both runs."""
    data, found, model = axis
    before, after = compare(data, found.nominal_model), compare(data, model)
    for role in ("fit", "held_out"):
        assert before.share(role, "velocity", windows=True) == pytest.approx(0.17, abs=0.03)
        left = after.share(role, "velocity", windows=True)
        assert left is not None
        assert left <= 0.05
        gap = found.gap[role]
        assert gap.before is not None
        assert gap.after is not None
        assert gap.after < 0.5 * gap.before


@pytest.fixture(scope="module")
def lego(scratch: Path) -> Found:
    return discovered(measured("lego_ev3_motor"), scratch)


def test_lego_motor_loses_a_part_of_its_voltage(lego: Found) -> None:
    """Below some voltage nothing moves, and the gain is not the same at small and at large duty.

    Dead band, dead time and dry friction are one equation while a motor only starts and turns one way, as here.
    """
    _, found, _ = lego
    assert found.verdict == "ambiguous"
    assert found.mechanism == "drive"
    assert "actuator_deadband" in open_names(found)
    assert open_names(found) <= (DRY - {"caster_drag"}) | {"voltage_compression", "pwm_quantisation"}
    assert found.next_experiment is not None
    assert found.next_experiment.manoeuvre is not None
    volts = [volts for _, volts in found.next_experiment.manoeuvre.voltage_left]
    assert min(volts) < 0 < max(volts)  # reversing or coasting separates them
    assert intervals(found)


def test_lego_motor_starts_near_the_duty_that_is_lost(lego: Found) -> None:
    """The steady speeds at 20 and 40 % duty, 77.1 and 216.4 deg/s, lie on a line through 9 % duty."""
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
    """Returns the V at which a slowly rising voltage starts a motor: its speed is a thousandth of that at the end.

    This is the size of the dry friction, whatever its name.
    """
    time = np.linspace(0.0, 60.0, 6001)
    volts = 4.0 * time / time[-1]
    run = OpenLoopRun(time=time, inputs=volts[:, np.newaxis])
    speed = plant.simulate([(model, run)])[0].outputs["speed"]
    return float(volts[int(np.argmax(speed > 1e-3 * speed[-1]))])


@pytest.fixture(scope="module")
def frc(scratch: Path, tmp_path_factory: pytest.TempPathFactory, full: bool) -> Found:
    """Of every fourth sample, 50 a second; with --full of all. Both name the same effects."""
    logs = measured("frc_drivetrain")
    folder = tmp_path_factory.mktemp("frc") / "set"
    import_wpilib([logs / f"{name}-data.json" for name in ("linear", "angular")], folder)
    if not full:
        planted.thin(folder, 4)
    return discovered(folder, scratch)


def test_frc_drivetrain_has_dry_friction_and_held_out_runs_confirm_it(frc: Found) -> None:
    """The characterisation that the log was made for fits a voltage for friction; something else drifts beside it.

    Nobody stated the mass, so that no force has an interval in newtons, and yet the data cannot do without it.
    """
    _, found, _ = frc
    assert found.verdict in ("named", "ambiguous")
    assert {effect.name for effect in found.effects} & (DRY - {"actuator_deadband", "dead_time"})
    assert found.term is None
    gap = found.gap["held_out"]
    assert gap.before is not None
    assert gap.after is not None
    assert gap.after < 0.3 * gap.before
    for side in ("left", "right"):
        gap = found.by_signal[f"wheel_velocity_{side}"]
        assert gap.before is not None
        assert gap.after is not None
        assert gap.after < 0.5 * gap.before


@pytest.fixture(scope="module")
def mouse(scratch: Path) -> Found:
    return discovered(measured("micromouse"), scratch)


def test_micromouse_s_faults_are_reported_and_no_gyro_limit_lies_below_its_readings(mouse: Found) -> None:
    """The gyro ends at 34.6 rad/s in two runs, where readings are left out: no smaller limit can be the truth."""
    data, found, _ = mouse
    kinds = {(fault.run, fault.signal, fault.kind) for fault in found.faults}
    assert kinds >= {
        ("r0_8", "yaw_rate", "clipped"),
        ("r1_0", "yaw_rate", "clipped"),
        ("r0_6", "battery_voltage", "dropout"),
        ("r1_0", "battery_voltage", "dropout"),
    }
    largest = max(float(np.nanmax(np.abs(run.outputs["yaw_rate"]))) for run in data.runs)
    assert sizes(found.effects).get("gyro_saturation.limit", largest) >= largest


def test_micromouse_is_not_explained_at_the_cost_of_held_out_runs(mouse: Found) -> None:
    """It collides, and its wheels slide on the spot. Whatever is named, held-out runs must not get worse."""
    _, found, _ = mouse
    for gap in found.gap.values():
        assert gap.before is not None
        assert gap.after is not None
        assert gap.after <= gap.before * (1 + 1e-9)
    intervals(found)
