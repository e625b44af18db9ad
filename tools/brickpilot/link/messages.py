"""Packs and unpacks a link's messages as the DBC defines: raw integers to and from 8 bytes, with CRCs.

cantools needs about 20 us for a message, and a step in lockstep has a dozen messages. So the layouts are read from the
DBC once, and messages are packed by `struct` or by shifts.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import cantools
from cantools.database.can import Database, Message

CODES = {(8, False): "B", (8, True): "b", (16, False): "H", (16, True): "h", (32, False): "I", (32, True): "i"}
SIZE = 8
CRC_AT = 6


class Layout:
    """The layout of one message. `pack` takes raw values in the order of `names`; `unpack` returns them.

    Args:
        message: a message of the DBC with 8 bytes and little-endian signals that do not overlap.
    """

    def __init__(self, message: Message) -> None:
        self.id = message.frame_id
        self.name = message.name
        signals = sorted(message.signals, key=lambda signal: signal.start)
        self.names = tuple(signal.name for signal in signals)
        self._fields = tuple((s.start, (1 << s.length) - 1, 1 << (s.length - 1) if s.is_signed else 0) for s in signals)
        self._struct = _struct([(s.start, s.length, s.is_signed) for s in signals])
        self.pack: Callable[..., bytes] = self._shift_in if self._struct is None else self._struct.pack
        self.unpack: Callable[[bytes], tuple[int, ...]] = (
            self._shift_out if self._struct is None else self._struct.unpack
        )

    def _shift_in(self, *values: int) -> bytes:
        whole = 0
        for value, (start, mask, _) in zip(values, self._fields, strict=True):
            whole |= (value & mask) << start
        return whole.to_bytes(SIZE, "little")

    def _shift_out(self, data: bytes) -> tuple[int, ...]:
        whole = int.from_bytes(data, "little")
        return tuple((((whole >> start) & mask) ^ sign) - sign for start, mask, sign in self._fields)

    def seal(self, *values: int) -> bytes:
        """Packs `values`, without the CRC, and puts the CRC of this message into the last two bytes."""
        data = self.pack(*values, 0)
        return data[:CRC_AT] + struct.pack("<H", crc16(struct.pack("<H", self.id) + data[:CRC_AT]))

    def sealed(self, data: bytes) -> bool:
        """Returns whether the data have 8 bytes and the right CRC."""
        if len(data) != SIZE:
            return False
        return crc16(struct.pack("<H", self.id) + data[:CRC_AT]) == data[6] | data[7] << 8


def _struct(fields: Sequence[tuple[int, int, bool]]) -> struct.Struct | None:
    """Returns the `struct` of fields (start bit, bits, signed), or None if a field does not consist of whole bytes."""
    form, at = "<", 0
    for start, bits, signed in fields:
        if start % 8 or (bits, signed) not in CODES:
            return None
        form += "x" * (start // 8 - at) + CODES[bits, signed]
        at = (start + bits) // 8
    return struct.Struct(form + "x" * (SIZE - at))


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

    def choices(self, message: str, signal: str) -> dict[str, int]:
        """Returns name -> number, for a signal with named values."""
        choices = self.database.get_message_by_name(message).get_signal_by_name(signal).choices
        assert choices is not None
        return {str(name): int(number) for number, name in choices.items()}

    def name(self, message: str, signal: str, number: int, unknown: str = "?") -> str:
        """Returns the name of a signal's number, or `unknown` if the DBC has no name for it."""
        return next((name for name, value in self.choices(message, signal).items() if value == number), unknown)

    def scale(self, message: str, signal: str) -> float:
        """Returns the SI value of one raw unit."""
        return float(self.database.get_message_by_name(message).get_signal_by_name(signal).scale)


@cache
def book() -> Book:
    """Returns the messages of the packaged DBC."""
    return Book(dbc_path().read_bytes())


def dbc_path() -> Path:
    """Returns the path of the packaged DBC, for cantools, SavvyCAN and others."""
    return Path(__file__).parents[1] / "brickpilot.dbc"


def set_crc(sync: bytes, parts: Sequence[bytes]) -> int:
    """Returns the CRC of a set, over SYNC's id, SYNC's first 6 bytes, and the parts in the order of their ids."""
    return crc16(b"".join((struct.pack("<H", book().by_name["SYNC"].id), sync[:CRC_AT], *parts)))
