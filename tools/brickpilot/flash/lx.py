"""brickOS programs (.lx), as makelx writes them.

A file holds "brickOS" and a zero byte; eight 16-bit numbers, big-endian; the text; the data; and the relocations. The
numbers are the version, the base (the address for which the text was linked), the sizes of text, data, bss and stack in
bytes, the start as an offset in the text, and the number of relocations. A relocation is the offset, from the start of
the text, of a 16-bit address that moves with the text.
"""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

from brickpilot.errors import InputError

MAGIC = b"brickOS\0"
VERSION = 0
ROOM = 0x7000
"""The size of the RCX's memory in bytes. Only the brick knows how much of it is free beside its kernel."""

_HEADER = struct.Struct(">8H")


@dataclasses.dataclass(frozen=True)
class Program:
    """A program. Sizes are in bytes; `image` is the text and the data, linked for `base`."""

    base: int
    text_size: int
    data_size: int
    bss_size: int
    stack_size: int
    start: int
    relocations: tuple[int, ...]
    image: bytes

    @property
    def room(self) -> int:
        """Bytes that the brick reserves. It keeps a second copy of the data for the next start."""
        return self.text_size + 2 * self.data_size + self.bss_size

    def at(self, base: int) -> bytes:
        """Returns text and data, relocated to a text that begins at `base`."""
        moved = bytearray(self.image)
        for place in self.relocations:
            address = int.from_bytes(moved[place : place + 2], "big") + base - self.base
            moved[place : place + 2] = (address & 0xFFFF).to_bytes(2, "big")
        return bytes(moved)


def read(file: Path) -> Program:
    """Reads and checks a program.

    Raises:
        InputError: the file is no valid program; the message names the fault.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    if not content.startswith(MAGIC):
        raise InputError('is no brickOS program: it does not begin with "brickOS"', file=file)
    body = content[len(MAGIC) :]
    if len(body) < _HEADER.size:
        raise InputError("ends within its header", file=file)
    version, base, text, data, bss, stack, start, count = _HEADER.unpack_from(body)
    if version != VERSION:
        raise InputError(f"has format version {version}; only version {VERSION} is supported", file=file)
    expected = len(MAGIC) + _HEADER.size + text + data + 2 * count
    if len(content) != expected:
        raise InputError(f"has {len(content)} bytes, but its header gives {expected}", file=file)
    image, table = body[_HEADER.size : _HEADER.size + text + data], body[_HEADER.size + text + data :]
    relocations = struct.unpack(f">{count}H", table)
    if any(place + 2 > text + data for place in relocations):
        raise InputError("has a relocation outside its text and data", file=file)
    if start >= text:
        raise InputError(f"starts at {start}, beyond its {text} bytes of text", file=file)
    program = Program(base, text, data, bss, stack, start, relocations, image)
    if program.room + stack > ROOM:
        raise InputError(f"needs {program.room + stack} bytes, which is too large for the RCX's {ROOM}", file=file)
    return program
