"""A session with a brick: requests and their answers, settings, routes, commands."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from brickpilot.errors import InputError, SimulationError
from brickpilot.link.links import Frame, Link
from brickpilot.link.messages import Layout, book, crc16
from brickpilot.vehicle.settings import settings

ANSWER_S = 0.25
TRIES = 4
OPEN_TRIES = 8

LOCKSTEP, REALTIME = "lockstep", "realtime"


def _answers(layout: Layout, sequence: int, data: bytes) -> bool:
    return data[:1] == bytes([sequence]) and layout.sealed(data)


class NoAnswerError(SimulationError):
    """The brick did not answer a request, however often it was sent."""


class Session:
    """Requests over a link, one at a time; every answer carries its request's sequence number.

    Args:
        link: open.
        spec: the link as the user named it, for messages.
        other: called with (id, data) of every message that is not the answer waited for.
        answer_s: how long an answer may take before the request is repeated, s.
    """

    def __init__(
        self,
        link: Link,
        spec: str,
        other: Callable[[int, bytes], None] = lambda _id, _data: None,
        answer_s: float = ANSWER_S,
    ) -> None:
        self.link = link
        self.spec = spec
        self.other = other
        self.answer_s = answer_s
        self.repeated = 0  # requests that had to be sent again
        self._book = book()
        self._sequence = 0

    def next_sequence(self) -> int:
        """0..255, another one each time."""
        self._sequence = (self._sequence + 1) & 255
        return self._sequence

    def wait(self, identifier: int, accept: Callable[[bytes], bool], timeout: float) -> bytes | None:
        """Data of the first message of that id that `accept` takes; None after `timeout` s."""
        found: bytes | None = None
        until = time.monotonic() + timeout
        while found is None:
            left = until - time.monotonic()
            if left <= 0:
                return None
            for frame_id, data in self.link.receive(left):
                if found is None and frame_id == identifier and accept(data):
                    found = data
                else:
                    self.other(frame_id, data)
        return found

    def _ask(self, request: str, answer: str, values: Sequence[int], tries: int = TRIES) -> dict[str, int]:
        """Sends, again if need be, and returns the answer's signals."""
        out, back = self._book.by_name[request], self._book.by_name[answer]
        for attempt in range(tries):
            sequence = self.next_sequence()
            self.link.send([(out.id, out.seal(sequence, *values))])
            data = self.wait(back.id, partial(_answers, back, sequence), self.answer_s)
            self.repeated += attempt > 0
            if data is not None:
                return dict(zip(back.names, back.unpack(data), strict=True))
        raise NoAnswerError(f"{self.spec}: the brick does not answer {request}")

    def open(self, profile: str, pace: str) -> None:
        """Begins a session: the brick has the constants of `profile`, no route, and its motors are off.

        Raises:
            InputError: nobody answers, or the brick was built with other messages, or lacks the profile or the pace.
        """
        profiles, paces = self._book.choices("OPEN", "profile"), self._book.choices("OPEN", "pace")
        values = (self._book.protocol, self._book.crc, profiles[profile], paces[pace])
        began = time.monotonic()
        try:
            hello = self._ask("OPEN", "HELLO", values, OPEN_TRIES)
        except NoAnswerError:
            seconds = round(time.monotonic() - began)
            raise InputError(f"no brick has answered for {seconds} s", field=f"--link {self.spec}") from None
        named = {number: name for name, number in self._book.choices("HELLO", "status").items()}
        status = named.get(hello["status"], f"status {hello['status']}")
        if status != "ok":
            raise InputError(
                {
                    "protocol_differs": f"the brick speaks protocol {hello['protocol']}, this program "
                    f"{self._book.protocol}; use the same version at both ends",
                    "dbc_differs": f"the brick was built with another brickpilot.dbc (CRC {hello['dbc']:04X}, here "
                    f"{self._book.crc:04X}); use the same version at both ends",
                    "no_such_profile": f"the brick has no constants for the profile {profile}",
                    "no_such_pace": f"the brick cannot run in {pace}",
                }.get(status, f"the brick refuses: {status}"),
                field=f"--link {self.spec}",
            )

    def parameters(self) -> tuple[str, ...]:
        """Names of the settings that can be read and written."""
        return tuple(settings())

    def read(self, name: str) -> int:
        """A setting, raw.

        Raises:
            InputError: there is none of that name.
        """
        return self._parameter(name, 0, 0)

    def write(self, name: str, value: int) -> None:
        """Writes a setting, raw.

        Raises:
            InputError: there is none of that name, or the value is out of its range, or not while the robot drives.
        """
        if not -(2**31) < value < 2**31:
            raise InputError(f"{value} is out of range", field=name)
        self._parameter(name, 1, value)

    def _parameter(self, name: str, write: int, value: int) -> int:
        if name not in settings():
            raise InputError(f"is no setting; known: {', '.join(settings())}", field=name)
        answer = self._ask("PARAMETER_REQUEST", "PARAMETER", (settings()[name].number, write, value))
        self._check(answer["status"], name, value)
        return answer["value"]

    def _check(self, status: int, field: str, value: object) -> None:
        if status:
            reason = ("", "the brick knows none such", f"{value} is out of range", "not while the robot drives")[status]
            raise InputError(reason, field=field)

    def upload(self, waypoints: Sequence[tuple[int, int]]) -> None:
        """Puts a route in force, mm: all of it or nothing.

        Raises:
            InputError: a waypoint or the route as a whole is refused.
        """
        for index, (x, y) in enumerate(waypoints):
            if not (-32768 <= x <= 32767 and -32768 <= y <= 32767):
                raise InputError(f"({x}, {y}) mm is out of range", field=f"waypoint {index}")
            answer = self._ask("WAYPOINT_REQUEST", "WAYPOINT", (index, 1, x, y))
            self._check(answer["status"], f"waypoint {index}", f"({x}, {y}) mm")
        check = crc16(b"".join(struct.pack("<hh", x, y) for x, y in waypoints))
        answer = self._ask("ROUTE_REQUEST", "ROUTE", (len(waypoints), 1, check))
        self._check_route(answer)

    def _check_route(self, answer: Mapping[str, int]) -> None:
        if answer["status"]:
            names = {number: name for name, number in self._book.choices("ROUTE", "status").items()}
            raise InputError(f"the brick refuses it: {names.get(answer['status'], '?')}", field="route")

    def route(self) -> list[tuple[int, int]]:
        """The route in force, mm."""
        count = self._ask("ROUTE_REQUEST", "ROUTE", (0, 0, 0))["count"]
        answers = [self._ask("WAYPOINT_REQUEST", "WAYPOINT", (index, 0, 0, 0)) for index in range(count)]
        return [(answer["x"], answer["y"]) for answer in answers]

    def command(self, name: str) -> None:
        """start, abort or reset, at the brick's next step.

        Raises:
            InputError: nothing leads from the brick's mode by that command.
        """
        answer = self._ask("MODE_COMMAND", "MODE_REPLY", (self._book.choices("MODE_COMMAND", "command")[name],))
        if answer["status"]:
            modes = {number: mode for mode, number in self._book.choices("MODE_REPLY", "mode").items()}
            raise InputError(f"means nothing in mode {modes[answer['mode']]}", field=name)

    def command_message(self, name: str) -> Frame:
        """The same as a message, for whoever cannot wait for its answer."""
        layout: Layout = self._book.by_name["MODE_COMMAND"]
        return layout.id, layout.seal(self.next_sequence(), self._book.choices("MODE_COMMAND", "command")[name])
