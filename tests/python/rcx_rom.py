"""The RCX's ROM as a receiver of firmware, byte by byte, modelled after brickEmu's replacement ROM and RCX Internals.

A sender has to know these rules. Data are written to memory as they arrive, before their complement. A block with
the index of the last block is written over this block. A request with the last opcode repeats the last reply and does
nothing else. The index increases even if a block's checksum was wrong. A wrong complement, a wrong parity or 30 ms of
silence discard an incomplete packet, and the next bytes are read as another packet.
"""

from __future__ import annotations

KNOCK = b"Do you byte, when I knock?\0"
WELCOME = b"Just a bit off the block!"
IDLE_BYTES = 6.5
"""Silence, in byte times, after which the receiver starts anew: 30 ms at 2400 baud."""

_OPCODE, _OPERANDS, _SUM, _BLOCK_SUM, _BLOCK, _END = 2, 3, 4, 5, 6, 99


class Rom:
    """The ROM; a device for `rcx_brick.RcxBrick`. `entry` is the entry address of the started image, or None."""

    def __init__(self, *, broken_sums: int = 0) -> None:
        self.memory = bytearray(0x10000)
        self.entry: int | None = None
        self.requests: list[bytes] = []
        self.blocks: list[int] = []
        """The indices of the accepted blocks, in order."""
        self._broken_sums = broken_sums
        self._last_opcode = 0xFF
        self._reply = b""
        self._begin = self._checksum = 0
        self._pointer = self._saved = 0
        self._sequence, self._next = 0xFFFF, 0
        self._packet = bytearray()
        self._left = self._data_left = self._sum = self._data_sum = 0
        self.silence(0.0)

    def silence(self, _quiet_s: float) -> None:
        """Discards an incomplete packet after a silence."""
        self._state, self._previous, self._complement = _OPCODE, 0xFF, False

    def damaged(self) -> None:
        """Drops a byte with wrong parity, and also its packet, unless the byte belongs to a block."""
        if self._state not in (_BLOCK, _BLOCK_SUM):
            self._state = _OPCODE

    def byte(self, value: int) -> bytes:
        if self._complement:
            self._complement = False
            whole = self._state == _END
            if value ^ 0xFF != self._previous or whole:
                right = value ^ 0xFF == self._previous
                self._state, self._previous = _OPCODE, 0xFF
                return self._frame(self._handle()) if right and whole else b""
            return b""
        if self._state == _OPCODE and value in (0x00, 0x55, 0xFF):
            return b""
        self._previous, self._complement = value, True
        if self._state == _OPCODE:
            self._opcode(value)
        elif self._state == _OPERANDS:
            self._operand(value)
            if self._left == 0:
                self._state = _SUM
        elif self._state == _SUM:
            self._packet.append(value)
            self._state = _END if value == self._sum & 0xFF else _OPCODE
            if self._state == _OPCODE:
                self._previous = 0xFF
        elif self._state == _BLOCK_SUM:
            self._packet += bytes([value, self._data_sum & 0xFF])
            self._sum += value
            self._state = _SUM
        else:
            self._block(value)
        return b""

    def _opcode(self, value: int) -> None:
        self._packet = bytearray([value])
        self._sum = value
        self._left = value & 7 if value & 7 < 6 else (value & 7) - 6
        self._state = _OPERANDS if self._left else _SUM
        if value & 0xF7 == 0x45:
            self._state, self._left, self._data_sum = _BLOCK, 4, 0

    def _operand(self, value: int) -> None:
        self._packet.append(value)
        self._sum += value
        self._left -= 1

    def _block(self, value: int) -> None:
        if self._left:
            self._operand(value)
            if self._left == 0:
                index = int.from_bytes(self._packet[1:3], "little")
                if index == self._sequence:
                    self._pointer = self._saved
                else:
                    self._sequence, self._saved = index, self._pointer
                self._data_left = int.from_bytes(self._packet[3:5], "little")
            return
        self._sum += value
        if self._pointer:
            self.memory[self._pointer] = value
            self._pointer = self._pointer + 1 & 0xFFFF
            self._data_sum += value
        self._data_left = self._data_left - 1 & 0xFFFF
        if self._data_left == 0:
            self._state = _BLOCK_SUM

    def _handle(self) -> bytes | None:
        """Handles a complete packet. Returns the reply, or None without a reply."""
        packet = bytes(self._packet)
        self.requests.append(packet)
        opcode = packet[0]
        if opcode == self._last_opcode:
            return self._reply
        self._last_opcode = opcode
        kind, inverse = opcode & 0xF7, bytes([opcode ^ 0xFF])
        reply: bytes | None = None
        if kind in (0x10, 0x65):
            reply = inverse
        elif kind == 0x15:
            reply = inverse + b"\0\3\0\1" + (b"\0\0\0\0" if self.entry is None else b"\0\3\3\x28")
        elif kind == 0x75:
            self._begin = int.from_bytes(packet[1:3], "little")
            self._checksum = int.from_bytes(packet[3:5], "little")
            self._sequence, self._pointer, self._next = 0xFFFF, 0x8000, 1
            self.memory[0x8000:0xCC00] = bytes(0x4C00)
            self.blocks = []
            reply = inverse + b"\0"
        elif kind == 0x45:
            reply = self._take(packet, inverse)
        elif kind == 0xA5:
            return self._unlock(inverse)
        if reply is not None:
            self._reply = reply
        return reply

    def _take(self, packet: bytes, inverse: bytes) -> bytes | None:
        index = int.from_bytes(packet[1:3], "little")
        wrong = packet[5] != packet[6]
        if index == 0:
            self._pointer = 0
        elif index != self._next:
            return None
        else:
            self._next += 1
        if self._broken_sums:
            self._broken_sums, wrong = self._broken_sums - 1, True
        if not wrong:
            self.blocks.append(index)
        return inverse + (b"\3" if wrong else b"\0")

    def _unlock(self, inverse: bytes) -> bytes | None:
        summed = self.memory[0x8000:0xCC00]
        if sum(summed) & 0xFFFF != self._checksum or KNOCK not in summed:
            self._last_opcode = 0xFF
            return None
        self.entry = self._begin
        return inverse + WELCOME

    @staticmethod
    def _frame(reply: bytes | None) -> bytes:
        if not reply:
            return b""
        checked = reply + bytes([sum(reply) & 0xFF])
        return b"\x55\xff\x00" + bytes(byte for value in checked for byte in (value, value ^ 0xFF))
