"""The protocol of brickOS's program loader, as in the tool dll: delete, create, data and run over LNP.

brickOS acknowledges each command, but an acknowledgement does not name its command. brickOS 0.9 does not acknowledge:

- `delete` while a program runs;
- `create` if the slot holds a program (so a repeated `create` is not acknowledged, either), or if memory is short;
- `data` that leave a gap after the data that have arrived, and all `data` after the program is complete.

brickOS acknowledges `data` that have arrived before, and ignores them.

`Tower.exchange` leaves 7 ms of silence between two packets. The silence is needed because a damaged byte may look like
a length. Then the brick reads on until the line is silent, and may overwrite the table of programs behind its receive
buffer.

Sources: the headers and the loader of brickOS 0.9.0, compared with the disassembled kernel of Debian's package.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from brickpilot.errors import InputError
from brickpilot.flash.image_files import Program
from brickpilot.link import lnp
from brickpilot.link.tower import Tower

Progress = Callable[[int, int, str], None]
"""Called with (bytes arrived, all bytes, text)."""


@dataclasses.dataclass
class Tally:
    """Number of packets with parts of the image, and number of those packets that were sent again."""

    packets: int = 0
    sent_again: int = 0

    def tried(self, again: bool) -> None:
        """Counts one packet."""
        self.packets += 1
        self.sent_again += again


ACKNOWLEDGE, DELETE, CREATE, DATA, RUN, SET_HOST = 0, 1, 2, 4, 5, 7
HOST = 8
"""The host address of this end, the same as in dll."""
PRIORITY = 10
"""The priority of the program's first task, the same as in dll."""

LONGEST = 0xF8
"""Largest number of program bytes in a packet, the same as in dll."""
SHORTEST = 8
TRIES_PRESENT = 10
TRIES = 40
ROUNDS = 8
_SILENT = 6
"""Number of failed tries in a row after which the loader asks whether the program is complete already."""


class Loader:
    """Speaks to the loader of a brick.

    Args:
        tower: the tower that faces the brick.
        host: the brick's LNP address, 0..15.
    """

    def __init__(self, tower: Tower, host: int = 0) -> None:
        self._tower = tower
        self._host = host

    def alive(self, tries: int = TRIES_PRESENT) -> bool:
        """Returns whether brickOS replies. The request sets the brick's address to its present value."""
        return self._exchange(bytes([SET_HOST, self._host]), 1, tries=tries) is not None

    def delete(self, slot: int) -> bool:
        """Deletes the program in `slot`, 0..7. Returns False if the brick did not acknowledge the deletion."""
        return self._exchange(bytes([DELETE, slot]), 1, tries=TRIES_PRESENT) is not None

    def run(self, slot: int) -> None:
        """Starts the program in `slot`.

        Raises:
            TimeoutError: the brick did not acknowledge the start.
        """
        if self._exchange(bytes([RUN, slot]), 1, patience=4, tries=TRIES_PRESENT) is None:
            raise TimeoutError(
                f"{self._tower.device}: the program is on the brick, but the brick did not confirm its start"
            )

    def send(self, program: Program, slot: int, tally: Tally, progress: Progress) -> int:
        """Sends `program` to the empty `slot`, 0..7.

        Returns:
            The address of the program's text.

        Raises:
            InputError: the brick has no room.
            TimeoutError: the brick stopped replying.
        """
        base = self._create(program, slot)
        self._send_data(program.at(base), slot, tally, progress)
        return base

    def _create(self, program: Program, slot: int) -> int:
        """Creates the slot's program and returns the address of its text."""
        sizes = (program.text_size, program.data_size, program.bss_size, program.stack_size, program.start)
        command = bytes([CREATE, slot]) + b"".join(size.to_bytes(2, "big") for size in sizes) + bytes([PRIORITY])
        for _ in range(ROUNDS):
            reply = self._exchange(command, 8)
            if reply is not None and len(reply) == 8 and reply[1] == slot:
                text, data, bss = (int.from_bytes(reply[at : at + 2], "big") for at in (2, 4, 6))
                if (data, bss) == (text + program.text_size, text + program.text_size + program.data_size):
                    return text
            if not self.delete(slot):  # the brick does not repeat a lost acknowledgement
                raise self._tower.lost()
        raise InputError(
            f"the brick refuses the program: it has no room for {program.room} bytes (dll -d deletes programs)",
            field=self._tower.device,
        )

    def _send_data(self, image: bytes, slot: int, tally: Tally, progress: Progress) -> None:
        """Sends the image in packets. A failed packet is sent again, shorter from the third time on."""
        at, size = 0, LONGEST
        ends: set[int] = set()  # ends of packets that may have arrived unacknowledged; no packet may cross such an end
        while at < len(image):
            progress(at, len(image), "program")
            ends = {end for end in ends if end > at}
            length = min(size, min(ends, default=len(image)) - at)
            for attempt in range(TRIES):
                if attempt > 1:
                    length = max(min(length, SHORTEST), length // 2)
                tally.tried(again=attempt > 0)
                command = bytes([DATA, slot]) + at.to_bytes(2, "big") + image[at : at + length]
                if self._exchange(command, 1) is not None:
                    break
                ends.add(at + length)
                if attempt % _SILENT == _SILENT - 1 and len(image) in ends and self._complete(image, slot):
                    return
            else:
                raise self._tower.lost(f" after {at} of {len(image)} bytes")
            at += length
            size = length if attempt else min(LONGEST, size + max(4, size // 4))

    def _complete(self, image: bytes, slot: int) -> bool:
        """Returns whether the program is complete. Then the brick replies, but acknowledges no data."""
        old = bytes([DATA, slot, 0, 0]) + image[:1]
        replies = 0
        for _ in range(ROUNDS):
            if self._exchange(old, 1) is not None:
                return False
            replies += self.alive(1)
        return replies >= ROUNDS // 2

    def _exchange(self, command: bytes, reply_length: int, patience: float = 1.0, tries: int = 1) -> bytes | None:
        """Sends a command up to `tries` times. Returns the data of its acknowledgement, or None."""
        here, brick = lnp.address(HOST), lnp.address(self._host)

        def acknowledged(received: bytes) -> bytes | None:
            data = lnp.find(received, here, brick)
            return data if data is not None and data[0] == ACKNOWLEDGE else None

        packet = lnp.packet(command, brick, here)
        for _ in range(tries):
            reply = self._tower.exchange(packet, acknowledged, 5 + reply_length, patience)
            if reply is not None:
                return reply
        return None
