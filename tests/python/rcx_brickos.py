"""brickOS 0.9's program loader behind its LNP receiver, byte by byte, from its headers and its disassembled kernel.

It acknowledges only what it has done: see tools/brickpilot/flash/program.py for what stays without an answer.
"""

from __future__ import annotations

import dataclasses

ACKNOWLEDGE, DELETE, CREATE, DATA, RUN, SET_HOST = 0, 1, 2, 4, 5, 7
SHORTEST = {0: 1, 1: 2, 2: 13, 3: 8, 4: 4, 5: 2, 6: 2, 7: 2}
"""Bytes below which a command is passed over."""
SLOTS = 8
HEAP = 0xAE00, 0xEE00
IDLE_BYTES = 1.5
"""Silence that resets the receiver, in byte times: 7 ms at 2400 baud."""


@dataclasses.dataclass
class Slot:
    """A program as the loader holds it; `text` is its address, 0 for none."""

    text: int = 0
    text_size: int = 0
    data_size: int = 0
    bss_size: int = 0
    stack_size: int = 0
    start: int = 0
    priority: int = 0
    downloaded: int = 0
    image: bytearray = dataclasses.field(default_factory=bytearray)

    @property
    def room(self) -> int:
        return self.text_size + 2 * self.data_size + self.bss_size

    @property
    def valid(self) -> bool:
        return self.text_size > 0 and self.downloaded == self.text_size + self.data_size


class BrickOs:
    """Feed it bytes; it gives the bytes that it sends."""

    def __init__(self, host: int = 0) -> None:
        self.slots = [Slot() for _ in range(SLOTS)]
        self.running: int | None = None
        self.commands: list[bytes] = []
        self._address = host << 4
        self._packet = bytearray()

    def silence(self) -> None:
        """The line was quiet for long enough."""
        self._packet.clear()

    def damaged(self) -> None:
        """A byte came with wrong parity: the packet is lost."""
        self._packet.clear()

    def byte(self, value: int) -> bytes:
        packet = self._packet
        packet.append(value)
        if packet[0] == 0x55:
            if not self._lego_goes_on():
                packet.clear()
            return b""
        if packet[0] & 0xF8 != 0xF0:
            packet.clear()
            return b""
        if len(packet) < 3 or len(packet) < packet[1] + 3:
            return b""
        whole, self._packet = bytes(packet), bytearray()
        right = (0xFF + sum(whole[:-1])) & 0xFF == whole[-1]
        if not right or whole[0] != 0xF1 or whole[1] <= 2 or whole[2] != self._address:
            return b""
        reply = self._command(whole[4:-1])
        if reply is None:
            return b""
        content = bytes([0xF1, len(reply) + 2, whole[3], self._address]) + reply
        return content + bytes([(0xFF + sum(content)) & 0xFF])

    def _lego_goes_on(self) -> bool:
        """Whether what began with 0x55 may still be a message of LEGO's own protocol, and is not complete."""
        packet = self._packet
        if not packet.startswith(b"\x55\xff\x00"[: len(packet)]):
            return False
        pairs = packet[3:]
        if any(low ^ high != 0xFF for low, high in zip(pairs[::2], pairs[1::2], strict=False)):
            return False
        return not pairs or len(pairs) < 2 * (2 + (pairs[0] & 7 if pairs[0] & 7 < 6 else (pairs[0] & 7) - 6))

    def _command(self, data: bytes) -> bytes | None:
        self.commands.append(data)
        kind, acknowledge = data[0], bytes([ACKNOWLEDGE])
        if kind not in SHORTEST or len(data) < SHORTEST[kind]:
            return None
        if kind == SET_HOST:
            self._address = data[1] << 4 & 0xF0
            return acknowledge
        if kind not in (DELETE, CREATE, DATA, RUN) or data[1] >= SLOTS:
            return None
        slot = self.slots[data[1]]
        if kind == DELETE and self.running is None:
            self.slots[data[1]] = Slot()
            return acknowledge
        if kind == CREATE and not slot.text:
            return self._create(data)
        if kind == DATA and slot.text and not slot.valid:
            offset = int.from_bytes(data[2:4], "big")
            if offset == slot.downloaded:
                slot.image[offset : offset + len(data) - 4] = data[4:]
                slot.downloaded += len(data) - 4
            elif offset > slot.downloaded:
                return None
            return acknowledge
        if kind == RUN and slot.valid:
            self.running = data[1]
            return acknowledge
        return None

    def _create(self, data: bytes) -> bytes | None:
        sizes = [int.from_bytes(data[at : at + 2], "big") for at in range(2, 12, 2)]
        slot = Slot(0, *sizes, priority=data[12])
        taken = sorted((other.text, other.text + other.room) for other in self.slots if other.text)
        place = HEAP[0]
        for first, past in [*taken, (HEAP[1], HEAP[1])]:
            if place + slot.room <= first:
                break
            place = past + 4  # malloc's own header
        else:
            return None
        slot.text, slot.image = place, bytearray(slot.text_size + slot.data_size)
        self.slots[data[1]] = slot
        where = place, place + slot.text_size, place + slot.text_size + slot.data_size
        return bytes([ACKNOWLEDGE, data[1]]) + b"".join(address.to_bytes(2, "big") for address in where)
