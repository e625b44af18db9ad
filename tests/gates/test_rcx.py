"""The RCX's port and programs build, and work with brickOS's own kernel on a simulator of the RCX's processor."""

from __future__ import annotations

import os
import re
import select
import shutil
import subprocess
import threading
import tomllib
import tty
from dataclasses import replace
from pathlib import Path

import h8_stack
import pytest
from brickpilot.data import reading
from brickpilot.errors import InputError
from brickpilot.importers import rcx
from brickpilot.importers.writer import write
from brickpilot.link import lnp
from stack_walk import REQUESTS

ROOT = Path(__file__).resolve().parents[2]
PORT = ROOT / "hal/rcx"
TARGET = ROOT / "firmware/targets/rcx"
CONFIGURATIONS = ["imu", "rotation"]
# Skipped contract tests, whose case the simulator or the brick cannot show; hal/rcx/README.md lists the same tests.
CANNOT = {
    "imu": {"test_a_device_that_is_not_there_is_absent"},
    "rotation": {"test_a_device_that_is_not_there_is_absent", "test_a_silent_device_is_stale_and_recovers"},
}


BYTE_S = 0.0005  # time for each byte, s: a pseudo-terminal has no baud rate
STACK, RECORDER_STACK = 344, 256
SPARE = 300  # least number of bytes that stay free in the memory for programs


def run(name: str, sensors: str, *folders: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "tests/rcx/run", name, sensors, *folders], capture_output=True, text=True, timeout=600, check=False
    )


@pytest.fixture(scope="module", params=CONFIGURATIONS)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Returns the sensors, and the folder with both programs built for these sensors."""
    folder = tmp_path_factory.mktemp(request.param)
    done = subprocess.run([TARGET / "build", folder, request.param], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return request.param, folder


def autopilot(folder: Path) -> h8_stack.H8:
    return h8_stack.H8(folder / "brickpilot.coff", h8_stack.kernel(), REQUESTS)


class Tower:
    """An infrared tower on a pseudo-terminal. Its brick gives stored answers, of which some get lost or damaged."""

    def __init__(self, packets: dict[bytes, bytes]) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port = Path(os.ttyname(slave))
        self.packets, self.asked, self.running = packets, 0, True
        self.thread = threading.Thread(target=self._answer)
        self.thread.start()

    def _answer(self) -> None:
        heard = b""
        while self.running:
            if not select.select([self.master], [], [], 0.05)[0]:
                continue
            received = os.read(self.master, 256)
            os.write(self.master, received)  # a tower echoes all bytes
            heard += received
            request = lnp.find(heard, lnp.BRICK, lnp.HOST)
            if request is not None:
                heard = b""
                self.asked += 1
                answer = bytearray(self.packets[request])
                if self.asked % 20 == 3:
                    continue
                if self.asked % 20 == 13:
                    answer[-3] ^= 0x10
                os.write(self.master, answer)

    def close(self) -> None:
        self.running = False
        self.thread.join()
        os.close(self.master)


@pytest.mark.parametrize("sensors", CONFIGURATIONS)
def test_a_recording_comes_back_as_a_data_set(tmp_path: Path, sensors: str) -> None:
    done = run("recorder", sensors)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [bytes.fromhex(line) for line in done.stdout.splitlines() if line.startswith("f1")]
    tower = Tower({line[4:6]: line for line in lines})
    try:
        new = replace(rcx.import_rcx([tower.port], byte_s=BYTE_S), nominal={"mass": 0.9})
        made = write(new, tmp_path / "bench", tower.port)
    finally:
        tower.close()
    assert tower.asked > 86 + 4, "nothing got lost"
    assert made.runs == ("forward", "backward", "spin", "turn")
    read = reading.read(tmp_path / "bench")
    assert [len(run.time) for run in read.runs] == [500, 400, 400, 400]
    columns = {run.name: {**run.inputs, **run.raw_outputs} for run in read.runs}
    duty = columns["backward"]["duty_left"]
    assert (duty[:300] == -0.5).all()
    assert (duty[300:] == 0).all()
    # The simulated sensors follow the motors 0.1 s later: half of full power gives 64 counts.
    assert columns["spin"]["yaw_rate"][150] == pytest.approx(64 * 10.47 / 512, rel=1e-3)
    assert columns["forward"]["yaw_rate"][250] == 0
    assert columns["spin"]["battery_voltage"][0] == pytest.approx(8.995, abs=0.001)
    if sensors == "imu":
        assert columns["forward"]["accel_surge"][250] == pytest.approx(64 * 19.62 / 512, rel=1e-3)
        assert columns["backward"]["accel_surge"][150] == pytest.approx(-64 * 19.62 / 512, rel=1e-3)


def test_a_port_without_a_tower_is_refused(tmp_path: Path) -> None:
    tower = Tower({})
    tower.running = False
    tower.thread.join()
    try:
        with pytest.raises(InputError, match="no tower: nothing echoes"):
            rcx.import_rcx([tower.port], byte_s=BYTE_S)
    finally:
        os.close(tower.master)


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
    assert done.stdout.count(": PASS\n") == 15
    room = re.search(r"^largest block (\d+)$", done.stdout, re.MULTILINE)
    assumed = re.search(r"^HEAP=(\d+)$", (TARGET / "build").read_text(), re.MULTILINE)
    assert room is not None
    assert assumed is not None
    assert room[1] == assumed[1], "what the kernel leaves a program"


def test_the_program_does_what_the_recipe_says(built: tuple[str, Path]) -> None:
    sensors, folder = built
    done = run("program", sensors)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(": PASS\n") == 8
    assert f"STACK = {STACK}," in (ROOT / "tests/rcx/test_program.c").read_text(), "the stack that was tried"
    taken = re.search(r"^stack (\d+)$", done.stdout, re.MULTILINE)
    assert taken is not None
    assert 100 < int(taken[1]) <= h8_stack.bounds(autopilot(folder), ("main",))["main"].all


def test_no_path_through_a_task_takes_more_than_its_stack(built: tuple[str, Path]) -> None:
    _, folder = built
    bounds = h8_stack.bounds(autopilot(folder), ("main", "send"))
    sender = re.search(r"INFRARED_STACK = (\d+)", (PORT / "infrared.h").read_text())
    assert sender is not None
    assert bounds["main"].all <= STACK
    assert bounds["send"].all <= int(sender[1])
    recorder = h8_stack.H8(folder / "recorder.coff", h8_stack.kernel(), {})
    assert h8_stack.bounds(recorder, ("main",))["main"].all <= RECORDER_STACK


@pytest.mark.parametrize(
    ("name", "file", "of", "to"),
    [
        ("contract", "motors.c", "? fwd : rev", "? rev : fwd"),
        ("contract", "sensors.c", "BATTERY_OVER = 77", "BATTERY_OVER = 78"),
        ("port", "infrared.c", "sequence_and_256 == newest", "false"),
        ("port", "infrared.c", "size != INFRARED_PACKET", "size > INFRARED_PACKET"),
        ("program", "main.c", "if (!state.started)", "if (false)"),
        ("program", "main.c", "state.until_telemetry = state.until_heartbeat = 1;", ""),
        ("program", "infrared.c", "replies = reply_is == DUE", "replies = false"),
    ],
)
def test_a_wrong_driver_is_caught(tmp_path: Path, name: str, file: str, of: str, to: str) -> None:
    port, target = tmp_path / "port", tmp_path / "target"
    shutil.copytree(PORT, port)
    shutil.copytree(TARGET, target)
    path = next(folder / file for folder in (port, target) if (folder / file).exists())
    text = path.read_text()
    assert of in text
    path.write_text(text.replace(of, to))
    done = run(name, "imu", port, target)
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
    table = re.search(r"MISSION\[\] = \{(.*?)\};", (ROOT / "firmware/app/mission.h").read_text(), re.DOTALL)
    assert table is not None
    flown = [[int(x) / 1000, int(y) / 1000] for x, y in re.findall(r"\{(-?\d+), +(-?\d+)\}", table[1])]
    assert flown == scenario["waypoints_m"]


def is_whole(folder: Path, name: str, own_stack: int) -> None:
    """Asserts that the program has brickOS's format, and the size that the report of its build states."""
    program = (folder / f"{name}.lx").read_bytes()
    # brickOS's header, big-endian: "brickOS\0", version, base, sizes of text, data, bss and stack, offset, relocations.
    assert program[:8] == b"brickOS\0"
    version, base, text, data, bss, stack, _, relocations = (
        int.from_bytes(program[at : at + 2], "big") for at in range(8, 24, 2)
    )
    assert (version, base, stack) == (0, 0xB000, own_stack)
    assert len(program) == 24 + text + data + 2 * relocations
    linked = re.search(r"^linked +(\d+) +(\d+) +(\d+)$", (folder / f"{name}.txt").read_text(), re.MULTILINE)
    assert linked is not None
    assert [text, data, bss] == [int(size) for size in linked.groups()]
    image = (folder / f"{name}.srec").read_text()
    assert image.splitlines()[1][:8] == "S1" + image.splitlines()[1][2:4] + "B000"


def test_both_programs_fit_and_are_whole(built: tuple[str, Path]) -> None:
    _, folder = built
    is_whole(folder, "recorder", RECORDER_STACK)
    is_whole(folder, "brickpilot", STACK)


def test_the_autopilot_asks_for_no_sensor_that_is_never_there(built: tuple[str, Path]) -> None:
    sensors, folder = built
    loop = folder / "brickpilot-objects/firmware_app_loop.o"
    asked = subprocess.run(["h8300-hms-nm", "-u", loop], capture_output=True, text=True, check=True).stdout
    wanted = {"imu", "battery"} | ({"rotation"} & {sensors})
    assert set(re.findall(r"_hal_(\w+)_read", asked)) == wanted


def test_the_autopilot_leaves_room_in_the_bricks_memory(built: tuple[str, Path]) -> None:
    told = (built[1] / "brickpilot.txt").read_text()
    left = re.search(r"^program .*, of 14626: (\d+) bytes left$", told, re.MULTILINE)
    assert left is not None, "it does not fit"
    assert int(left[1]) >= SPARE


def test_sensors_of_another_kind_are_refused(tmp_path: Path) -> None:
    built = subprocess.run([TARGET / "build", tmp_path, "sonar"], capture_output=True, text=True, check=False)
    assert built.returncode == 1
    assert built.stderr == 'rcx: sensors are imu or rotation, not "sonar"\n'
