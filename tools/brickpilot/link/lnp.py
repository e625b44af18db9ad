"""Packets of brickOS's network protocol, LNP: `F1`, length, destination, source, data and checksum.

An address has 4 bits of host and 4 bits of port. The length counts both addresses and the data. The checksum is 0xFF
plus the sum of all bytes before it.
"""

from __future__ import annotations

from collections.abc import Iterator

HEADER = 0xF1
BRICK, HOST = 0x07, 0x87
"""Addresses of the programs of hal/rcx and of this end: hosts 0 and 8, port 7. Port 0 is the kernel's."""


def address(host: int, port: int = 0) -> int:
    """Returns the address of host 0..15 and port 0..15."""
    return host << 4 | port


def checksum(content: bytes) -> int:
    """Returns the checksum of all bytes before it."""
    return (0xFF + sum(content)) & 0xFF


def packet(data: bytes, to: int, sender: int) -> bytes:
    """Returns a packet with up to 253 bytes of data."""
    content = bytes([HEADER, len(data) + 2, to, sender]) + data
    return content + bytes([checksum(content)])


def each(received: bytes, to: int, sender: int) -> Iterator[bytes]:
    """Yields the data of every complete packet from `sender` to `to`."""
    for at in range(len(received) - 5):
        if received[at] != HEADER or received[at + 2 : at + 4] != bytes([to, sender]):
            continue
        end = at + 2 + received[at + 1]
        if at + 4 < end < len(received) and received[end] == checksum(received[at:end]):
            yield received[at + 4 : end]


def find(received: bytes, to: int, sender: int) -> bytes | None:
    """Returns the data of the first complete packet from `sender` to `to`, or None."""
    return next(each(received, to, sender), None)
