"""The reader of data sets returns SI values in the paper's frame, whatever units and frame the data set has."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from bad_datasets import write_good
from brickpilot import catalogue
from brickpilot.data.dataset import PRESET_BATTERY_VOLTAGE, motor_inputs
from brickpilot.data.reading import read
from brickpilot.data.signals import SIGNALS, to_frd
from brickpilot.data.units import si_factor
from brickpilot.fit.parameters import plan

EXAMPLE = """\
name     = "bench-7"
vehicle  = "diff_drive"      # or "motor": one motor and its load
frame    = "FLU"             # y left, z up, yaw counter-clockwise positive; or "FRD", the paper's
csv      = { delimiter = ",", header = true }     # header = false: columns are numbered from 0

[signals]                    # signal = column, with a unit, and optionally scale, offset, noise_sd, resolution, range
time           = { column = "t_s", unit = "s" }
voltage_left   = { column = "v_left_V", unit = "V" }
voltage_right  = { column = "v_right_V", unit = "V" }
accel_surge    = { column = "a_surge_mps2", unit = "m/s^2", noise_sd = 0.025, resolution = 0.0383, range = [-19.62, 19.62] }
accel_sway     = { column = "a_sway_mps2", unit = "m/s^2", noise_sd = 0.025 }
yaw_rate       = { column = "yaw_rate_radps", unit = "rad/s", noise_sd = 0.014 }

[nominal]                    # what the experimenter knows; a value, or {value, sd}; what is absent is fitted
mass = 0.6                   # kg
yaw_inertia = 0.002          # kg m^2
wheel_radius = { value = 0.028, sd = 0.0003 }
half_track = 0.07            # m
wheel_inertia = 5e-4         # kg m^2 per side, rotor included, at the wheel
resistance = 22.0            # ohm
inductance = 0.01            # H
torque_constant = 0.25       # N m/A at the wheel
emf_constant = 0.25          # V s/rad at the wheel
viscous_friction = 1e-4      # N m s/rad per side
rolling_friction = 0.015     # s/m, sigma of the paper's eq. 13
battery_voltage = 9.0        # V

[nominal.effects]            # what the experimenter's model already contains
gyro_bias = { bias = { value = 0.0, sd = 0.02 } }
imu_lever_arm = { x = 0.02, y = 0.0 }

[[runs]]
name = "straight_half"
file = "straight_half.csv"
role = "fit"                 # or "held_out"; absent: the program chooses, and says so
"""  # noqa: E501
EXAMPLE_CSV = """\
t_s,v_left_V,v_right_V,a_surge_mps2,a_sway_mps2,yaw_rate_radps
0,4.5,4.5,1,2,3
0.003,,4.5,,2,-3
"""


def write_set(folder: Path, signals: str, rows: str, *, top: str = "", nominal: str = "", run: str = "") -> Path:
    """Writes a data set with one run "r"; returns its folder. `top`: vehicle and frame, if not a diff_drive in FRD."""
    top = top or 'vehicle = "diff_drive"\nframe = "FRD"'
    toml = (
        f'name = "s"\n{top}\n[signals]\n{signals}\n[nominal]\n{nominal}\n[[runs]]\nname = "r"\nfile = "r.csv"\n{run}\n'
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(toml, encoding="utf-8")
    (folder / "r.csv").write_text(rows, encoding="utf-8")
    return folder


def drive(inputs: str) -> str:
    """Returns the rows of [signals]: time, yaw rate and `inputs`, such as "voltage_left voltage_right", in SI units."""
    names = ["time", *inputs.split(), "yaw_rate"]
    return "\n".join(f'{name} = {{ column = "{name}", unit = "{SIGNALS[name].unit}" }}' for name in names)


MOTOR = 'vehicle = "motor"'
MOTOR_SIGNALS = """\
time = { column = "t", unit = "s" }
duty = { column = "d", unit = "1" }
speed = { column = "w", unit = "rpm" }"""


def test_the_documented_example_works_as_it_stands(tmp_path: Path) -> None:
    (tmp_path / "dataset.toml").write_text(EXAMPLE, encoding="utf-8")
    (tmp_path / "straight_half.csv").write_text(EXAMPLE_CSV, encoding="utf-8")
    dataset = read(tmp_path)
    run = dataset.runs[0]
    assert (dataset.name, dataset.vehicle, dataset.frame, run.role) == ("bench-7", "diff_drive", "FLU", "fit")
    assert dataset.nominal["mass"].value == 0.6
    assert dataset.nominal["mass"].sd is None
    assert (dataset.nominal["wheel_radius"].value, dataset.nominal["wheel_radius"].sd) == (0.028, 0.0003)
    assert dataset.nominal_effects["gyro_bias"]["bias"].sd == 0.02
    assert dataset.nominal_effects["imu_lever_arm"]["x"].value == 0.02
    np.testing.assert_array_equal(run.outputs["yaw_rate"], [-3.0, 3.0])
    np.testing.assert_array_equal(run.outputs["accel_sway"], [-2.0, -2.0])
    np.testing.assert_array_equal(run.outputs["accel_surge"], [1.0, math.nan])
    np.testing.assert_array_equal(motor_inputs(run, dataset), [[4.5, 4.5], [math.nan, 4.5]])


def test_the_effects_of_the_documented_example_are_simulated(tmp_path: Path) -> None:
    (tmp_path / "dataset.toml").write_text(EXAMPLE, encoding="utf-8")
    (tmp_path / "straight_half.csv").write_text(EXAMPLE_CSV, encoding="utf-8")
    chosen = plan(read(tmp_path))
    assert chosen.model.effects == {"gyro_bias": {"bias": 0.0}, "imu_lever_arm": {"x": 0.02, "y": 0.0}}
    assert [free.name for free in chosen.free if free.effect] == ["gyro_bias.bias"]


def test_the_folder_and_its_toml_name_the_same_data_set(tmp_path: Path) -> None:
    folder = write_good(tmp_path)
    assert read(folder).name == read(str(folder / "dataset.toml")).name == "bench-7"


@pytest.mark.parametrize("signal", sorted(SIGNALS))
def test_only_sideways_and_yaw_signals_turn_with_the_frame(signal: str) -> None:
    values = np.array([1.0, -2.0])
    sign = -1.0 if signal in {"accel_sway", "yaw_rate", "yaw_angle", "reference_yaw_rate"} else 1.0
    np.testing.assert_array_equal(to_frd(signal, values, "FLU"), sign * values)
    np.testing.assert_array_equal(to_frd(signal, values, "FRD"), values)


def test_the_range_of_a_signal_turns_with_its_values(tmp_path: Path) -> None:
    signals = drive("voltage_left voltage_right").replace(
        'column = "yaw_rate", unit = "rad/s"',
        'column = "yaw_rate", unit = "deg/s", range = [-90, 180], noise_sd = 18, resolution = 36',
    )
    rows = "time,voltage_left,voltage_right,yaw_rate\n0,1,1,90\n1,1,1,90\n"
    dataset = read(write_set(tmp_path, signals, rows, top='vehicle = "diff_drive"\nframe = "FLU"'))
    signal = dataset.signals["yaw_rate"]
    assert signal.range == pytest.approx((-math.pi, math.pi / 2))
    assert signal.noise_sd == pytest.approx(math.pi / 10)
    assert signal.resolution == pytest.approx(math.pi / 5)
    np.testing.assert_allclose(dataset.runs[0].outputs["yaw_rate"], -math.pi / 2)


def test_a_frame_that_matters_but_is_not_stated_is_said(tmp_path: Path) -> None:
    rows = "time,voltage_left,voltage_right,yaw_rate\n0,1,1,1\n1,1,1,1\n"
    dataset = read(write_set(tmp_path, drive("voltage_left voltage_right"), rows, top='vehicle = "diff_drive"'))
    assert dataset.frame == "FRD"
    assert any("frame" in note for note in dataset.notes)


@pytest.mark.parametrize(
    ("unit", "si_unit", "factor"),
    [
        ("1", "1", 1.0), ("%", "1", 0.01), ("percent", "1", 0.01),
        ("s", "s", 1.0), ("ms", "s", 1e-3), ("us", "s", 1e-6), ("µs", "s", 1e-6), ("min", "s", 60.0),
        ("rad", "rad", 1.0), ("deg", "rad", math.pi / 180), ("mrad", "rad", 1e-3), ("rotation", "rad", 2 * math.pi),
        ("deg/s", "rad/s", math.pi / 180), ("°/s", "rad/s", math.pi / 180), ("rpm", "rad/s", math.pi / 30),
        ("rotation/s", "rad/s", 2 * math.pi), ("revolution/min", "rad/s", math.pi / 30),
        ("mm", "m", 1e-3), ("cm", "m", 1e-2), ("in", "m", 0.0254), ("ft", "m", 0.3048),
        ("mm/s", "m/s", 1e-3), ("km/h", "m/s", 1 / 3.6), ("ft/s", "m/s", 0.3048),
        ("m/s^2", "m/s^2", 1.0), ("m/s**2", "m/s^2", 1.0), ("m s^-2", "m/s^2", 1.0), ("g0", "m/s^2", 9.80665),
        ("g_0", "m/s^2", 9.80665), ("mV", "V", 1e-3), ("mA", "A", 1e-3), ("N", "N", 1.0), ("kN", "N", 1e3),
    ],
)  # fmt: skip
def test_units_become_si(unit: str, si_unit: str, factor: float) -> None:
    assert si_factor(unit, si_unit) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "si_unit"),
    [("g", "m/s^2"), ("Hz", "rad/s"), ("1/s", "rad/s"), ("counts", "rad"), ("1", "rad"), ("V", "A"), ("", "1"),
     ("2 m", "m"), ("m^99", "m"), ("(m)", "m"), ("m" * 50, "m"), ("dm//s", "m/s")],
)  # fmt: skip
def test_what_is_no_unit_of_the_signal_is_refused(unit: str, si_unit: str) -> None:
    with pytest.raises(ValueError, match=r"unit|kind"):
        si_factor(unit, si_unit)


def test_a_value_is_scaled_then_offset_then_converted(tmp_path: Path) -> None:
    signals = drive("voltage_left voltage_right").replace(
        '"yaw_rate", unit = "rad/s"', '"raw", unit = "deg/s", scale = 0.5, offset = -10'
    )
    rows = "time,voltage_left,voltage_right,raw\n0,1,1,200\n1,1,1,20\n"
    run = read(write_set(tmp_path, signals, rows)).runs[0]
    np.testing.assert_allclose(run.outputs["yaw_rate"], [math.pi / 2, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("delimiter", "glue"), [(",", ","), (";", ";"), ("\\t", "\t"), ("|", "|"), (" ", "   "), (",", " , ")]
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_files_without_header_and_with_any_delimiter_are_read(
    tmp_path: Path, delimiter: str, glue: str, newline: str
) -> None:
    signals = drive("voltage_left voltage_right")
    for number, name in enumerate(["time", "voltage_left", "voltage_right", "yaw_rate"]):
        signals = signals.replace(f'column = "{name}"', f"column = {number}")
    rows = newline.join(glue.join(row) for row in [["0", "1", "2", "3"], ["1e0", "+4", "-5.", ".6"]]) + newline
    top = f'vehicle = "diff_drive"\nframe = "FRD"\ncsv = {{ delimiter = "{delimiter}", header = false }}'
    write_set(tmp_path, signals, "", top=top)
    (tmp_path / "r.csv").write_bytes(rows.encode())
    run = read(tmp_path).runs[0]
    np.testing.assert_array_equal(run.time, [0.0, 1.0])
    np.testing.assert_array_equal(run.inputs["voltage_right"], [2.0, -5.0])
    np.testing.assert_array_equal(run.outputs["yaw_rate"], [3.0, 0.6])


def test_a_byte_order_mark_quotes_and_unused_text_columns_do_no_harm(tmp_path: Path) -> None:
    rows = '\ufeff"time",voltage_left,voltage_right,remark,yaw_rate\n0,1,1,"a, b",1\n1,1,1,c,1\n'
    run = read(write_set(tmp_path, drive("voltage_left voltage_right"), rows)).runs[0]
    np.testing.assert_array_equal(run.outputs["yaw_rate"], [1.0, 1.0])


def test_irregular_time_is_kept_as_logged(tmp_path: Path) -> None:
    signals = drive("voltage_left voltage_right").replace('"time", unit = "s"', '"time", unit = "ms"')
    rows = "time,voltage_left,voltage_right,yaw_rate\n100,1,1,1\n103,1,1,1\n900,1,1,1\n"
    np.testing.assert_allclose(read(write_set(tmp_path, signals, rows)).runs[0].time, [0.1, 0.103, 0.9])


def test_runs_form_a_sequence_with_gaps(tmp_path: Path) -> None:
    folder = write_good(tmp_path)
    toml = (folder / "dataset.toml").read_text(encoding="utf-8").replace("[signals]", "gap_s = 30\n[signals]")
    toml += 'gap_s = 5\nreplicate_of = "straight"\n'
    (folder / "dataset.toml").write_text(toml, encoding="utf-8")
    dataset = read(folder)
    assert dataset.gap_s == 30.0
    assert [(run.name, run.gap_s, run.replicate_of, run.role) for run in dataset.runs] == [
        ("straight", 30.0, None, "fit"),
        ("spin", 5.0, "straight", None),
    ]


def test_gaps_are_zero_where_nothing_is_said(tmp_path: Path) -> None:
    assert [run.gap_s for run in read(write_good(tmp_path)).runs] == [0.0, 0.0]


def test_a_stated_initial_state_turns_with_the_frame(tmp_path: Path) -> None:
    folder = write_good(tmp_path)
    with (folder / "dataset.toml").open("a", encoding="utf-8") as file:
        file.write("initial = { surge = 0.5, sway = 0.1, yaw_rate = 2, wheel_speed_left = 3 }\n")
    assert read(folder).runs[1].initial == {"surge": 0.5, "sway": -0.1, "yaw_rate": -2.0, "wheel_speed_left": 3.0}


def test_arrays_cannot_be_written_to(tmp_path: Path) -> None:
    run = read(write_good(tmp_path)).runs[0]
    with pytest.raises(ValueError, match="read-only"):
        run.outputs["yaw_rate"][0] = 1.0


def test_duty_is_multiplied_by_the_measured_battery_row_by_row(tmp_path: Path) -> None:
    signals = drive("duty_left duty_right") + '\nbattery_voltage = { column = "b", unit = "mV" }'
    rows = "time,duty_left,duty_right,yaw_rate,b\n0,0.5,-1,0,8000\n1,1,0,0,7000\n2,,0.1,0,\n3,1,1,0,6000\n"
    dataset = read(write_set(tmp_path, signals, rows, nominal="battery_voltage = 12"))
    expected = [[4.0, -8.0], [7.0, 0.0], [math.nan, 0.65], [6.0, 6.0]]
    np.testing.assert_allclose(motor_inputs(dataset.runs[0], dataset), expected)


def test_battery_dropouts_of_single_samples_are_repaired_and_counted(tmp_path: Path) -> None:
    signals = drive("duty_left duty_right") + '\nbattery_voltage = { column = "b", unit = "V" }'
    battery = [8.0, 7.9, 0.0, 7.9, 7.8, 7.8, 60.0, 7.7, 7.7]
    rows = "time,duty_left,duty_right,yaw_rate,b\n" + "".join(f"{k},1,1,0,{volts}\n" for k, volts in enumerate(battery))
    dataset = read(write_set(tmp_path, signals, rows))
    volts = motor_inputs(dataset.runs[0], dataset)[:, 0]
    assert volts.min() > 7.6
    assert volts.max() <= 8.0
    assert volts[0] == 8.0
    assert any(note.startswith("run r: 2 battery readings") for note in dataset.notes)
    assert dataset.runs[0].outputs["battery_voltage"][2] == 0.0


def test_a_long_runs_battery_dropouts_are_faults_and_do_not_reach_the_motors(tmp_path: Path) -> None:
    signals = drive("duty_left duty_right") + '\nbattery_voltage = { column = "b", unit = "V" }'
    battery = [8.0 - 0.01 * (k % 7) for k in range(60)]
    battery[30] = 0.0
    rows = "time,duty_left,duty_right,yaw_rate,b\n" + "".join(f"{k},1,1,0,{volts}\n" for k, volts in enumerate(battery))
    dataset = read(write_set(tmp_path, signals, rows))
    run = dataset.runs[0]
    assert [(fault.signal, fault.kind, fault.from_s) for fault in dataset.faults] == [
        ("battery_voltage", "dropout", 30)
    ]
    assert math.isnan(run.outputs["battery_voltage"][30])
    assert run.raw_outputs["battery_voltage"][30] == 0.0
    assert motor_inputs(run, dataset)[:, 0].min() > 7.9


def test_a_battery_that_steps_down_is_no_dropout(tmp_path: Path) -> None:
    signals = drive("duty_left duty_right") + '\nbattery_voltage = { column = "b", unit = "V" }'
    battery = [12.0, 12.0, 12.0, 6.0, 6.0, 6.0, 6.0]
    rows = "time,duty_left,duty_right,yaw_rate,b\n" + "".join(f"{k},1,1,0,{volts}\n" for k, volts in enumerate(battery))
    dataset = read(write_set(tmp_path, signals, rows))
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset)[:, 0], battery)


def test_duty_falls_back_on_the_nominal_then_on_the_preset_battery(tmp_path: Path) -> None:
    rows = "t,d,w\n0,0.5,60\n1,-0.5,60\n"
    stated = read(write_set(tmp_path / "a", MOTOR_SIGNALS, rows, top=MOTOR, nominal="battery_voltage = 7.2"))
    np.testing.assert_allclose(motor_inputs(stated.runs[0], stated), [[3.6], [-3.6]])
    silent = read(write_set(tmp_path / "b", MOTOR_SIGNALS, rows, top=MOTOR))
    np.testing.assert_allclose(silent.motor_inputs(silent.runs[0]), [[4.5], [-4.5]])
    assert any("9 V" in note for note in silent.notes)
    assert not any("9 V" in note for note in stated.notes)


def test_mean_and_difference_of_duty_give_left_and_right(tmp_path: Path) -> None:
    rows = "time,duty_mean,duty_diff,yaw_rate\n0,0.5,0.2,0\n1,0,-2,0\n"
    dataset = read(write_set(tmp_path, drive("duty_mean duty_diff"), rows, nominal="battery_voltage = 10"))
    np.testing.assert_allclose(motor_inputs(dataset.runs[0], dataset), [[6.0, 4.0], [-10.0, 10.0]])


def test_a_current_loop_takes_its_voltage_as_it_is(tmp_path: Path) -> None:
    signals = MOTOR_SIGNALS.replace('duty = { column = "d", unit = "1" }', 'voltage = { column = "d", unit = "V" }')
    dataset = read(write_set(tmp_path, signals, "t,d,w\n0,2.5,0\n1,,1\n", top=MOTOR, nominal="torque_per_volt = 0.3"))
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset), [[2.5], [math.nan]])


def test_the_preset_battery_is_the_plants() -> None:
    assert {info.name: info.preset for info in catalogue.parameters()}["battery_voltage"] == PRESET_BATTERY_VOLTAGE


def test_units_of_outputs_are_those_of_the_plant() -> None:
    shared = catalogue.outputs().keys() & SIGNALS.keys()
    assert len(shared) >= 10
    for name in shared:
        assert si_factor(catalogue.outputs()[name], SIGNALS[name].unit) == 1.0, name


def measured(name: str) -> Path:
    """Returns a measured data set's folder; skips the test if there is none."""
    root = os.environ.get("BRICKPILOT_DATA")
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = (Path(root) if root else beside) / name
    if not folder.is_dir():
        pytest.skip(f"no measured set {name}: set BRICKPILOT_DATA to the folder that holds it")
    return folder


@pytest.mark.parametrize(
    ("name", "vehicle", "runs", "signal", "low", "high"),
    [
        ("linear_axis", "motor", 2, "position", 0.0, 0.3),
        ("micromouse", "diff_drive", 7, "yaw_rate", -40.0, 40.0),
        ("lego_ev3_motor", "motor", 10, "speed", -20.0, 20.0),
    ],
)
def test_measured_sets_are_read_in_si(name: str, vehicle: str, runs: int, signal: str, low: float, high: float) -> None:
    dataset = read(measured(name))
    assert (dataset.vehicle, len(dataset.runs)) == (vehicle, runs)
    values = np.concatenate([run.raw_outputs[signal] for run in dataset.runs])
    assert low - 0.1 * (high - low) < values.min() < values.max() < high + 0.1 * (high - low)
    assert np.ptp(values) > 0.2 * (high - low)
    for run in dataset.runs:
        assert motor_inputs(run, dataset).shape == (run.time.size, 2 if vehicle == "diff_drive" else 1)


def test_the_micromouse_turns_clockwise_when_its_left_wheel_leads() -> None:
    dataset = read(measured("micromouse"))
    run = next(run for run in dataset.runs if run.name == "r0_6")
    lead = run.outputs["wheel_travel_left"] - run.outputs["wheel_travel_right"]
    turned = np.concatenate([[0.0], np.cumsum(run.outputs["yaw_rate"][:-1] * np.diff(run.time))])
    assert np.corrcoef(lead, turned)[0, 1] > 0.95
