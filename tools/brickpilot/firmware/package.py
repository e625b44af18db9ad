"""What `brickpilot firmware` writes: a robot's constants, the image of a board, and how the robot flies with it."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit

from brickpilot.firmware import arduino, boards, headers, simulate, sources
from brickpilot.firmware.boards import Board
from brickpilot.firmware.robot import OWN, Robot, entry
from brickpilot.hil.checkout import sources as project_sources
from brickpilot.hil.fly import HilFlight
from brickpilot.vehicle.flight import Plan

HEADERS = "include"
FILES = frozenset(
    {"README.md", "firmware.json", "robot.toml", "flight", HEADERS, "arduino", "src", "Makefile", "build.sh"}
)
"""What the command writes beside the images."""

_MAKEFILE = """\
# The autopilot with the port of src/template. For another chip: make CC=avr-gcc SIZE=avr-size CFLAGS="-Os -mmcu=..."
CC ?= cc
SIZE ?= size
CFLAGS ?= -std=c99 -Os -Wall -Wextra
SOURCES := $(wildcard src/*.c src/*/*.c)

brickpilot: $(SOURCES) $(wildcard src/*.h src/*/*.h)
\t$(CC) $(CFLAGS) -ffunction-sections -fdata-sections -Isrc $(SOURCES) -Wl,--gc-sections -o $@
\t$(SIZE) $@
"""

_BUILD = """#!/bin/sh
# build.sh CHECKOUT [FOLDER]: builds the image once more with a checkout of the project; FOLDER is image by default.
# Change include/ first: {wiring}the constants, the route.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
own=$(mktemp -d) # a path without spaces, for the compiler's flags
trap 'rm -rf "$own"' EXIT
cp -r "$here/include/." "$own"
OWN_HEADERS=$own "$1/{build}" "${{2:-$here/image}}" {words}
"""


@dataclass(frozen=True)
class Order:
    """What to make.

    Attributes:
        sensors: of the flight, a key of `board.sensors`.
        mission: file of a scenario; None: the packaged mission, scaled.
        imu: a key of `headers.IMUS`.
    """

    robot: Robot
    board: Board
    sensors: str
    mission: str | None
    seed: int
    imu: str = headers.ANALOGUE


@dataclass(frozen=True)
class Made:
    """What was made: the sizes of the image by what they are of, in bytes; the flight; the control step in s."""

    sizes: boards.Figures
    flown: HilFlight
    plan: Plan
    step: float


def make(order: Order, folder: Path) -> Made:
    """Writes constants, sources and image into `folder`, and flies the robot with the same constants.

    Raises:
        InputError: a value that a format cannot hold.
        WorkFailedError: a build fails, as where the image does not fit.
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
        headers.write(robot, mission, board, step, work / HEADERS, root, order.imu)
        constants = [flag for flag in flags if flag.startswith("-D")]
        sizes = boards.build(board, order.sensors, work / HEADERS, work / "image", root)
        flown = simulate.fly_own(root, work / HEADERS, constants, plan, work)
        for path in (found for pattern in board.images for found in sorted((work / "image").glob(pattern))):
            shutil.copyfile(path, folder / path.name)
        shutil.copytree(work / HEADERS, folder / HEADERS)
        _write_sources(board, root, work / HEADERS, constants, folder)
    (folder / "robot.toml").write_text(vehicle_file(robot), encoding="utf-8")
    _write_recipe(board, order.sensors, folder)
    return Made(sizes, flown, plan, step)


def _write_sources(board: Board, root: Path, own: Path, constants: list[str], folder: Path) -> None:
    if board.library:
        arduino.write(root, own, constants, folder / "arduino" / arduino.NAME)
    if not board.flags:
        sources.write(root, own, constants, "template", folder / "src")
        (folder / "Makefile").write_text(_MAKEFILE, encoding="utf-8")


def _write_recipe(board: Board, sensors: str, folder: Path) -> None:
    wiring = f"{board.wiring} is the wiring, app/ holds " if board.wiring else "app/ holds "
    text = _BUILD.format(wiring=wiring, build=board.build, words=" ".join(board.sensors[sensors]))
    (folder / "build.sh").write_text(text, encoding="utf-8")
    (folder / "build.sh").chmod(0o755)


def files_of(board: Board) -> set[str]:
    """Returns the names that the command may write into its folder, for this board or another one."""
    programs = ("brickpilot", "recorder")
    ends = {pattern.removeprefix("*") for one in boards.BOARDS.values() for pattern in one.images if "*" in pattern}
    return set(FILES) | {"brickpilot"} | {program + end for program in programs for end in ends}


def vehicle_file(robot: Robot) -> str:
    """Returns the text of robot.toml: every value that the firmware was made from, with unit and basis."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment("The robot as its firmware knows it, SI units. `basis`: stated, the packaged robot's, or")
    )
    document.add(
        tomlkit.comment("the rule by which it follows from the packaged robot's (tools/brickpilot/firmware/tuning.py).")
    )
    document.update({"name": robot.model.name, "vehicle": "diff_drive", "profile": "coupled"})
    for place in (("parameters",), *OWN):
        table = tomlkit.table()
        for name, row in entry(robot.vehicle, place).items():
            if "value" in row:
                inline = tomlkit.inline_table()
                inline.update({**row, "value": float(row["value"])})
                table[name] = inline
        _nested(document, place)[place[-1]] = table
    return tomlkit.dumps(document)


def _nested(document: Any, place: tuple[str, ...]) -> Any:
    for name in place[:-1]:
        document = document.setdefault(name, tomlkit.table(is_super_table=True))
    return document


def write_figures(figures: dict[str, Any], folder: Path) -> None:
    """Writes firmware.json."""
    (folder / "firmware.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
