"""Packets of brickOS's network protocol, LNP: `F1`, length, destination, source, data, checksum.

An address is 4 bits of host and 4 bits of port; the length counts both addresses; the checksum is 0xFF plus the sum of
all before it.
"""

from __future__ import annotations

from collections.abc import Iterator

HEADER = 0xF1
BRICK, HOST = 0x07, 0x87
"""Addresses of the programs of hal/rcx, and of who speaks to them: hosts 0 and 8, port 7. Port 0 is the kernel's."""


def address(host: int, port: int = 0) -> int:
    """The byte of host 0..15 and port 0..15."""
    return host << 4 | port


def checksum(content: bytes) -> int:
    """Of all bytes before it."""
    return (0xFF + sum(content)) & 0xFF


def packet(data: bytes, to: int, sender: int) -> bytes:
    """Carries up to 253 bytes of data."""
    content = bytes([HEADER, len(data) + 2, to, sender]) + data
    return content + bytes([checksum(content)])


def each(heard: bytes, to: int, sender: int) -> Iterator[bytes]:
    """The data of every whole packet from `sender` to `to`."""
    for at in range(len(heard) - 5):
        if heard[at] != HEADER or heard[at + 2 : at + 4] != bytes([to, sender]):
            continue
        end = at + 2 + heard[at + 1]
        if at + 4 < end < len(heard) and heard[end] == checksum(heard[at:end]):
            yield heard[at + 4 : end]


def find(heard: bytes, to: int, sender: int) -> bytes | None:
    """The data of the first of them."""
    return next(each(heard, to, sender), None)
