"""Logs of a link's traffic in the CAN formats of python-can, and their replay into a brick."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import can

from brickpilot.errors import InputError, SimulationError
from brickpilot.link.links import Link, Message, WrappedLink
from brickpilot.link.messages import SIZE, book
from brickpilot.link.session import LOCKSTEP, Session

SUFFIXES = (".asc", ".blf", ".log")
"""Suffixes of Vector's text and binary logs, and of candump's logs."""


def _check_suffix(file: Path) -> None:
    if file.suffix not in SUFFIXES:
        raise InputError(f"needs one of the suffixes {', '.join(SUFFIXES)}", file=file)


class RecordingLink(WrappedLink):
    """A link that writes its messages to a file.

    Args:
        link: the link to wrap; it is closed when this link is closed.
        file: the file, with one of SUFFIXES.

    Raises:
        InputError: the file has another suffix or cannot be written.
    """

    def __init__(self, link: Link, file: Path) -> None:
        _check_suffix(file)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._logger = can.Logger(str(file))
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=file) from error
        super().__init__(link)

    def _write(self, messages: Sequence[Message], received: bool) -> None:
        now = time.time()
        for identifier, data in messages:
            self._logger.on_message_received(
                can.Message(
                    timestamp=now, arbitration_id=identifier, data=data, is_extended_id=False, is_rx=received, channel=0
                )
            )

    def send(self, messages: Sequence[Message]) -> None:
        self._write(messages, received=False)
        self._link.send(messages)

    def receive(self, timeout: float) -> list[Message]:
        messages = self._link.receive(timeout)
        self._write(messages, received=True)
        return messages

    def close(self) -> None:
        self._logger.stop()
        self._link.close()


@contextmanager
def recorded(link: Link, file: Path | None) -> Iterator[Link]:
    """Yields a link that also writes its messages to `file`; if `file` is None, yields `link` itself."""
    if file is None:
        yield link
    else:
        with closing(RecordingLink(link, file)) as recording:
            yield recording


def read(file: Path) -> list[can.Message]:
    """Returns the messages of a log in order; each message has its time, and `is_rx`: whether the host received it.

    Raises:
        InputError: the file cannot be read, has another suffix, or is no log of CAN traffic.
    """
    _check_suffix(file)
    try:
        with can.LogReader(str(file)) as reader:
            return list(reader)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=file) from error
    except Exception as error:  # a damaged file makes python-can raise errors of many types
        raise InputError(f"is no log of CAN traffic: {error}", file=file) from error


@dataclass(frozen=True)
class Replayed:
    """The result of a replay.

    Attributes:
        steps: number of sets of sensor messages that have a reply in the recording and in the replay.
        differing: number of sets whose replies differ.
        first: number, from 1, of the first set whose replies differ; None: no replies differ.
    """

    steps: int
    differing: int
    first: int | None


def replay(link: Link, spec: str, file: Path) -> Replayed:
    """Sends a recorded flight to a brick again and compares the motor commands.

    Args:
        link: an open link.
        spec: the link as the user named it, for error messages.
        file: the log of a flight in lockstep.

    Raises:
        InputError: the file cannot be read or holds no flight in lockstep with this DBC, or no brick replies.
        SimulationError: the brick stops replying.
    """
    messages = [(message.arbitration_id, bytes(message.data)) for message in read(file)]
    _check_opening(messages, file)
    motors = book().by_name["MOTORS"]
    session = Session(link, spec)
    recorded: dict[int, tuple[int, ...]] = {}
    replayed: dict[int, tuple[int, ...]] = {}
    number = 0
    for identifier, data in messages:
        if identifier == motors.id and motors.sealed(data):
            recorded[number] = motors.unpack(data)[:2]
        layout = book().by_id.get(identifier)
        if layout is None or layout.of_brick:
            continue
        link.send([(identifier, data)])
        expected = book().reply_to(layout)
        if expected is None or len(data) != SIZE:
            continue
        number += layout.name == "SYNC"
        reply = session.wait(expected.id, partial(expected.answers, layout.sequence(data)), 1.0)
        if reply is None and layout.name == "OPEN":
            raise InputError("no brick has replied", field=f"--link {spec}")
        if reply is None and number in recorded:
            raise SimulationError(f"{spec}: the brick no longer replies, at step {number}")
        if reply is not None and layout.name == "SYNC":
            replayed[number] = motors.unpack(reply)[:2]
    both = sorted(recorded.keys() & replayed.keys())
    differing = [step for step in both if recorded[step] != replayed[step]]
    return Replayed(len(both), len(differing), differing[0] if differing else None)


def _check_opening(messages: Sequence[Message], file: Path) -> None:
    """Raises InputError unless the messages open a session in lockstep with this DBC."""
    opening = book().by_name["OPEN"]
    opened = [data for identifier, data in messages if identifier == opening.id and len(data) == 8]
    if not opened:
        raise InputError("holds no flight: no session is opened in it", file=file)
    request = dict(zip(opening.names, opening.unpack(opened[0]), strict=True))
    if request["pace"] != book().choices("OPEN", "pace")[LOCKSTEP]:
        raise InputError("holds a flight in real time; only flights in lockstep can be replayed", file=file)
    if (request["protocol"], request["dbc"]) != (book().protocol, book().crc):
        raise InputError("was recorded with another brickpilot.dbc", file=file)
