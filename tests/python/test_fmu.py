"""A model as an FMU gives the plant's own numbers in another program, here FMPy."""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.export import fmu, fmu_description
from brickpilot.vehicle import model as models
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from command import brickpilot
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmus import Unit
from numpy.typing import NDArray
from test_flight import fly

Array = NDArray[np.float64]

STEP_S = 0.003


def tired() -> Model:
    """Returns a robot with effects at each site: timing, drive, supply, motor, gear, wheel, tyre, body and sensors."""
    effects: dict[str, dict[str, float]] = {
        "input_delay": {"delay": 0.05},
        "battery_sag": {"resistance": 2.0},
        "battery_discharge": {},
        "actuator_deadband": {"voltage": 0.2},
        "pwm_coast": {},
        "motor_heating": {},
        "gear_backlash": {},
        "stiction_stribeck": {},
        "wheel_slip": {},
        "payload_mass": {"mass": 0.2, "forward": 0.02, "right": 0.01},
        "floor_slope": {},
        "gyro_bias": {"bias": 0.05},
        "imu_lag": {},
        "sensor_delay": {"delay": 0.02},
    }
    return Model("tired robot 2", "diff_drive", "coupled", {"mass": 1.1, "resistance": 12.0}, effects)


def bench_motor() -> Model:
    effects = {"coulomb_friction": {"torque": 0.004}, "torque_ripple": {}, "input_delay": {"delay": 0.01}}
    return Model("bench", "motor", "coupled", {"mass": 0.3, "wheel_radius": 0.02}, effects)


ROBOTS: dict[str, Callable[[], Model]] = {"packaged": models.rcx, "tired": tired, "motor": bench_motor}


def made(folder: Path, model: Model, version: str) -> Path:
    path = folder / f"{version}.fmu"
    path.write_bytes(fmu.archive(model, version))
    return path


@pytest.fixture(scope="module", params=fmu.VERSIONS)
def units(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Returns a function: name of a robot -> the folder of its unpacked FMU, for one version of FMI."""
    folder = tmp_path_factory.mktemp("fmu")
    done: dict[str, Path] = {}

    def unpacked(name: str) -> Path:
        if name not in done:
            place = folder / name
            place.mkdir()
            path = made(place, ROBOTS[name](), request.param)
            with zipfile.ZipFile(path) as archive:
                archive.extractall(place)
            done[name] = place
        return done[name]

    unpacked.version = request.param  # type: ignore[attr-defined]
    return unpacked


@pytest.fixture
def unit(units: Callable[[str], Path]) -> Iterator[Callable[..., Unit]]:
    opened: list[Unit] = []

    def new(name: str, **options: Any) -> Unit:
        opened.append(Unit(units(name), **options))
        return opened[-1]

    yield new
    for one in opened:
        one.unit.freeInstance()


def driven(model: Model) -> tuple[Array, Array]:
    """Returns times (n,), s, and voltages (n, 1 or 2), V; at NaN the motor floats.

    The steps have many lengths, and all differences of times are exact.
    """
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.cumsum(rng.integers(1, 40, 400) / 1024)])
    volts = rng.uniform(-9.0, 9.0, (len(time), 1 if model.vehicle == "motor" else 2))
    volts = np.repeat(volts[::20], 20, axis=0)[: len(time)]
    volts[(rng.uniform(size=len(time)) < 0.1)] = math.nan
    return time, volts


def inputs_of(volts: Array) -> dict[str, Array]:
    names = ("voltage",) if volts.shape[1] == 1 else ("voltage_left", "voltage_right")
    return dict(zip(names, volts.T, strict=True))


@pytest.mark.parametrize("name", ROBOTS)
def test_every_output_equals_the_plants_to_the_last_bit(unit: Callable[..., Unit], name: str) -> None:
    model = ROBOTS[name]()
    time, volts = driven(model)
    (expected,) = plant.simulate([(model, plant.OpenLoopRun(time, volts))])
    one = unit(name)
    one.begin()
    found = one.run(time, inputs_of(volts))
    assert set(found) == set(expected.outputs)
    for signal, values in expected.outputs.items():
        assert np.array_equal(found[signal], values), signal
    assert np.ptp(found["velocity" if name == "motor" else "x"]) > 0.01


TRUTH = {"x": "true_x_m", "y": "true_y_m", "yaw_angle": "true_heading_rad", "current_left": "left_current_a"}


def test_a_flown_mission_is_flown_again_to_the_last_bit(unit: Callable[..., Unit]) -> None:
    log = fly("coupled", "imu+encoders", seed=2, duration=12.0).log
    one = unit("packaged")
    one.begin()
    for k, (left, right) in enumerate(zip(log["left_voltage_v"], log["right_voltage_v"], strict=True)):
        assert one.get(*TRUTH) == [log[column][k] for column in TRUTH.values()]
        one.set({"voltage_left": float(left), "voltage_right": float(right)})
        one.step(k * STEP_S, STEP_S)
    assert np.ptp(log["true_x_m"]) > 1.0


def test_fmpys_own_simulation_of_a_mission_differs_by_the_rounding_of_its_times(units: Callable[[str], Path]) -> None:
    """FMPy's steps are differences of times, and so differ from 3 ms in the last bits."""
    log = fly("coupled", "imu+encoders", seed=2, duration=12.0).log
    time = np.arange(len(log["time_s"])) * STEP_S
    rows = list(zip(time, log["left_voltage_v"], log["right_voltage_v"], strict=True))
    table = np.array(rows, dtype=[("time", "f8"), ("voltage_left", "f8"), ("voltage_right", "f8")])
    found = fmpy.simulate_fmu(units("packaged"), input=table, stop_time=time[-1], output_interval=STEP_S)
    assert len(found) == len(time)
    for signal, column in TRUTH.items():
        assert np.abs(found[signal] - log[column]).max() < 1e-12


@pytest.mark.parametrize("name", ROBOTS)
def test_the_validation_of_fmpy_finds_nothing(units: Callable[[str], Path], name: str) -> None:
    folder = units(name)
    (archive,) = folder.glob("*.fmu")
    assert validate_fmu(str(archive)) == []


def test_its_validation_would_find_a_wrong_description(units: Callable[[str], Path], tmp_path: Path) -> None:
    for name, content in fmu._content(models.rcx(), units.version).items():  # type: ignore[attr-defined]
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content.replace(b'unit="kg"', b'unit="pound"'))
    assert "pound" in str(validate_fmu(str(tmp_path)))


def test_parameters_have_the_ranges_and_units_of_the_tables(units: Callable[[str], Path]) -> None:
    model = tired()
    rows = {one.name: one for one in fmpy.read_model_description(str(units("tired"))).modelVariables}
    has = catalogue.presets(model.vehicle).keys() - {"force_per_volt", "torque_per_volt"}
    for info in catalogue.parameters():
        if info.name in has:
            row = rows[f"parameters.{info.name}"]
            assert float(row.start) == model.parameters.get(info.name, info.preset)
            assert (float(row.min), float(row.max), row.unit) == (info.minimum, info.maximum, info.unit)
    for effect in catalogue.effects_of(model.effects):
        for info in effect.parameters:
            row = rows[f"effects.{effect.name}.{info.name}"]
            assert float(row.start) == model.effects[effect.name].get(info.name, info.preset)
            assert (float(row.min), float(row.max), row.description) == (info.minimum, info.maximum, info.meaning)
    assert rows["yaw_rate"].unit == "rad/s"


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("N m s/rad", {"kg": "1", "m": "2", "s": "-1", "rad": "-1"}),
        ("V", {"kg": "1", "m": "2", "s": "-3", "A": "-1"}),
        ("ohm", {"kg": "1", "m": "2", "s": "-3", "A": "-2"}),
        ("N m s^0.5/rad^0.5", None),
        ("1", {}),
    ],
)
def test_units_are_told_in_base_units_where_fmi_can_say_them(unit: str, exponents: dict[str, str] | None) -> None:
    assert fmu_description._exponents(unit) == exponents


def test_every_unit_of_the_tables_is_understood() -> None:
    infos = [*catalogue.parameters(), *(info for effect in catalogue.effects() for info in effect.parameters)]
    units = {info.unit for info in infos} | {info.linear_unit for info in infos} | set(catalogue.outputs().values())
    not_whole = {unit for unit in units if fmu_description._exponents(unit) is None}
    assert not_whole == {unit for unit in units if "0.5" in unit}


def test_values_that_are_set_before_the_start_count(unit: Callable[..., Unit]) -> None:
    changed = {"parameters.mass": 1.4, "effects.input_delay.delay": 0.11, "steps.motor_step": 1e-3}
    start = {"x": 1.0, "heading": 0.4, "wheel_speed": (3.0, 2.0), "heat": (9.0, 5.0), "charge": 40.0}
    places = {
        "initial.x": 1.0, "initial.heading": 0.4, "initial.wheel_speed_left": 3.0, "initial.wheel_speed_right": 2.0,
        "initial.heat_left": 9.0, "initial.heat_right": 5.0, "initial.charge": 40.0,
    }  # fmt: skip
    base = tired()
    effects = {**base.effects, "input_delay": {"delay": 0.11}}
    model = Model("changed", "diff_drive", "coupled", {**base.parameters, "mass": 1.4}, effects)
    time, volts = driven(model)
    (expected,) = plant.simulate([(model, plant.OpenLoopRun(time, volts, start, motor_step=1e-3))])
    one = unit("tired")
    one.begin({**changed, **places})
    found = one.run(time, inputs_of(volts))
    assert all(np.array_equal(found[signal], values) for signal, values in expected.outputs.items())


def test_an_output_before_the_start_is_that_of_the_values_set_so_far(unit: Callable[..., Unit]) -> None:
    one = unit("packaged")
    assert one.get("x", "wheel_speed_left") == [0.0, 0.0]
    one.set({"initial.x": 2.5, "initial.surge": 0.0408})
    assert one.get("x") == [2.5]
    assert one.get("wheel_speed_left") == pytest.approx([1.0])


def test_a_state_is_gone_back_to_with_what_is_under_way(unit: Callable[..., Unit]) -> None:
    time, volts = driven(tired())
    inputs, half = inputs_of(volts), 150
    one = unit("tired")
    one.begin()
    one.run(time[: half + 1], {name: values[: half + 1] for name, values in inputs.items()})
    saved = one.unit.getFMUstate() if one.two else one.unit.getFMUState()
    rest = {name: values[half:] for name, values in inputs.items()}
    first = one.run(time[half:], rest)
    (one.unit.setFMUstate if one.two else one.unit.setFMUState)(saved)
    second = one.run(time[half:], rest)
    (one.unit.freeFMUstate if one.two else one.unit.freeFMUState)(saved)
    assert all(np.array_equal(first[signal], second[signal]) for signal in first)


def test_instances_do_not_touch_one_another_and_a_reset_begins_anew(unit: Callable[..., Unit]) -> None:
    time, volts = driven(tired())
    inputs = inputs_of(volts)
    alone, heavy, light = (unit("tired") for _ in range(3))
    alone.begin()
    expected = alone.run(time, inputs)
    heavy.begin({"parameters.mass": 3.0})
    light.begin()
    for k in range(200):
        for one in (heavy, light):
            one.set({name: float(values[k]) for name, values in inputs.items()})
            one.step(float(time[k]), float(time[k + 1] - time[k]))
        assert light.get("x", "yaw_rate") == [expected["x"][k + 1], expected["yaw_rate"][k + 1]]
    assert heavy.get("x") != light.get("x")
    heavy.unit.terminate()
    heavy.unit.reset()
    heavy.begin()
    assert np.array_equal(heavy.run(time, inputs)["x"], expected["x"])


def test_a_boolean_lets_a_motor_float_as_nan_does(unit: Callable[..., Unit]) -> None:
    ends = []
    for values in ({"voltage_left": math.nan}, {"voltage_left": 5.0, "floats_left": True}, {"voltage_left": 0.0}):
        one = unit("packaged")
        one.begin({"initial.wheel_speed_left": 10.0, "initial.wheel_speed_right": 10.0})
        one.set({**values, "voltage_right": math.nan})
        one.step(0.0, 0.5)
        ends.append(one.get("wheel_speed_left")[0])
    assert ends[0] == ends[1] > 2 * ends[2]


@pytest.mark.parametrize(
    ("act", "says"),
    [
        (lambda one: one.begin({"parameters.mass": 0.0}), "parameters.mass: 0 is outside 0.001..100000 kg"),
        (lambda one: one.begin({"parameters.mass": math.nan}), "parameters.mass: nan is outside"),
        (lambda one: one.begin({"effects.input_delay.delay": -1.0}), "effects.input_delay.delay: -1 is outside 0.."),
        (lambda one: one.begin({"initial.x": math.inf}), "initial: a value is not finite"),
        (lambda one: one.set({"x": 1.0}), "x: cannot be set, since it is computed"),
        (lambda one: (one.begin(), one.set({"parameters.mass": 1.0})), "parameters.mass: can be set until the init"),
        (lambda one: (one.begin(), one.step(0.0, 0.0)), "step: it is not positive and finite"),
        (lambda one: one.step(0.0, 0.1), "step: the initialisation has not ended"),
        (lambda one: one.set({"voltage_left": math.inf}), "voltage_left: is infinite; NaN lets the motor float"),
        (lambda one: (one.begin({"initial.wheel_speed_left": 1e308}), one.step(0.0, 1.0)), "step: the state diverged"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_one_line(
    unit: Callable[..., Unit], act: Callable[[Unit], Any], says: str
) -> None:
    one = unit("tired")
    with pytest.raises(FMICallException):
        act(one)
    assert len(one.messages) == 1
    assert one.messages[0].startswith(says)


def test_another_description_is_refused(unit: Callable[..., Unit]) -> None:
    with pytest.raises(Exception, match="Failed to instantiate"):
        unit("packaged", token="{00000000-0000-0000-0000-000000000000}")


def test_its_sources_compile_elsewhere_to_the_same_numbers(
    units: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CMake builds the sources without optimisation, which takes less time and changes no bit of a result."""
    (archive,) = units("tired").glob("*.fmu")
    with zipfile.ZipFile(archive) as file:
        file.extractall(tmp_path, [name for name in file.namelist() if not name.startswith("binaries")])
    monkeypatch.setenv("CFLAGS", "-O0")
    build_platform_binary(tmp_path, configuration="Debug")
    time, volts = driven(tired())
    ends = []
    for folder in (tmp_path, units("tired")):
        one = Unit(folder)
        one.begin()
        ends.append(one.run(time, inputs_of(volts)))
        one.close()
    assert all(np.array_equal(ends[0][signal], ends[1][signal]) for signal in ends[0])


def test_the_same_model_gives_the_same_bytes_and_another_one_another_token() -> None:
    first, second = (fmu.archive(tired(), "3.0", binary=False) for _ in range(2))
    assert first == second
    descriptions = [fmu._content(model, "3.0")["modelDescription.xml"] for model in (bench_motor(), tired())]
    tokens = [re.search(rb'instantiationToken="([^"]+)"', text) for text in descriptions]
    assert None not in tokens
    assert tokens[0].group(1) != tokens[1].group(1)


def test_the_command_writes_both_versions_or_nothing(tmp_path: Path) -> None:
    models.save(bench_motor(), tmp_path / "bench.toml")
    options = ("--model", "bench.toml", "--fmi", "both", "--sources-only", "--out", "out/motor.fmu")
    done = brickpilot("export", "fmu", *options, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in sorted((tmp_path / "out").iterdir())] == ["motor-fmi2.fmu", "motor-fmi3.fmu"]
    assert all(validate_fmu(str(path)) == [] for path in (tmp_path / "out").iterdir())
    (tmp_path / "bad.toml").write_text('name = "bad"\nvehicle = "boat"\nprofile = "coupled"\n')
    done = brickpilot("export", "fmu", "--model", "bad.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "bad.toml:2: vehicle" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"bad.toml", "bench.toml", "out"}


def test_no_compiler_and_a_failing_one_give_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for compiler, says in (("no-such-cc", "does not start"), ("false", "failed")):
        monkeypatch.setenv("CC", compiler)
        done = brickpilot("export", "fmu", cwd=tmp_path)
        assert done.returncode == 1
        assert done.stderr.startswith("brickpilot: the C compiler")
        assert says in done.stderr
        assert list(tmp_path.iterdir()) == []
