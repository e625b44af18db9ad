"""The boards that firmware is built for: what each build needs, and what its report says of the image's size."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from brickpilot.constants import STEP_S
from brickpilot.errors import WorkFailedError

Figures = dict[str, int]


@dataclass(frozen=True)
class Board:
    """A board.

    Attributes:
        name: for `--board`.
        sensors: sensors of a flight -> what `flags` and `build` are told of them.
        flags: the script that prints the compiler's flags for such a build; empty: `own_flags`.
        own_flags: the same, where no script prints them.
        build: the script that makes the image in a folder.
        wiring: header of the port with the scales of its sensors; empty: it has none.
        images: patterns of the files of a build that are kept.
        sizes: reads bytes of the image off the folder of a build.
        flashes: the command that puts the image on the board, PORT being its serial port; empty: none does.
        flown: the one of a build's files that `hil --image` flies; empty: none.
        library: whether it is also written as a library of Arduino.
    """

    name: str
    sensors: Mapping[str, tuple[str, ...]]
    flags: str
    own_flags: tuple[str, ...]
    build: str
    wiring: str
    images: tuple[str, ...]
    sizes: Callable[[Path], Figures]
    flashes: str
    flown: str = ""
    library: bool = False


def flags_of(board: Board, sensors: str, root: Path) -> list[str]:
    """Returns the compiler's flags of the firmware on this board."""
    if not board.flags:
        return list(board.own_flags)
    return run([str(root / board.flags), *board.sensors[sensors]], root).split()


def step_of(flags: list[str]) -> float:
    """Returns the control step in s that the flags ask for; without one it is `STEP_S`."""
    found = next((re.fullmatch(r"-DSTEP_MS=(\d+)", flag) for flag in flags if flag.startswith("-DSTEP_MS=")), None)
    return int(found[1]) / 1e3 if found else STEP_S


def build(board: Board, sensors: str, headers: Path, folder: Path, root: Path) -> Figures:
    """Builds the image in `folder` with the headers of `headers` in the place of the project's, and returns its sizes.

    Raises:
        WorkFailedError: the build fails; its last line says why.
    """
    run([str(root / board.build), str(folder), *board.sensors[sensors]], root, {"OWN_HEADERS": str(headers)})
    return board.sizes(folder)


def run(command: list[str], root: Path, environment: Mapping[str, str] | None = None) -> str:
    """Runs a script of the project and returns what it prints.

    Raises:
        WorkFailedError: it fails.
    """
    done = subprocess.run(
        command, cwd=root, env={**os.environ, **(environment or {})}, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        said = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        raise WorkFailedError(f"{Path(command[0]).relative_to(root)} failed: {said[-1] if said else 'it said nothing'}")
    return done.stdout


def _rcx_sizes(folder: Path) -> Figures:
    text = (folder / "brickpilot.txt").read_text()
    linked = re.search(r"^linked +(\d+) +(\d+) +(\d+)", text, re.MULTILINE)
    left = re.search(r"stacks and tasks (\d+), of (\d+): (\d+) bytes left", text)
    assert linked is not None
    assert left is not None
    names = ("text", "data", "variables", "stacks", "memory", "left")
    return dict(zip(names, map(int, (*linked.groups(), *left.groups())), strict=True))


def _avr_sizes(folder: Path) -> Figures:
    text = (folder / "brickpilot.txt").read_text()
    flash = re.search(r"^flash: (\d+) of (\d+) bytes", text, re.MULTILINE)
    ram = re.search(r"^RAM: (\d+) of (\d+) bytes", text, re.MULTILINE)
    assert flash is not None
    assert ram is not None
    names = ("flash", "flash_of_chip", "ram", "ram_of_chip")
    return dict(zip(names, map(int, (*flash.groups(), *ram.groups())), strict=True))


def _host_sizes(folder: Path) -> Figures:
    *_, last = (folder / "brickpilot.txt").read_text().split("\n")[:-1]
    return dict(zip(("text", "data", "variables"), map(int, last.split()[1:]), strict=True))


RCX = Board(
    name="rcx",
    sensors={"imu": ("imu",), "imu+encoders": ("rotation",)},
    flags="firmware/targets/rcx/flags",
    own_flags=(),
    build="firmware/targets/rcx/build",
    wiring="rcx/board.h",
    images=("*.lx", "*.srec", "*.h8sim", "*.txt", "*.map"),
    sizes=_rcx_sizes,
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
        sizes=_avr_sizes,
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
    sizes=_host_sizes,
    flashes="",
)

BOARDS = {
    board.name: board for board in (RCX, _avr("avr", "328p", "rotation"), _avr("avr:2560", "2560", "all"), TEMPLATE)
}
"""`avr` is the ATmega328P, whose image has either the accelerometers or the rotation sensors."""
