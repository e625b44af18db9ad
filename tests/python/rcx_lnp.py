"""LNP as brickOS's kernel receives it, byte by byte, from its disassembly.

It shares nothing with `brickpilot.link.lnp`, which it tests.
"""

from __future__ import annotations

from typing import NamedTuple

IDLE_BYTES = 1.5
"""Silence that resets the receiver, in byte times: 7 ms at 2400 baud."""


class Packet(NamedTuple):
    to: int
    sender: int
    data: bytes

    def on_the_line(self) -> bytes:
        content = bytes([0xF1, len(self.data) + 2, self.to, self.sender]) + self.data
        return content + bytes([(0xFF + sum(content)) & 0xFF])


class Receiver:
    """Feed it bytes."""

    def __init__(self) -> None:
        self._packet = bytearray()

    def forget(self) -> None:
        """The line was quiet for long enough, or a byte came with wrong parity."""
        self._packet.clear()

    def byte(self, value: int) -> Packet | None:
        """The addressed packet that is whole with this byte, and right."""
        packet = self._packet
        packet.append(value)
        if packet[0] == 0x55:
            if not self._lego_goes_on():
                packet.clear()
            return None
        if packet[0] & 0xF8 != 0xF0:
            packet.clear()
            return None
        if len(packet) < 3 or len(packet) < packet[1] + 3:
            return None
        whole, self._packet = bytes(packet), bytearray()
        if (0xFF + sum(whole[:-1])) & 0xFF != whole[-1] or whole[0] != 0xF1 or whole[1] <= 2:
            return None
        return Packet(whole[2], whole[3], whole[4:-1])

    def _lego_goes_on(self) -> bool:
        """Whether what began with 0x55 may still be a message of LEGO's own protocol, and is not complete."""
        packet = self._packet
        if not packet.startswith(b"\x55\xff\x00"[: len(packet)]):
            return False
        pairs = packet[3:]
        if any(low ^ high != 0xFF for low, high in zip(pairs[::2], pairs[1::2], strict=False)):
            return False
        return not pairs or len(pairs) < 2 * (2 + (pairs[0] & 7 if pairs[0] & 7 < 6 else (pairs[0] & 7) - 6))
