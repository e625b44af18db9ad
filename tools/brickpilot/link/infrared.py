"""Messages to the autopilot on an RCX, one in a packet of LNP, as hal/rcx/infrared has them."""

from __future__ import annotations

import time
from collections.abc import Sequence

from brickpilot.link import lnp
from brickpilot.link.links import Frame, LinkGoneError
from brickpilot.link.tower import Tower

HEAD = 3
ANSWER_BYTES = 4 + HEAD + 8 + 1
PATIENCE = 4.0
"""The brick may be sending telemetry, seven messages of half a second, and is deaf for so long."""

FIRST_TRIES, TRIES = 3, 10
"""How often a request is sent before anything has been heard, and after."""


class InfraredLink:
    """A `hil.links.Link` for requests and answers: the line carries one thing at a time, and loses some.

    ``send`` therefore waits for the answer, and sends the same packet again where it does not come: the brick obeys
    once. ``damaged``: requests that had to be sent again.

    Args:
        tower: closed with the link.
    """

    def __init__(self, tower: Tower) -> None:
        self.damaged = 0
        self._tower = tower
        self._sequence = int(time.monotonic() * 10) & 255  # not that of the session before
        self._answers: list[Frame] = []
        self._heard = False

    def send(self, frames: Sequence[Frame]) -> None:
        for frame in frames:
            try:
                self._ask(*frame)
            except TimeoutError as error:
                raise LinkGoneError(str(error)) from error

    def _ask(self, identifier: int, data: bytes) -> None:
        self._sequence = (self._sequence + 1) & 255
        head = bytes([self._sequence, identifier & 255, identifier >> 8])
        packet = lnp.packet(head + data, lnp.BRICK, lnp.HOST)

        def answer(heard: bytes) -> Frame | None:
            for found in lnp.each(heard, lnp.HOST, lnp.BRICK):
                frame = found[1] | found[2] << 8, found[HEAD:]
                if len(found) > HEAD and frame[0] == identifier + 1 and frame[1][0] == data[0]:
                    return frame
            return None

        for attempt in range(TRIES if self._heard else FIRST_TRIES):
            found = self._tower.exchange(packet, answer, ANSWER_BYTES, PATIENCE)
            self.damaged += attempt > 0
            if found is not None:
                self._heard = True
                self._answers.append(found)
                return

    def receive(self, timeout: float) -> list[Frame]:
        if not self._answers:
            time.sleep(max(0.0, timeout))
        answers, self._answers = self._answers, []
        return answers

    def close(self) -> None:
        self._tower.close()
