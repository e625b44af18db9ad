"""Writes the files of `brickpilot firmware`: a robot's constants, the image for a board, and a simulated flight.

The firmware's sources are also written as one folder that needs no checkout: for the user's own board, and as a library
that the Arduino IDE, arduino-cli and PlatformIO accept. `src/` is the only include path. It holds the firmware's
folders, hal.h, wire/ and the port. Every .c file first includes brickpilot_build.h, which defines the constants of the
build, because an Arduino library cannot set compiler flags.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import tomlkit

from brickpilot.firmware import boards, simulate
from brickpilot.firmware.boards import Board
from brickpilot.firmware.robot import OWN, Robot, entry
from brickpilot.hil.checkout import sources as project_sources
from brickpilot.hil.fly import HilFlight
from brickpilot.text_template import render_text
from brickpilot.vehicle.flight import Plan

HEADERS = "include"
FILES = frozenset(
    {"README.md", "firmware.json", "robot.toml", "flight", HEADERS, "arduino", "src", "Makefile", "build.sh"}
)
"""The files and folders that the command writes beside the images."""


@dataclass(frozen=True)
class Order:
    """The options of `make`.

    Attributes:
        sensors: the sensors of the flight, a key of `board.sensors`.
        mission: file of a scenario; None: the packaged mission, scaled to the robot.
        imu: a key of `boards.IMUS`.
    """

    robot: Robot
    board: Board
    sensors: str
    mission: str | None
    seed: int
    imu: str = boards.ANALOGUE


@dataclass(frozen=True)
class Made:
    """The result of `make`: sizes of the image's parts in bytes, the flight and its plan, and the control step in s."""

    sizes: boards.Figures
    flown: HilFlight
    plan: Plan
    step: float


def make(order: Order, folder: Path) -> Made:
    """Writes constants, sources and image into `folder`, and flies the robot with the same constants.

    Raises:
        InputError: a format cannot hold a value.
        WorkFailedError: a build fails, for example because the image does not fit.
        SimulationError: the plant diverges.
    """
    root = project_sources("--board")
    robot, board = order.robot, order.board
    flags = boards.flags_of(board, order.sensors, root)
    step = boards.step_of(flags)
    mission = simulate.mission(robot, order.mission)
    plan = simulate.plan(robot, mission, order.sensors, order.seed)
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        boards.write_headers(robot, mission, board, step, work / HEADERS, root, order.imu)
        constants = [flag for flag in flags if flag.startswith("-D")]
        sizes = boards.build(board, order.sensors, work / HEADERS, work / "image", root)
        flown = simulate.fly_own(root, work / HEADERS, constants, plan, work)
        for path in (path for pattern in board.images for path in sorted((work / "image").glob(pattern))):
            shutil.copyfile(path, folder / path.name)
        shutil.copytree(work / HEADERS, folder / HEADERS)
        if board.library:
            write_library(root, work / HEADERS, constants, folder / "arduino" / NAME)
        if not board.flags:
            write_sources(root, work / HEADERS, constants, "template", folder / "src")
            _render("Makefile", folder)
    (folder / "robot.toml").write_text(vehicle_file(robot), encoding="utf-8")
    _render("build.sh", folder, board=board, sensors=order.sensors).chmod(0o755)
    return Made(sizes, flown, plan, step)


def files_of(board: Board) -> set[str]:
    """Returns the names that the command may write into its folder, for any board."""
    programs = ("brickpilot", "recorder")
    ends = {pattern.removeprefix("*") for known in boards.BOARDS.values() for pattern in known.images if "*" in pattern}
    return set(FILES) | {"brickpilot"} | {program + end for program in programs for end in ends}


def vehicle_file(robot: Robot) -> str:
    """Returns the text of robot.toml: every value from which the firmware is made, with unit and basis."""
    document: Any = tomlkit.document()
    for line in (
        "The robot as its firmware knows it, SI units. `basis`: stated, the packaged robot's, or",
        "the rule by which it follows from the packaged robot's (tools/brickpilot/firmware/robot.py).",
    ):
        document.add(tomlkit.comment(line))
    document.update({"name": robot.model.name, "vehicle": "diff_drive", "profile": "coupled"})
    for place in (("parameters",), *OWN):
        table = tomlkit.table()
        for name, row in entry(robot.vehicle, place).items():
            if "value" in row:
                inline = tomlkit.inline_table()
                inline.update({**row, "value": float(row["value"])})
                table[name] = inline
        above = document
        for name in place[:-1]:
            above = above.setdefault(name, tomlkit.table(is_super_table=True))
        above[place[-1]] = table
    return tomlkit.dumps(document)


NAME = "Brickpilot"
ENTRY = "brickpilot_run"
_SENTENCE = "An autopilot for a two-wheeled robot, with the constants of one robot"
_PARAGRAPH = "Gyro with accelerometers or rotation sensors, two motors on an H-bridge, and a serial link to a host"


def write_library(root: Path, headers: Path, flags: Sequence[str], folder: Path) -> None:
    """Writes the library into `folder`; the arguments are those of `write_sources`."""
    write_sources(root, headers, [*flags, f"-D{LIBRARY}"], "avr", folder / "src", entry=ENTRY)
    about = {"version": metadata.version("brickpilot"), "sentence": _SENTENCE, "paragraph": _PARAGRAPH}
    example = folder / "examples" / "Mission"
    example.mkdir(parents=True)
    _render("Brickpilot.h", folder / "src")
    _render("Mission.ino", example)
    _render("library.properties", folder, **about)
    _render("library.json", folder, **about)
    _render("keywords.txt", folder)
    shutil.copyfile(root / "LICENSE", folder / "LICENSE")


def _render(name: str, folder: Path, **content: Any) -> Path:
    """Writes the file of a template into `folder`, and returns its path."""
    path = folder / name
    path.write_text(render_text("firmware", name, **content), encoding="utf-8")
    return path


BUILD = "brickpilot_build.h"
LIBRARY = "BRICKPILOT_LIBRARY"
"""With this constant, the sources do not set the fuses, because the boot loaders of Arduinos cannot write fuses."""

HOSTS_ONLY = ("body_pose.c", "pid_start.c")


def write_sources(
    root: Path, headers: Path, flags: Sequence[str], port: str, folder: Path, *, entry: str = "main"
) -> None:
    """Writes the sources into `folder`.

    Args:
        root: the checkout.
        headers: the folder of the headers that replace the project's.
        flags: the compiler's flags; only flags that define a constant are kept.
        port: name of the port's folder in hal/, and of the folder with its main program in firmware/targets/.
        entry: the new name of the main program's main().
    """
    for path in sorted((root / "firmware").rglob("*.[ch]")):
        inside = path.relative_to(root / "firmware")
        if not {"targets", "h8"} & set(inside.parts) and path.name not in HOSTS_ONLY:
            _copy(path, folder / inside)
    _copy(root / "hal/include/hal.h", folder / "hal.h")
    for name in ("crc.c", "crc.h", "frame.c", "frame.h", "message.c", "message.h", "codecs_gen.h"):
        _copy(root / "hal/wire" / name, folder / "wire" / name)
    for path in (root / "hal" / port).glob("*.[ch]"):
        _copy(path, folder / port / path.name)
    for path in (root / "firmware/targets" / port).glob("*.[ch]"):
        _copy(path, folder / path.name)
    program = folder / "main.c"
    program.write_text(re.sub(r"^int main\(", f"int {entry}(", program.read_text(encoding="utf-8"), flags=re.MULTILINE))
    for path in headers.rglob("*.h"):
        _copy(path, folder / path.relative_to(headers))
    defined = [re.fullmatch(r"-D(\w+)(?:=(.*))?", flag) for flag in flags]
    constants = {constant[1]: constant[2] or 1 for constant in defined if constant}
    _render(BUILD, folder, constants=constants)


def _copy(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".c":
        to.write_text(f'#include "{BUILD}"\n{path.read_text(encoding="utf-8")}', encoding="utf-8")
    else:
        shutil.copyfile(path, to)
