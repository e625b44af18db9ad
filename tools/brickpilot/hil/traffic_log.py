"""What travels over a link as a log of CAN traffic, as python-can writes it, and back into a brick."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import can

from brickpilot.errors import InputError, SimulationError
from brickpilot.link.links import Frame, Link
from brickpilot.link.messages import Layout, book
from brickpilot.link.session import LOCKSTEP, Session

SUFFIXES = (".asc", ".blf", ".log")
"""Vector's text and binary logs, and candump's."""


class RecordingLink:
    """A link whose messages are written to a file as they pass.

    Args:
        link: closed with this one.
        file: its suffix is one of SUFFIXES.

    Raises:
        InputError: another suffix, or the file cannot be written.
    """

    def __init__(self, link: Link, file: Path) -> None:
        if file.suffix not in SUFFIXES:
            raise InputError(f"ends in none of {', '.join(SUFFIXES)}", file=file)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._logger = can.Logger(str(file))
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=file) from error
        self._link = link

    @property
    def damaged(self) -> int:
        return self._link.damaged

    @damaged.setter
    def damaged(self, count: int) -> None:
        self._link.damaged = count

    def _write(self, frames: Sequence[Frame], received: bool) -> None:
        now = time.time()
        for identifier, data in frames:
            self._logger.on_message_received(
                can.Message(
                    timestamp=now, arbitration_id=identifier, data=data, is_extended_id=False, is_rx=received, channel=0
                )
            )

    def send(self, frames: Sequence[Frame]) -> None:
        self._write(frames, received=False)
        self._link.send(frames)

    def receive(self, timeout: float) -> list[Frame]:
        frames = self._link.receive(timeout)
        self._write(frames, received=True)
        return frames

    def close(self) -> None:
        self._logger.stop()
        self._link.close()


def read(file: Path) -> list[Frame]:
    """The messages of a log, in their order.

    Raises:
        InputError: no such file, or it is not one of SUFFIXES, or nothing in it can be read.
    """
    if file.suffix not in SUFFIXES:
        raise InputError(f"ends in none of {', '.join(SUFFIXES)}", file=file)
    try:
        with can.LogReader(str(file)) as reader:
            frames = [(message.arbitration_id, bytes(message.data)) for message in reader]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=file) from error
    except Exception as error:  # python-can's readers raise whatever a damaged file makes of them
        raise InputError(f"is no log of CAN traffic: {error}", file=file) from error
    return frames


@dataclass(frozen=True)
class Replayed:
    """``steps``: sets that were answered, in the recording and again; ``differing``: those answered otherwise."""

    steps: int
    differing: int
    first: int | None  # the first of these


def _is_answer(layout: Layout, at: int, sequence: int, data: bytes) -> bool:
    return layout.sealed(data) and data[at] == sequence


ANSWERS = {
    "OPEN": "HELLO",
    "MODE_COMMAND": "MODE_REPLY",
    "PARAMETER_REQUEST": "PARAMETER",
    "WAYPOINT_REQUEST": "WAYPOINT",
    "ROUTE_REQUEST": "ROUTE",
    "SYNC": "MOTORS",
}
SEQUENCE_AT = 4  # in SYNC and MOTORS; 0 in the others


def replay(link: Link, spec: str, file: Path) -> Replayed:
    """Sends a recorded flight to a brick once more and compares what it does with the motors.

    Args:
        link: open.
        spec: the link as the user named it, for messages.
        file: of a flight in lockstep.

    Raises:
        InputError: the file cannot be read, or holds no flight in lockstep of this DBC, or no brick answers.
        SimulationError: the brick stops answering.
    """
    messages, by_id = read(file), book().by_id
    opened = [data for identifier, data in messages if identifier == book().by_name["OPEN"].id and len(data) == 8]
    if not opened:
        raise InputError("holds no flight: nobody opens a session in it", file=file)
    names = book().by_name["OPEN"].names
    asked = dict(zip(names, book().by_name["OPEN"].unpack(opened[0]), strict=True))
    if asked["pace"] != book().choices("OPEN", "pace")[LOCKSTEP]:
        raise InputError("is of a flight in real time; only lockstep can be replayed", file=file)
    if (asked["protocol"], asked["dbc"]) != (book().protocol, book().crc):
        raise InputError("was recorded with another brickpilot.dbc", file=file)
    motors = book().by_name["MOTORS"]
    recorded = {}
    again = {}
    session = Session(link, spec)
    number = 0
    for identifier, data in messages:
        layout = by_id.get(identifier)
        if identifier == motors.id and motors.sealed(data):
            recorded[number] = motors.unpack(data)[:2]
        if layout is None or book().database.get_message_by_name(layout.name).senders != ["HOST"]:
            continue
        link.send([(identifier, data)])
        if layout.name not in ANSWERS or len(data) != 8:
            continue
        answer, at = book().by_name[ANSWERS[layout.name]], SEQUENCE_AT if layout.name == "SYNC" else 0
        number += layout.name == "SYNC"
        found = session.wait(answer.id, partial(_is_answer, answer, at, data[at]), 1.0)
        if found is None and layout.name == "OPEN":
            raise InputError("no brick has answered", field=f"--link {spec}")
        if found is None and number in recorded:
            raise SimulationError(f"{spec}: the brick no longer answers, at step {number}")
        if found is not None and layout.name == "SYNC":
            again[number] = motors.unpack(found)[:2]
    both = sorted(recorded.keys() & again.keys())
    differing = [step for step in both if recorded[step] != again[step]]
    return Replayed(len(both), len(differing), differing[0] if differing else None)
