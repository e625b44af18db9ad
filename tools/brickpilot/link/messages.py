"""Packs and unpacks a link's messages as the DBC defines: raw integers to and from 8 bytes, with CRCs.

cantools needs about 20 us for a message, and a step in lockstep has a dozen messages. So the layouts are read from the
DBC once, and bitstruct, on which cantools is built, packs raw integers without scales and checks.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import bitstruct.c
import cantools
from cantools.database.can import Database, Message

SIZE = 8
CRC_AT = 6


class Layout:
    """The layout of one message. `pack` takes raw values and `unpack` returns raw values, in the order of `names`.

    Args:
        message: a message of the DBC: 8 bytes; the signals are little-endian, do not overlap, and begin at bit 0.
    """

    def __init__(self, message: Message) -> None:
        self.id = message.frame_id
        self.name = message.name
        self.of_brick = message.senders == ["BRICK"]
        signals = sorted(message.signals, key=lambda signal: signal.start)
        self.names = tuple(signal.name for signal in signals)
        form, top = "", 8 * SIZE  # bitstruct begins with the highest bit, so bytes and signals are in reversed order
        for signal in reversed(signals):
            gap = top - signal.start - signal.length
            form += (f"p{gap}" if gap else "") + ("s" if signal.is_signed else "u") + str(signal.length)
            top = signal.start
        assert top == 0
        self._form = bitstruct.c.compile(form)

    def pack(self, *values: int) -> bytes:
        """Returns the message's data."""
        packed: bytes = self._form.pack(*values[::-1])[::-1]
        return packed

    def unpack(self, data: bytes) -> tuple[int, ...]:
        """Returns the raw value of each signal in `data`, which are 8 bytes."""
        values: tuple[int, ...] = self._form.unpack(data[::-1])[::-1]
        return values

    def seal(self, *values: int) -> bytes:
        """Packs `values`, one for each signal but the CRC, and puts the CRC of the message into the last two bytes."""
        data = self.pack(*values, 0)
        return data[:CRC_AT] + struct.pack("<H", crc16(struct.pack("<H", self.id) + data[:CRC_AT]))

    def sealed(self, data: bytes) -> bool:
        """Returns whether the data have 8 bytes and the right CRC."""
        if len(data) != SIZE:
            return False
        return crc16(struct.pack("<H", self.id) + data[:CRC_AT]) == data[6] | data[7] << 8

    def sequence(self, data: bytes) -> int:
        """Returns the sequence number in the data."""
        return self.unpack(data)[self.names.index("sequence")]

    def answers(self, sequence: int, data: bytes) -> bool:
        """Returns whether the data have 8 bytes, the right CRC and this sequence number."""
        return self.sealed(data) and self.sequence(data) == sequence


def crc16(data: bytes) -> int:
    """Returns the CRC-16/CCITT-FALSE of `data`."""
    return binascii.crc_hqx(data, 0xFFFF)


class Book:
    """Every message by name and by id, and the protocol version and CRC that identify the DBC."""

    def __init__(self, raw: bytes) -> None:
        database = cantools.database.load_string(raw.decode("utf-8"), "dbc")
        assert isinstance(database, Database)
        self.database = database
        self.protocol = int(database.version or "")
        self.crc = crc16(raw)
        layouts = [Layout(message) for message in database.messages]
        self.by_name = {layout.name: layout for layout in layouts}
        self.by_id = {layout.id: layout for layout in layouts}

    def reply_to(self, request: Layout) -> Layout | None:
        """Returns the brick's reply to a message of the host: MOTORS for SYNC, else the next id; None: no reply."""
        reply = self.by_name["MOTORS"] if request.name == "SYNC" else self.by_id.get(request.id + 1)
        return reply if reply is not None and reply.of_brick else None

    def choices(self, message: str, signal: str) -> dict[str, int]:
        """Returns name -> number, for a signal with named values."""
        choices = self.database.get_message_by_name(message).get_signal_by_name(signal).choices
        assert choices is not None
        return {str(name): int(number) for number, name in choices.items()}

    def name(self, message: str, signal: str, number: int, unknown: str = "?") -> str:
        """Returns the name of a signal's number, or `unknown` if the DBC has no name for it."""
        return next((name for name, value in self.choices(message, signal).items() if value == number), unknown)

    def scale(self, message: str, signal: str) -> float:
        """Returns the SI value of one raw unit of a signal."""
        return float(self.database.get_message_by_name(message).get_signal_by_name(signal).scale)


@cache
def book() -> Book:
    """Returns the messages of the packaged DBC."""
    return Book(dbc_path().read_bytes())


def dbc_path() -> Path:
    """Returns the path of the packaged DBC, for cantools, SavvyCAN and others."""
    return Path(__file__).parents[1] / "brickpilot.dbc"


def set_crc(sync: bytes, parts: Sequence[bytes]) -> int:
    """Returns the CRC of SYNC's id, SYNC's first 6 bytes, and `parts`: the data of the other messages, by rising id."""
    return crc16(b"".join((struct.pack("<H", book().by_name["SYNC"].id), sync[:CRC_AT], *parts)))
