"""`--guess` assigns columns to signals by name and range, says why, and leaves out columns that it cannot assign."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers.guess import Taken, column_of, taken_for
from command import brickpilot
from importing import import_table
from numpy.typing import NDArray
from serial_logs import COUNTS, HEADER, driven, lines_of, write_log

Vector = NDArray[np.float64]


def test_the_commonest_log_is_guessed_in_one_command(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(driven())])
    done = brickpilot("import", "log.csv", "--guess", "--split", "rests", "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    dataset = read(tmp_path / "set")
    assert (dataset.vehicle, dataset.frame, len(dataset.runs)) == ("diff_drive", "FLU", 4)
    log, run = driven(), dataset.runs[1]
    rows = np.searchsorted(log[:, 0] / 1000, run.time - 1e-9)
    np.testing.assert_allclose(run.inputs["duty_right"], log[rows, 2] / 255)
    np.testing.assert_allclose(run.raw_outputs["wheel_angle_left"], log[rows, 3] / COUNTS * 2 * np.pi)
    np.testing.assert_allclose(run.raw_outputs["yaw_rate"], -np.radians(log[rows, 5]))
    assert "960 IS A GUESS for encL and encR" in done.stdout
    assert "gx is left out" in done.stdout
    text = (tmp_path / "set/dataset.toml").read_text()
    assert "# its name; values up to 200, so full drive is taken as 255" in text
    assert "960 IS A GUESS" in text
    assert set(tomlkit.parse(text)["signals"]) == {  # type: ignore[arg-type]
        "time", "duty_left", "duty_right", "wheel_angle_left", "wheel_angle_right", "yaw_rate",
    }  # fmt: skip


def test_what_a_map_states_stands(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", [HEADER, *lines_of(driven())])
    maps = ["wheel_angle_left=encL/1440:rotation", "wheel_angle_right=encR/1440:rotation"]
    made = import_table([log], tmp_path / "set", maps, guessed=True)
    dataset = read(made.folder)
    assert dataset.signals["wheel_angle_left"].scale == 1 / 1440
    assert "duty_left" in dataset.signals
    assert not any("counts a turn has" in note for note in made.notes)


def test_a_unit_of_another_kind_leaves_the_column_out(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", [HEADER.replace("gz", "yaw [V]"), *lines_of(driven())])
    made = import_table([log], tmp_path / "set", guessed=True)
    assert any("yaw [V] is left out: it looks like yaw_angle, but 'V' is of another kind" in one for one in made.notes)


@pytest.mark.parametrize("entry", ["enc_left/960", "wheel_angle_left=enc_left/960:rotation", "yaw_rate=gzz"])
def test_a_typo_in_a_map_beside_a_guess_is_one_line(tmp_path: Path, entry: str) -> None:
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(driven())])
    done = brickpilot("import", "log.csv", "--guess", "--map", entry, "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "did you mean" in done.stderr or entry in done.stderr


def test_one_number_is_full_drive_of_both_sides_and_is_said_to_be_a_guess(tmp_path: Path) -> None:
    log = driven()
    log[:, 1:3] = np.round(log[:, 1:3] * [265 / 200, 240 / 200])
    made = import_table([write_log(tmp_path / "log.csv", [HEADER, *lines_of(log)])], tmp_path / "set", guessed=True)
    signals = read(made.folder).signals
    assert signals["duty_left"].scale == signals["duty_right"].scale == 1 / 1000
    assert any("NOBODY SAID which number is full drive: 1000 IS A GUESS for pwmL and pwmR" in one for one in made.notes)


@pytest.mark.parametrize(
    ("drive", "look", "formula"),
    [
        (lambda pwm: 1500 + 2 * pwm, "look like servo pulses of 1000 to 2000 us with 1500 at rest", "({}-1500)/500"),
        (
            lambda pwm: np.where(np.arange(len(pwm))[:, np.newaxis] < 9, 0, 1500 + pwm),
            "look like servo",
            "({}-1500)/500",
        ),
        (lambda pwm: 2 * pwm, "go up to 400, which is 400 of some drivers or 1000 of others", "{}/400"),
        (lambda pwm: np.round(1.6 * pwm), "go up to 320, which is 400 of some drivers or 1000 of others", "{}/400"),
    ],
)
def test_drives_of_an_odd_scale_are_asked_about(
    drive: Callable[[Vector], Vector], look: str, formula: str, tmp_path: Path
) -> None:
    log = driven()
    log[:, 1:3] = drive(log[:, 1:3])
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(log)])
    words = ["import", "log.csv", "--guess", "--out", "set"]
    asked = brickpilot(*words, cwd=tmp_path)
    maps = [f"duty_{side}={formula.format(f'pwm{side[0].upper()}')}" for side in ("left", "right")]
    assert (asked.returncode, asked.stderr.count("\n")) == (2, 1)
    assert f"pwmL and pwmR {look}" in asked.stderr
    assert f"state it, as --map '{maps[0]}' --map '{maps[1]}'" in asked.stderr
    told = brickpilot(*words, "--map", maps[0], "--map", maps[1], cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    assert "full drive" not in told.stdout
    duty = read(tmp_path / "set").runs[0].inputs["duty_left"]
    assert 0.3 < np.abs(duty[9:]).max() <= 1.0


def test_a_duty_of_4095_is_still_one(tmp_path: Path) -> None:
    log = driven()
    log[:, 1:3] = np.round(log[:, 1:3] * 10)
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(log)])
    made = import_table([tmp_path / "log.csv"], tmp_path / "set", guessed=True)
    assert read(made.folder).signals["duty_left"].scale == 1 / 4095


def test_the_frame_follows_the_wheels(tmp_path: Path) -> None:
    turned = driven() * [1, 1, 1, 1, 1, -1]
    log = write_log(tmp_path / "log.csv", [HEADER, *lines_of(turned)])
    assert read(import_table([log], tmp_path / "set", guessed=True).folder).frame == "FRD"


RISING = np.arange(100) * 20.0
WAVE = 200 * np.sin(RISING / 300)


@pytest.mark.parametrize(
    ("name", "values", "taken"),
    [
        ("t", RISING / 1000, ("time", "t", "s")),
        ("time_us", RISING * 1000, ("time", "time_us", "us")),
        ("micros", RISING, ("time", "micros", "us")),
        ("Time [s]", RISING, ("time", "Time [s]", "s")),
        ("timestamp", RISING, ("time", "timestamp", "ms")),
        ("pwmL", np.round(WAVE), ("duty_left", "pwmL/255", "1")),
        ("left_pwm", np.round(WAVE / 3), ("duty_left", "left_pwm/255", "1")),
        ("PWM_RIGHT", np.round(WAVE * 5), ("duty_right", "PWM_RIGHT/1000", "1")),
        ("motorR", WAVE / 250, ("duty_right", "motorR", "1")),
        ("duty", WAVE / 2, ("duty", "duty/100", "1")),
        ("v_left", WAVE / 40, ("voltage_left", "v_left", "V")),
        ("leftVoltage", WAVE * 40 // 1, ("voltage_left", "leftVoltage", "mV")),
        ("encL", RISING, ("wheel_angle_left", "encL/960", "rotation")),
        ("rightEncoder", RISING, ("wheel_angle_right", "rightEncoder/960", "rotation")),
        ("ticks", RISING, ("angle", "ticks/960", "rotation")),
        ("gz", WAVE, ("yaw_rate", "gz", "deg/s")),
        ("gyro_z", WAVE / 100, ("yaw_rate", "gyro_z", "rad/s")),
        ("gyroZ", np.round(WAVE * 100), ("yaw_rate", "gyroZ/131", "deg/s")),
        ("yaw_rate_dps", WAVE / 100, ("yaw_rate", "yaw_rate_dps", "deg/s")),
        ("yaw", WAVE, ("yaw_angle", "yaw", "deg")),
        ("yaw_dps", WAVE, ("yaw_rate", "yaw_dps", "deg/s")),
        ("heading_rpm", WAVE, ("yaw_rate", "heading_rpm", "rpm")),
        ("battery", np.full(100, 7.4), ("battery_voltage", "battery", "V")),
        ("vbat_mV", np.full(100, 7400.0), ("battery_voltage", "vbat_mV", "mV")),
        ("rpmL", WAVE, None),
        ("speed_left [rpm]", WAVE, ("wheel_speed_left", "speed_left [rpm]", "rpm")),
        ("vel_right_m_s", WAVE / 100, ("wheel_velocity_right", "vel_right_m_s", "m/s")),
        ("travel_left_m", RISING / 1000, ("wheel_travel_left", "travel_left_m", "m")),
        ("accel_surge_mps2", WAVE / 100, ("accel_surge", "accel_surge_mps2", "m/s^2")),
        ("speed", WAVE, None),
        ("battery", np.full(100, 612.0), None),
        ("gx", WAVE, None),
        ("state", np.full(100, np.nan), None),
        ("t", WAVE, None),
        ("ax", WAVE, None),
    ],
)
def test_a_column_is_taken_by_name_and_range(name: str, values: np.ndarray, taken: tuple[str, ...] | None) -> None:
    column = column_of(name, values)
    found = taken_for(column, [column], driven=False)
    if taken is None:
        assert isinstance(found, str)
    else:
        assert isinstance(found, Taken), found
        assert (found.signal, found.formula, found.unit) == taken
        assert found.reason


def test_the_upright_axis_tells_the_unit_of_an_accelerometer() -> None:
    for gravity, formula, unit in ((1.0, "ax", "g0"), (9.81, "ax", "m/s^2"), (16400.0, "ax/16384", "g0")):
        columns = [column_of("ax", WAVE), column_of("az", np.full(100, gravity))]
        found = taken_for(columns[0], columns, driven=True)
        assert isinstance(found, Taken)
        assert (found.signal, found.formula, found.unit) == ("accel_surge", formula, unit)


def test_a_motor_is_guessed_where_no_column_has_a_side(tmp_path: Path) -> None:
    rows = [f"{k * 0.01},{50 if k > 20 else 0},{max(0, k - 20) * 7},4" for k in range(100)]
    log = write_log(tmp_path / "log.csv", ["t,pwm,enc,mystery", *rows])
    made = import_table([log], tmp_path / "set", guessed=True)
    dataset = read(made.folder)
    assert (dataset.vehicle, set(dataset.signals)) == ("motor", {"time", "duty", "angle"})
    assert any("mystery is left out" in note for note in made.notes)


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("x,pwmL,pwmR,encL", r"log\.csv:1: --guess: finds no time among x, pwmL, pwmR, encL; add --map time=COLUMN:ms"),
        ("t,pwmL,b,encL", r"log\.csv:1: --guess: finds no complete input among"),
        ("t,pwmL,pwmR,b", r"log\.csv:1: --guess: finds no complete output among"),
        ("0,1,2,3", r"log\.csv: --guess: needs a header"),
    ],
)
def test_what_cannot_be_guessed_is_named(tmp_path: Path, header: str, says: str) -> None:
    log = write_log(tmp_path / "log.csv", [header, *(f"{k},{k % 7},{k % 5},{k}" for k in range(1, 50))])
    with pytest.raises(InputError, match=says):
        import_table([log], tmp_path / "set", guessed=True)
    assert not (tmp_path / "set").exists()


def test_without_a_vehicle_or_a_guess_the_option_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(driven())])
    done = brickpilot("import", "table", "log.csv", "--map", "time=millis", "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "brickpilot: --vehicle: is needed to import table\n")


def test_only_a_kind_that_guesses_may_be_told_to(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(b"")
    done = brickpilot("import", "matlab", "a.mat", "--vehicle", "motor", "--guess", "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("brickpilot: --guess: works only with table")
    done = brickpilot("import", "matlab", "a.mat", "--out", "set", cwd=tmp_path)
    assert done.stderr == "brickpilot: --vehicle: is needed to import matlab\n"


@pytest.mark.parametrize(
    ("name", "signal", "unit"),
    [
        ("/cmd_vel/linear/x", "reference_velocity", "m/s"),
        ("cmd_vel.angular.z", "reference_yaw_rate", "rad/s"),
        ("target_vel_left [rad/s]", "reference_wheel_speed_left", "rad/s"),
        ("setpoint speed [rpm]", "reference_speed", "rpm"),
        ("desired_yaw_rate [deg/s]", "reference_yaw_rate", "deg/s"),
    ],
)
def test_a_demand_to_a_controller_is_a_set_point(name: str, signal: str, unit: str) -> None:
    column = column_of(name, np.array([0.0, 0.4, 0.4]))
    found = taken_for(column, [column], driven=False)
    assert isinstance(found, Taken)
    assert (found.signal, found.unit) == (signal, unit)


@pytest.mark.parametrize("name", ["/cmd_vel/linear/y", "/cmd_vel/angular/x", "target speed"])
def test_a_demand_that_no_vehicle_follows_or_without_a_unit_is_left_out(name: str) -> None:
    column = column_of(name, np.array([0.0, 0.4, 0.4]))
    assert isinstance(taken_for(column, [column], driven=False), str)
