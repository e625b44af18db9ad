"""The boards for which firmware is built: the scripts and flags of each build, and the image's sizes.

When an image is built for a user's robot, the robot's own headers replace the project's. The closed loop is one library
for this machine: the plant and the robot's own firmware. It flies 50 to 100 times as fast as the firmware behind a link
(`simulate.fly_own`), with the same motor commands. So a robot's gains can be tuned over many flights.
"""

from __future__ import annotations

import atexit
import math
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from brickpilot import compiled
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError, WorkFailedError
from brickpilot.firmware import params_header
from brickpilot.firmware.robot import Robot
from brickpilot.hil.checkout import sources
from brickpilot.text_template import render_text
from brickpilot.vehicle.compensation import HIGHEST_BATTERY, HIGHEST_OWN
from brickpilot.vehicle.fixed_point import comment
from brickpilot.vehicle.scenario import Scenario
from brickpilot.vehicle.settings import plain

Figures = dict[str, int]


@dataclass(frozen=True)
class Board:
    """A board.

    Attributes:
        name: the board's name in `--board`.
        sensors: the sensors of a flight -> the arguments of the scripts `flags` and `build` for these sensors.
        flags: the script that prints the compiler's flags for a build; empty: `own_flags` holds the flags.
        own_flags: the compiler's flags if no script prints them.
        build: the script that makes the image in a folder.
        wiring: the port's header with the sensors' scales; empty: there is no such header.
        images: name patterns of the files of a build that are kept.
        sizes: the names of the image's sizes in bytes, and the pattern that finds these sizes in the build's
            brickpilot.txt.
        flashes: the command that puts the image on the board at the serial port PORT; empty: there is no such command.
        flown: the file of a build that `hil --image` flies; empty: there is no such file.
        library: whether the sources are also written as an Arduino library.
    """

    name: str
    sensors: Mapping[str, tuple[str, ...]]
    flags: str
    own_flags: tuple[str, ...]
    build: str
    wiring: str
    images: tuple[str, ...]
    sizes: tuple[tuple[str, ...], str]
    flashes: str
    flown: str = ""
    library: bool = False


def flags_of(board: Board, sensors: str, root: Path) -> list[str]:
    """Returns the compiler's flags of the firmware on this board."""
    if not board.flags:
        return list(board.own_flags)
    return run([str(root / board.flags), *board.sensors[sensors]], root).split()


def step_of(flags: list[str]) -> float:
    """Returns the control step in s that the flags define; the default is `STEP_S`."""
    steps = [int(flag.removeprefix("-DSTEP_MS=")) for flag in flags if flag.startswith("-DSTEP_MS=")]
    return steps[0] / 1e3 if steps else STEP_S


def build(board: Board, sensors: str, headers: Path, folder: Path, root: Path) -> Figures:
    """Builds the image in `folder`, with the headers in `headers` in place of the project's, and returns its sizes.

    Raises:
        WorkFailedError: the build fails; the last line of its output says why.
    """
    run([str(root / board.build), str(folder), *board.sensors[sensors]], root, {"OWN_HEADERS": str(headers)})
    names, pattern = board.sizes
    numbers = re.search(pattern, (folder / "brickpilot.txt").read_text(), re.MULTILINE | re.DOTALL)
    assert numbers is not None
    return dict(zip(names, map(int, numbers.groups()), strict=True))


def run(command: list[str], root: Path, environment: Mapping[str, str] | None = None) -> str:
    """Runs a script of the project and returns what it prints.

    Raises:
        WorkFailedError: the script fails.
    """
    done = subprocess.run(
        command, cwd=root, env={**os.environ, **(environment or {})}, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()] or ["it said nothing"]
        raise WorkFailedError(f"{Path(command[0]).relative_to(root)} failed: {lines[-1]}")
    return done.stdout


RCX = Board(
    name="rcx",
    sensors={"imu": ("imu",), "imu+encoders": ("rotation",)},
    flags="firmware/targets/rcx/flags",
    own_flags=(),
    build="firmware/targets/rcx/build",
    wiring="rcx/board.h",
    images=("*.lx", "*.srec", "*.h8sim", "*.txt", "*.map"),
    sizes=(
        ("text", "data", "variables", "stacks", "memory", "left"),
        r"^linked +(\d+) +(\d+) +(\d+).*?stacks and tasks (\d+), of (\d+): (\d+) bytes left",
    ),
    flashes="brickpilot flash rcx brickpilot.lx --tty PORT",
    flown="brickpilot.h8sim",
)


def _avr(name: str, chip: str, both: str) -> Board:
    return Board(
        name=name,
        sensors={"imu": (chip, "imu"), "imu+encoders": (chip, both)},
        flags="firmware/targets/avr/flags",
        own_flags=(),
        build="firmware/targets/avr/build",
        wiring="avr/board.h",
        images=("*.hex", "*.elf", "*.txt", "*.map"),
        sizes=(
            ("flash", "flash_of_chip", "ram", "ram_of_chip"),
            r"^flash: (\d+) of (\d+) bytes.*?^RAM: (\d+) of (\d+) bytes",
        ),
        flashes=f"brickpilot flash avr brickpilot.hex --part {chip} --port PORT",
        flown="brickpilot.elf",
        library=True,
    )


TEMPLATE = Board(
    name="template",
    sensors={"imu": (), "imu+encoders": ()},
    flags="",
    own_flags=("-DBODY_WITHOUT_PAPER",),
    build="firmware/targets/template/build",
    wiring="",
    images=("brickpilot", "*.txt"),
    sizes=(("text", "data", "variables"), r"^\S+ +(\d+) +(\d+) +(\d+)\n\Z"),
    flashes="",
)

BOARDS = {
    board.name: board for board in (RCX, _avr("avr", "328p", "rotation"), _avr("avr:2560", "2560", "all"), TEMPLATE)
}
"""Name -> board. `avr` is the ATmega328P; its image uses either the accelerometers or the rotation sensors."""


MILLI = 1e3

_AXIS = re.compile(
    r"(static const board_axis_t BOARD_(GYRO|SURGE|SWAY) = \{\d+, )\d+, \d+(, (?:true|false)\};)(?: /\* range: .*\*/)?"
)
_PER_COUNT_Q8 = re.compile(r"(#define BOARD_(GYRO|SURGE|SWAY)_PER_COUNT_Q8 )\d+(?: /\*.*\*/)?")
_COUNTS = re.compile(r"\d+ edges a turn of the wheel|16 counts per turn, geared up 1:3 from the wheel")
_BITS = re.compile(r"(#define MOTOR_VOLTAGE_BITS )\d+")
_BATTERY = re.compile(r"(#define BOARD_BATTERY_FULL_MV )(\d+)")
_IMU = re.compile(r"(#define BOARD_IMU )BOARD_ANALOGUE\b")
ANALOGUE = "analogue"
IMUS = {ANALOGUE: "BOARD_ANALOGUE", "mpu6050": "BOARD_MPU6050", "lsm6ds": "BOARD_LSM6DS"}
"""IMU of an Arduino -> name of the IMU in board.h."""
_DIGITAL = {"gyro_range": math.radians(1000.0), "accel_range": 2 * 9.80665}  # rad/s, m/s^2: set in an IMU on I2C
_RANGES = {"GYRO": "gyro_range", "SURGE": "accel_range", "SWAY": "accel_range"}


def write_headers(
    robot: Robot, mission: Scenario, board: Board, step: float, folder: Path, root: Path, imu: str = ANALOGUE
) -> None:
    """Writes the headers of a robot into `folder`: constants, route, and the board's wiring with this robot's scales.

    Raises:
        InputError: a format cannot hold a value; the board does not have the IMU; or a range exceeds that of the IMU.
    """
    _check_imu(imu, robot, board)
    points = [(round(x * MILLI), round(y * MILLI)) for x, y in mission.waypoints]
    maker = comment(f"Made by `brickpilot firmware` of robot.toml, for {robot.model.name}.")
    texts = {
        "app/params_gen.h": f"{maker}\n{params_header.own_header(robot, step)}",
        "app/mission.h": render_text(
            "firmware", "mission.h", comment=comment(f"{mission.title}, in mm."), points=points
        ),
        **of_model(robot, root),
    }
    if board.wiring:
        texts[board.wiring] = _IMU.sub(
            rf"\g<1>{IMUS[imu]}", _wiring((root / "hal" / board.wiring).read_text(encoding="utf-8"), robot)
        )
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def _check_imu(imu: str, robot: Robot, board: Board) -> None:
    if imu not in IMUS:
        raise InputError(f"{imu!r} is not one of {', '.join(IMUS)}", field="--imu")
    if imu == ANALOGUE:
        return
    if not board.library:
        raise InputError(f"{board.name} reads no IMU on I2C: the Arduino boards do", field=f"--imu {imu}")
    for name, most in _DIGITAL.items():
        if (stated := robot.value("sensors", "imu", name)) > most * (1 + 1e-3):
            robot.toml.refuse(("sensors", "imu", name), f"{stated:g} is beyond the {most:.4g} of an IMU on I2C")


def of_model(robot: Robot, root: Path) -> dict[str, str]:
    """Returns header -> text, for headers that change the model's formats; empty: the project's formats fit."""
    bits = params_header.voltage_bits(plain(robot.vehicle["parameters"]))
    if bits == 0:
        return {}
    text = (root / "firmware/model/limits.h").read_text(encoding="utf-8")
    return {"model/limits.h": _BITS.sub(rf"\g<1>{bits}", text)}


def _wiring(text: str, robot: Robot) -> str:
    """Returns the header of a port with the scales of this robot's sensors; a comment states the counts per turn.

    A count of the converter is worth twice the sensor's range divided by 1024. The header of the RCX states this value
    as a whole part and a rest in 256ths; the header of the AVR chips states the value in 256ths.
    """
    counts = {axis: 2 * robot.value("sensors", "imu", name) * MILLI / 1024 for axis, name in _RANGES.items()}
    q8 = {axis: round(count * 256) for axis, count in counts.items()}
    axes = {*_AXIS.findall(text), *_PER_COUNT_Q8.findall(text)}
    if len(axes) != len(_RANGES) or max(q8.values()) > 65535:
        raise InputError("has no scales that can be written for another robot", file="board.h")
    text = _with_battery(text, robot)
    turn = f"{robot.value('sensors', 'encoder', 'counts_per_turn'):g} counts a turn of the wheel"
    text, places = _COUNTS.subn(turn, text)
    if not places:
        raise InputError("does not say how many counts a turn of the wheel has", file="board.h")
    text = _AXIS.sub(lambda axis: f"{axis[1]}{q8[axis[2]] // 256}, {q8[axis[2]] % 256}{axis[3]}", text)
    return _PER_COUNT_Q8.sub(lambda axis: f"{axis[1]}{q8[axis[2]]}", text)


def _with_battery(text: str, robot: Robot) -> str:
    """Returns the header with a voltage range that includes this robot's charged battery."""
    nominal = robot.value("parameters", "battery_voltage")
    stated = _BATTERY.search(text)
    measured = int(stated[2]) / MILLI if stated else HIGHEST_BATTERY
    if nominal / params_header.BATTERY_MOST * HIGHEST_OWN <= measured:
        return text
    if stated is None:
        robot.toml.refuse(
            ("parameters", "battery_voltage"), f"{nominal:g} V is more than this board measures: {measured:g} V charged"
        )
    return _BATTERY.sub(rf"\g<1>{params_header.MILLIVOLTS} /* another divider than the packaged robot's */", text)


@dataclass(frozen=True)
class ClosedLoop:
    """The headers and flags with which a machine compiles the closed loop as a library; a worker gets them quickly.

    Attributes:
        headers: (file, text) of the headers that replace the project's: the robot's constants.
        flags: the compiler's flags, which select the firmware of a board and its sensors.
    """

    headers: tuple[tuple[str, str], ...]
    flags: tuple[str, ...]

    def library(self) -> Path:
        """Returns the library for `flight.Plan.firmware`. Each process compiles it once, and removes it at the end.

        Raises:
            InputError: the firmware's sources are missing.
            WorkFailedError: the compiler fails.
        """
        return _compiled(self)


def closed_loop(robot: Robot, board: Board, sensors: str) -> ClosedLoop:
    """Returns the closed loop of a robot on a board with `sensors`.

    Raises:
        InputError: the firmware's sources are missing, or a format cannot hold a value.
    """
    flags = flags_of(board, sensors, sources())
    constants = {"app/params_gen.h": params_header.own_header(robot, step_of(flags)), **of_model(robot, sources())}
    return ClosedLoop(tuple(constants.items()), tuple(flag for flag in flags if flag.startswith("-D")))


@cache
def _compiled(loop: ClosedLoop) -> Path:
    root, folder = sources(), Path(tempfile.mkdtemp(prefix="brickpilot-loop-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, text in loop.headers:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    made = folder / "closed_loop.so"
    run([str(root / "sim_host/run/build"), str(made), str(compiled.library()), f"-I{folder}", *loop.flags], root)
    return made
