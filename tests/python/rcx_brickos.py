"""The program loader of brickOS 0.9 behind its LNP receiver, modelled on its headers and its disassembled kernel.

The loader acknowledges only commands that it obeys; tools/brickpilot/flash/program.py lists the other cases.
"""

from __future__ import annotations

import dataclasses

from rcx_lnp import LnpDevice, Packet

ACKNOWLEDGE, DELETE, CREATE, DATA, RUN, SET_HOST = 0, 1, 2, 4, 5, 7
SHORTEST = {0: 1, 1: 2, 2: 13, 3: 8, 4: 4, 5: 2, 6: 2, 7: 2}
"""Command -> its least number of bytes; a shorter command is ignored."""
SLOTS = 8
HEAP = 0xAE00, 0xEE00


@dataclasses.dataclass
class Slot:
    """A program as the loader holds it. `text` is its address; 0 means no program."""

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


class BrickOs(LnpDevice):
    """A brick with brickOS; a device for `rcx_brick.RcxBrick`."""

    def __init__(self, host: int = 0) -> None:
        super().__init__()
        self.slots = [Slot() for _ in range(SLOTS)]
        self.running: int | None = None
        self.commands: list[bytes] = []
        self._address = host << 4

    def _take(self, packet: Packet) -> bytes:
        if packet.to != self._address:
            return b""
        reply = self._command(packet.data)
        return b"" if reply is None else Packet(packet.sender, packet.to, reply).on_the_line()

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
