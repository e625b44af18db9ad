"""Messages to the autopilot on an RCX. Each travels in one LNP packet, as in hal/rcx/infrared."""

from __future__ import annotations

import time
from collections.abc import Sequence

from brickpilot.link import lnp
from brickpilot.link.links import LinkGoneError, Message
from brickpilot.link.tower import Tower

HEAD = 3
REPLY_BYTES = 4 + HEAD + 8 + 1
PATIENCE = 4.0
"""While the brick sends telemetry, seven messages of half a second, it receives nothing."""

FIRST_TRIES, TRIES = 3, 10
"""Tries of a request before the first reply of a session, and after it."""


class InfraredLink:
    """A `Link` for requests and replies over an infrared tower, which carries one packet at a time and loses some.

    So `send` waits for the reply, and sends the same packet again if there is none. The brick obeys a repeated request
    once. `damaged` counts the requests that were sent again.

    Args:
        tower: an open tower, which is closed with the link.
    """

    def __init__(self, tower: Tower) -> None:
        self.damaged = 0
        self._tower = tower
        self._sequence = int(time.monotonic() * 10) & 255  # differs from that of the session before
        self._replies: list[Message] = []
        self._connected = False

    def send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            try:
                self._request(*message)
            except TimeoutError as error:
                raise LinkGoneError(str(error)) from error

    def _request(self, identifier: int, data: bytes) -> None:
        """Sends one request until its reply comes, and keeps the reply for `receive`."""
        self._sequence = (self._sequence + 1) & 255
        head = bytes([self._sequence, identifier & 255, identifier >> 8])
        packet = lnp.packet(head + data, lnp.BRICK, lnp.HOST)

        def reply(received: bytes) -> Message | None:
            for found in lnp.each(received, lnp.HOST, lnp.BRICK):
                message = found[1] | found[2] << 8, found[HEAD:]
                if len(found) > HEAD and message[0] == identifier + 1 and message[1][0] == data[0]:
                    return message
            return None

        for attempt in range(TRIES if self._connected else FIRST_TRIES):
            found = self._tower.exchange(packet, reply, REPLY_BYTES, PATIENCE)
            self.damaged += attempt > 0
            if found is not None:
                self._connected = True
                self._replies.append(found)
                return

    def receive(self, timeout: float) -> list[Message]:
        if not self._replies:
            time.sleep(max(0.0, timeout))
        replies, self._replies = self._replies, []
        return replies

    def close(self) -> None:
        self._tower.close()
