"""The closed loop of the plant and a robot's own firmware, compiled for this machine as one library.

It flies some fifty to a hundred times as fast as the firmware behind a link (`simulate.fly_own`), with the same motor
commands, so that a robot's gains can be tuned over many flights.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from brickpilot import compiled
from brickpilot.firmware import boards, headers, ranges
from brickpilot.firmware.boards import Board
from brickpilot.firmware.robot import Robot
from brickpilot.hil.checkout import sources


@dataclass(frozen=True)
class ClosedLoop:
    """What the library is made of; it is small, and so can be sent to another machine.

    Attributes:
        headers: file -> text of those that take the place of the project's: the robot's constants.
        flags: of the compiler, which make the firmware that of a board with some sensors.
    """

    headers: tuple[tuple[str, str], ...]
    flags: tuple[str, ...]

    def library(self) -> Path:
        """Returns the library for `flight.Plan.firmware`. It is compiled once in each process, and removed at its end.

        Raises:
            InputError: the firmware's sources are not there.
            WorkFailedError: the compiler fails.
        """
        return _compiled(self)


def of(robot: Robot, board: Board, sensors: str) -> ClosedLoop:
    """Returns the closed loop of a robot on a board, with its sensors.

    Raises:
        InputError: the firmware's sources are not there; a value that a format cannot hold.
    """
    flags = boards.flags_of(board, sensors, sources())
    constants = {"app/params_gen.h": ranges.header(robot, boards.step_of(flags)), **headers.of_model(robot, sources())}
    return ClosedLoop(tuple(constants.items()), tuple(flag for flag in flags if flag.startswith("-D")))


@cache
def _compiled(loop: ClosedLoop) -> Path:
    root, folder = sources(), Path(tempfile.mkdtemp(prefix="brickpilot-loop-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, text in loop.headers:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    made = folder / "closed_loop.so"
    boards.run([str(root / "sim_host/run/build"), str(made), str(compiled.library()), f"-I{folder}", *loop.flags], root)
    return made
