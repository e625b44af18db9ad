"""hal/rcx on the simulator of the RCX's processor, beside brickOS's own kernel; and the program that is built of it."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PORT = ROOT / "hal/rcx"
CONFIGURATIONS = ["imu", "rotation"]
# What the simulator, or the brick, cannot show: hal/rcx/README.md says the same.
CANNOT = {
    "imu": {"test_a_device_that_is_not_there_is_absent"},
    "rotation": {"test_a_device_that_is_not_there_is_absent", "test_a_silent_device_is_stale_and_recovers"},
}


def run(name: str, sensors: str, *port: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "tests/rcx/run", name, sensors, *port], capture_output=True, text=True, timeout=600, check=False
    )


@pytest.mark.parametrize("sensors", CONFIGURATIONS)
def test_the_contract_of_every_port_holds(sensors: str) -> None:
    done = run("contract", sensors)
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(re.findall(r"^(\w+): SKIP: ", done.stdout, re.MULTILINE)) == CANNOT[sensors]
    assert done.stdout.count(": PASS\n") == 9 - len(CANNOT[sensors])


@pytest.mark.parametrize("sensors", CONFIGURATIONS)
def test_the_drivers_do_what_they_promise(sensors: str) -> None:
    done = run("port", sensors)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(": PASS\n") == {"imu": 15, "rotation": 14}[sensors]
    room = re.search(r"^largest block (\d+)$", done.stdout, re.MULTILINE)
    assumed = re.search(r"^HEAP=(\d+)$", (PORT / "build").read_text(), re.MULTILINE)
    assert room is not None
    assert assumed is not None
    assert room[1] == assumed[1], "what the kernel leaves a program"


@pytest.mark.parametrize(
    ("name", "file", "of", "to"),
    [
        ("contract", "motors.c", "? fwd : rev", "? rev : fwd"),
        ("contract", "sensors.c", "BATTERY_OVER = 77", "BATTERY_OVER = 78"),
        ("port", "infrared.c", "heard && packet", "false && packet"),
        ("port", "infrared.c", "size < INFRARED_HEAD ||", ""),
    ],
)
def test_a_wrong_driver_is_caught(tmp_path: Path, name: str, file: str, of: str, to: str) -> None:
    shutil.copytree(PORT, tmp_path / "rcx")
    text = (PORT / file).read_text()
    assert of in text
    (tmp_path / "rcx" / file).write_text(text.replace(of, to))
    done = run(name, "imu", str(tmp_path / "rcx"))
    assert done.returncode == 1, done.stdout + done.stderr
    assert ": FAIL: line " in done.stdout


def test_board_has_the_scales_of_the_model() -> None:
    imu = tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text())["sensors"]["imu"]
    board = (PORT / "board.h").read_text()
    for axis, full in (("GYRO", "gyro_range"), ("SURGE", "accel_range"), ("SWAY", "accel_range")):
        found = re.search(rf"BOARD_{axis} = {{(\d+), (\d+), (\d+), false}}", board)
        assert found is not None, axis
        zero, whole, part = map(int, found.groups())
        assert zero == 2 ** imu["bits"]["value"] / 2
        assert 1000 * imu[full]["value"] / zero == pytest.approx(whole + part / 256, abs=1 / 256)


def test_the_program_flies_the_scenario_mission() -> None:
    scenario = tomllib.loads((ROOT / "sim_host/run/scenarios/mission.toml").read_text())
    table = re.search(r"MISSION\[\] = \{(.*?)\};", (PORT / "main.c").read_text(), re.DOTALL)
    assert table is not None
    flown = [[int(x) / 1000, int(y) / 1000] for x, y in re.findall(r"\{(-?\d+), +(-?\d+)\}", table[1])]
    assert flown == scenario["waypoints_m"]


@pytest.mark.xfail(strict=True, reason="the firmware is too large yet")
@pytest.mark.parametrize("sensors", CONFIGURATIONS)
def test_the_program_fits_and_is_whole(tmp_path: Path, sensors: str) -> None:
    built = subprocess.run([PORT / "build", tmp_path, sensors], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    program = (tmp_path / "brickpilot.lx").read_bytes()
    # brickOS's header, big-endian: "brickOS\0", version, base, sizes of text, data, bss and stack, offset, relocations.
    assert program[:8] == b"brickOS\0"
    version, base, text, data, bss, stack, _, relocations = (
        int.from_bytes(program[at : at + 2], "big") for at in range(8, 24, 2)
    )
    assert (version, base, stack) == (0, 0xB000, 768)
    assert len(program) == 24 + text + data + 2 * relocations
    linked = re.search(r"^linked +(\d+) +(\d+) +(\d+)$", (tmp_path / "size.txt").read_text(), re.MULTILINE)
    assert linked is not None
    assert [text, data, bss] == [int(size) for size in linked.groups()]
    image = (tmp_path / "brickpilot.srec").read_text()
    assert image.splitlines()[1][:8] == "S1" + image.splitlines()[1][2:4] + "B000"


def test_sensors_of_another_kind_are_refused(tmp_path: Path) -> None:
    built = subprocess.run([PORT / "build", tmp_path, "sonar"], capture_output=True, text=True, check=False)
    assert built.returncode == 1
    assert built.stderr == 'rcx: RCX_SENSORS is imu or rotation, not "sonar"\n'
