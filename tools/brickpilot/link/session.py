"""A session with a brick: requests and replies, settings, routes and commands; and the detection of restarts."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Sequence
from functools import partial

from brickpilot.errors import InputError, SimulationError
from brickpilot.link.links import Link, Message
from brickpilot.link.messages import book, crc16
from brickpilot.vehicle.settings import named

REPLY_S = 0.25
TRIES = 4
OPEN_TRIES = 8

LOCKSTEP, REALTIME = "lockstep", "realtime"


class NoReplyError(SimulationError):
    """The brick did not reply to a request, although the request was sent several times."""


class Session:
    """Sends requests over a link, one at a time. Every reply carries the sequence number of its request.

    Args:
        link: an open link.
        spec: the link as the user named it, for error messages.
        other: called with (id, data) of every message that is not the expected reply.
        reply_s: time in s to wait for a reply before the request is sent again.
        clock: function that returns the time in s, for `reply_s`.
    """

    def __init__(
        self,
        link: Link,
        spec: str,
        other: Callable[[int, bytes], None] = lambda _id, _data: None,
        reply_s: float = REPLY_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.link = link
        self.now = clock
        self.spec = spec
        self.other = other
        self.reply_s = reply_s
        self.repeated = 0  # number of requests that were sent again
        self.resets = ResetWatch()  # the owner of the session passes the messages of `other` to this object
        self._book = book()
        self._sequence = 0

    def next_sequence(self) -> int:
        """Returns the next sequence number, 0..255."""
        self._sequence = (self._sequence + 1) & 255
        return self._sequence

    def wait(self, identifier: int, accept: Callable[[bytes], bool], timeout: float) -> bytes | None:
        """Returns the data of the first message with this id that `accept` accepts, or None after `timeout` s."""
        reply: bytes | None = None
        until = self.now() + timeout
        while reply is None:
            left = until - self.now()
            if left <= 0:
                return None
            for frame_id, data in self.link.receive(left):
                if reply is None and frame_id == identifier and accept(data):
                    reply = data
                else:
                    self.other(frame_id, data)
        return reply

    def _request(self, request: str, values: Sequence[int], tries: int = TRIES) -> dict[str, int]:
        """Sends a request up to `tries` times and returns the signals of its reply."""
        out = self._book.by_name[request]
        back = self._book.reply_to(out)
        assert back is not None
        for attempt in range(tries):
            sequence = self.next_sequence()
            self.link.send([(out.id, out.seal(sequence, *values))])
            data = self.wait(back.id, partial(back.answers, sequence), self.reply_s)
            self.repeated += attempt > 0
            if data is not None:
                return dict(zip(back.names, back.unpack(data), strict=True))
        raise NoReplyError(f"{self.spec}: the brick does not reply to {request}")

    def open(self, profile: str, pace: str) -> None:
        """Begins a session. The brick then has the constants of `profile` and no route; its motors are off.

        Raises:
            InputError: no brick replies, the brick has another protocol or DBC, or lacks the profile or the pace.
        """
        profiles, paces = self._book.choices("OPEN", "profile"), self._book.choices("OPEN", "pace")
        values = (self._book.protocol, self._book.crc, profiles[profile], paces[pace])
        began = self.now()
        before = self.repeated
        try:
            hello = self._request("OPEN", values, OPEN_TRIES)
        except NoReplyError:
            seconds = round(self.now() - began)
            raise InputError(f"no brick has replied for {seconds} s", field=f"--link {self.spec}") from None
        status = self._book.name("HELLO", "status", hello["status"], f"status {hello['status']}")
        reasons = {
            "protocol_differs": f"the brick speaks protocol {hello['protocol']}, this program {self._book.protocol}; "
            "use the same version at both ends",
            "dbc_differs": f"the brick was built with another brickpilot.dbc (CRC {hello['dbc']:04X}, here "
            f"{self._book.crc:04X}); use the same version at both ends",
            "no_such_profile": f"the brick has no constants for the profile {profile}",
            "no_such_pace": f"the brick cannot run in {pace}",
        }
        if status != "ok":
            raise InputError(reasons.get(status, f"the brick refuses: {status}"), field=f"--link {self.spec}")
        self.resets.opened(self.repeated - before)

    def read(self, name: str) -> int:
        """Returns the raw value of a setting.

        Raises:
            InputError: no setting has that name.
        """
        return self._parameter(name, 0, 0)

    def write(self, name: str, value: int) -> None:
        """Writes the raw value of a setting.

        Raises:
            InputError: no setting has that name, the value is out of its range, or the robot drives.
        """
        named(name).check(value)
        self._parameter(name, 1, value)

    def _parameter(self, name: str, write: int, value: int) -> int:
        reply = self._request("PARAMETER_REQUEST", (named(name).number, write, value))
        self._check(reply["status"], name, value)
        return reply["value"]

    def _check(self, status: int, field: str, value: object) -> None:
        if status:
            reasons = ("is unknown to the brick", f"{value} is out of range", "cannot change while the robot drives")
            raise InputError(reasons[status - 1], field=field)

    def upload(self, waypoints: Sequence[tuple[int, int]]) -> None:
        """Sends a route in mm. The brick accepts the whole route, or keeps the old route.

        Raises:
            InputError: the brick refuses a waypoint or the whole route.
        """
        for index, (x, y) in enumerate(waypoints):
            if not (-32768 <= x <= 32767 and -32768 <= y <= 32767):
                raise InputError(f"({x}, {y}) mm is out of range", field=f"waypoint {index}")
            reply = self._request("WAYPOINT_REQUEST", (index, 1, x, y))
            self._check(reply["status"], f"waypoint {index}", f"({x}, {y}) mm")
        crc = crc16(b"".join(struct.pack("<hh", x, y) for x, y in waypoints))
        if status := self._request("ROUTE_REQUEST", (len(waypoints), 1, crc))["status"]:
            raise InputError(f"the brick refuses it: {self._book.name('ROUTE', 'status', status)}", field="route")

    def route(self) -> list[tuple[int, int]]:
        """Returns the route that the brick holds, in mm."""
        count = self._request("ROUTE_REQUEST", (0, 0, 0))["count"]
        replies = [self._request("WAYPOINT_REQUEST", (index, 0, 0, 0)) for index in range(count)]
        return [(reply["x"], reply["y"]) for reply in replies]

    def command(self, name: str) -> None:
        """Sends the command start, abort or reset, which acts at the brick's next step.

        Raises:
            InputError: the command is not valid in the brick's mode.
        """
        reply = self._request("MODE_COMMAND", (self._book.choices("MODE_COMMAND", "command")[name],))
        if reply["status"]:
            mode = self._book.name("MODE_REPLY", "mode", reply["mode"])
            raise InputError(f"has no meaning in mode {mode}", field=name)

    def command_message(self, name: str) -> Message:
        """Returns the command as a message, for callers that cannot wait for the reply."""
        layout = self._book.by_name["MODE_COMMAND"]
        return layout.id, layout.seal(self.next_sequence(), self._book.choices("MODE_COMMAND", "command")[name])


HEARTBEAT_TICKS = 100
"""Number of ticks between two HEARTBEATs of a brick in real time; tick 0 sends the first (firmware/app/loop.c)."""


class ResetWatch:
    """Detects that the brick's session began again, because an OPEN arrived twice or another host opened a session.

    There are two signs. First, more HELLOs arrive than this session has sent OPENs, because a HELLO answers each OPEN.
    Second, the tick of HEARTBEAT decreases, because this tick counts from OPEN. HEARTBEAT has no CRC, so only ticks
    that are multiples of `HEARTBEAT_TICKS` are used.
    """

    def __init__(self) -> None:
        by = book().by_name
        self._hello, self._heartbeat = by["HELLO"], by["HEARTBEAT"]
        self._watching = False
        self._due = 0  # number of replies to repeats of OPEN that may still arrive
        self._newest_tick = 0
        self.reset = False

    def opened(self, repeats: int) -> None:
        """Takes note that an OPEN opened the session, and that this OPEN was sent again `repeats` times."""
        self._watching, self._due, self._newest_tick, self.reset = False, repeats, 0, False

    def begin(self) -> None:
        """Starts the detection; from now on only this session may send to the brick."""
        self._watching = True

    def take(self, identifier: int, data: bytes) -> None:
        """Handles a message that answers no request; sets `reset` if the message shows that the brick restarted."""
        if identifier == self._hello.id and self._hello.sealed(data):
            if self._due > 0:
                self._due -= 1
            else:
                self.reset = self.reset or self._watching
        elif identifier == self._heartbeat.id and len(data) == 8 and self._watching:
            tick = self._heartbeat.unpack(data)[self._heartbeat.names.index("tick")]
            if tick % HEARTBEAT_TICKS == 0:
                self.reset = self.reset or tick < self._newest_tick
                self._newest_tick = tick
