"""LNP, the packets of brickOS on the infrared line, with an address: F1, size + 2, to, from, data, sum."""

from __future__ import annotations

from dataclasses import dataclass

ADDRESSED = 0xF1
INTEGRITY = 0xF0
LONGEST = 253


@dataclass(frozen=True)
class Packet:
    """One packet that came whole. ``to`` and ``source`` are an address (high nibble) and a port (low nibble)."""

    to: int
    source: int
    data: bytes


def checksum(content: bytes) -> int:
    """What stands behind `content`."""
    return (0xFF + sum(content)) & 0xFF


def encode(packet: Packet) -> bytes:
    """The packet as it travels; at most LONGEST bytes of data."""
    if len(packet.data) > LONGEST:
        raise ValueError(f"{len(packet.data)} bytes are more than {LONGEST}")
    content = bytes([ADDRESSED, len(packet.data) + 2, packet.to, packet.source]) + packet.data
    return content + bytes([checksum(content)])


class Decoder:
    """Finds addressed packets in what comes over the line; passes over what is damaged and what has no address."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def take(self, received: bytes) -> list[Packet]:
        """The packets that `received` completes, in order."""
        self._bytes += received
        packets = []
        while self._bytes:
            if self._bytes[0] not in (ADDRESSED, INTEGRITY):
                del self._bytes[0]
                continue
            if len(self._bytes) < 2 or len(self._bytes) < self._bytes[1] + 3:
                break
            end = self._bytes[1] + 2
            content = bytes(self._bytes[:end])
            if checksum(content) != self._bytes[end]:
                del self._bytes[0]
                continue
            del self._bytes[: end + 1]
            if content[0] == ADDRESSED and end >= 4:
                packets.append(Packet(content[2], content[3], content[4:]))
        return packets

    def forget(self) -> None:
        """What has come so far belongs to no packet any more: nothing came for a while."""
        self._bytes.clear()
