"""Receives LNP byte by byte as the disassembled kernel of brickOS does.

It shares no code with `brickpilot.link.lnp`, which it tests.
"""

from __future__ import annotations

from typing import NamedTuple

IDLE_BYTES = 1.5
"""Silence, in byte times, after which the receiver waits for a new packet: 7 ms at 2400 baud."""


class Packet(NamedTuple):
    """A packet between two addresses."""

    to: int
    sender: int
    data: bytes

    def on_the_line(self) -> bytes:
        """Returns the bytes of the packet."""
        content = bytes([0xF1, len(self.data) + 2, self.to, self.sender]) + self.data
        return content + bytes([(0xFF + sum(content)) & 0xFF])


class Receiver:
    """Finds the packets in a stream of bytes."""

    def __init__(self) -> None:
        self._packet = bytearray()

    def forget(self) -> None:
        """Waits for a new packet, after a silence or a byte with wrong parity."""
        self._packet.clear()

    def byte(self, value: int) -> Packet | None:
        """Takes one byte. Returns the packet that this byte completes, if the packet's checksum is right."""
        packet = self._packet
        packet.append(value)
        if packet[0] == 0x55:
            if not self._may_be_lego():
                packet.clear()
            return None
        if packet[0] & 0xF8 != 0xF0:
            packet.clear()
            return None
        if len(packet) < 3 or len(packet) < packet[1] + 3:
            return None
        complete, self._packet = bytes(packet), bytearray()
        if (0xFF + sum(complete[:-1])) & 0xFF != complete[-1] or complete[0] != 0xF1 or complete[1] <= 2:
            return None
        return Packet(complete[2], complete[3], complete[4:-1])

    def _may_be_lego(self) -> bool:
        """Returns whether bytes that began with 0x55 can still become a message of LEGO's own protocol."""
        packet = self._packet
        if not packet.startswith(b"\x55\xff\x00"[: len(packet)]):
            return False
        pairs = packet[3:]
        if any(low ^ high != 0xFF for low, high in zip(pairs[::2], pairs[1::2], strict=False)):
            return False
        return not pairs or len(pairs) < 2 * (2 + (pairs[0] & 7 if pairs[0] & 7 < 6 else (pairs[0] & 7) - 6))


class LnpDevice:
    """A device behind an LNP receiver, for `rcx_brick.RcxBrick`. A subclass replies to packets in `_take`."""

    def __init__(self) -> None:
        self._receiver = Receiver()

    def silence(self, _quiet_s: float) -> None:
        self._receiver.forget()

    def damaged(self) -> None:
        self._receiver.forget()

    def byte(self, value: int) -> bytes:
        packet = self._receiver.byte(value)
        return b"" if packet is None else self._take(packet)

    def _take(self, packet: Packet) -> bytes:
        """Returns the bytes that the device sends when it has received `packet`."""
        raise NotImplementedError
