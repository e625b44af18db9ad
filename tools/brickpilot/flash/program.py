"""brickOS's program loader, as dll speaks to it: delete, create, data, run, each acknowledged over LNP.

What brickOS 0.9 leaves without an acknowledgement: `delete` while a program runs; `create` where a program is already
(so too when it is sent again) and where memory is short; `data` beyond what it has, and any `data` once the program is
whole. `data` that it has already it acknowledges and forgets. An acknowledgement does not say of what.

Two packets need 7 ms of silence between them, as `Tower.exchange` leaves: where damage makes a byte of data pass for a
length, the receiver reads on until the line is silent, and past its buffer begins the table of the programs.

Sources: brickOS 0.9.0, its headers and its loader, compared with the kernel of Debian's package, disassembled.
"""

from __future__ import annotations

from brickpilot.errors import InputError
from brickpilot.flash.lx import Program
from brickpilot.flash.tally import Progress, Tally
from brickpilot.link import lnp
from brickpilot.link.tower import Tower

ACKNOWLEDGE, DELETE, CREATE, DATA, RUN, SET_HOST = 0, 1, 2, 4, 5, 7
SLOTS = 8
HOST = 8
"""This end's host address, dll's."""
PRIORITY = 10
"""Of the program's first task, as dll has it."""

LONGEST = 0xF8
"""Bytes of program in a packet, as dll sends them."""
SHORTEST = 8
TRIES_PRESENT = 10
TRIES = 40
ROUNDS = 8
_SILENT = 6
"""Tries in a row after which the program may be whole rather than the line bad."""


class Loader:
    """The loader of the brick before `tower`.

    Args:
        tower: where to speak.
        host: the brick's LNP address, 0..15.
    """

    def __init__(self, tower: Tower, host: int = 0) -> None:
        self._tower = tower
        self._host = host

    def alive(self, tries: int = TRIES_PRESENT) -> bool:
        """Whether brickOS answers: it is given the address that it has."""
        return self._ask(bytes([SET_HOST, self._host]), tries) is not None

    def delete(self, slot: int) -> bool:
        """Empties `slot`, 0..7; False when that was not acknowledged."""
        return self._ask(bytes([DELETE, slot]), TRIES_PRESENT) is not None

    def run(self, slot: int) -> None:
        """Starts the program of `slot`.

        Raises:
            TimeoutError: that was not acknowledged.
        """
        if self._ask(bytes([RUN, slot]), TRIES_PRESENT, patience=4) is None:
            raise TimeoutError(f"{self._tower.device}: the program is on the brick, which does not confirm its start")

    def send(self, program: Program, slot: int, tally: Tally, progress: Progress) -> int:
        """Puts `program` into the empty `slot`, 0..7.

        Returns:
            The address of its text.

        Raises:
            InputError: the brick has no room.
            TimeoutError: it stopped answering.
        """
        base = self._create(program, slot)
        self._send_data(program.at(base), slot, tally, progress)
        return base

    def _create(self, program: Program, slot: int) -> int:
        sizes = (program.text_size, program.data_size, program.bss_size, program.stack_size, program.start)
        command = bytes([CREATE, slot]) + b"".join(size.to_bytes(2, "big") for size in sizes) + bytes([PRIORITY])
        for _ in range(ROUNDS):
            reply = self._exchange(command, 8)
            if reply is not None and len(reply) == 8 and reply[1] == slot:
                text, data, bss = (int.from_bytes(reply[at : at + 2], "big") for at in (2, 4, 6))
                if (data, bss) == (text + program.text_size, text + program.text_size + program.data_size):
                    return text
            if not self.delete(slot):  # an acknowledgement that was lost cannot be had again
                raise self._tower.lost()
        raise InputError(
            f"the brick refuses the program: too large, no room for its {program.room} bytes; other programs may be "
            "deleted with dll -d",
            field=self._tower.device,
        )

    def _send_data(self, image: bytes, slot: int, tally: Tally, progress: Progress) -> None:
        at, size = 0, LONGEST
        ends: set[int] = set()  # of packets that may have arrived though nothing said so: none may reach across them
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
                if attempt % _SILENT == _SILENT - 1 and len(image) in ends and self._whole(image, slot):
                    return
            else:
                raise self._tower.lost(f" after {at} of {len(image)} bytes")
            at += length
            size = length if attempt else min(LONGEST, size + max(4, size // 4))

    def _whole(self, image: bytes, slot: int) -> bool:
        """Whether the last acknowledgement was lost: the brick answers, but not to data, of which it has all."""
        old = bytes([DATA, slot, 0, 0]) + image[:1]
        answers = 0
        for _ in range(ROUNDS):
            if self._exchange(old, 1) is not None:
                return False
            answers += self.alive(1)
        return answers >= ROUNDS // 2

    def _ask(self, command: bytes, tries: int, patience: float = 1.0) -> bytes | None:
        for _ in range(tries):
            reply = self._exchange(command, 1, patience)
            if reply is not None:
                return reply
        return None

    def _exchange(self, command: bytes, reply_length: int, patience: float = 1.0) -> bytes | None:
        here, brick = lnp.address(HOST), lnp.address(self._host)

        def acknowledged(heard: bytes) -> bytes | None:
            data = lnp.find(heard, here, brick)
            return data if data is not None and data[0] == ACKNOWLEDGE else None

        return self._tower.exchange(lnp.packet(command, brick, here), acknowledged, 5 + reply_length, patience)
