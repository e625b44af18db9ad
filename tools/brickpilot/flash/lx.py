"""brickOS programs (.lx), as makelx writes them.

"brickOS" and a zero; eight 16-bit numbers, big-endian: version, base (where the text was linked), sizes of text, data,
bss and stack in bytes, start (from the text), number of relocations; text; data; relocations. Each of these is the
offset, from the start of the text, of a 16-bit address that moves with the text.
"""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

from brickpilot.errors import InputError

MAGIC = b"brickOS\0"
VERSION = 0
ROOM = 0x7000
"""The RCX's memory in bytes, all of it; the brick itself says whether there is room beside its kernel."""

_HEADER = struct.Struct(">8H")


@dataclasses.dataclass(frozen=True)
class Program:
    """Sizes in bytes; `image` is text and data, linked for `base`."""

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
        """Bytes that the brick sets aside: it keeps a second copy of the data for the next start."""
        return self.text_size + 2 * self.data_size + self.bss_size

    def at(self, base: int) -> bytes:
        """Text and data as they stand when the text begins at `base`."""
        moved = bytearray(self.image)
        for place in self.relocations:
            address = int.from_bytes(moved[place : place + 2], "big") + base - self.base
            moved[place : place + 2] = (address & 0xFFFF).to_bytes(2, "big")
        return bytes(moved)


def read(file: Path) -> Program:
    """Reads and checks a program.

    Raises:
        InputError: naming what is wrong with it.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    if not content.startswith(MAGIC):
        raise InputError('is no brickOS program: it does not begin with "brickOS"', file=file)
    body = content[len(MAGIC) :]
    if len(body) < _HEADER.size:
        raise InputError("is cut short in its header", file=file)
    version, base, text, data, bss, stack, start, count = _HEADER.unpack_from(body)
    if version != VERSION:
        raise InputError(f"has format version {version}; version {VERSION} is known", file=file)
    expected = len(MAGIC) + _HEADER.size + text + data + 2 * count
    if len(content) != expected:
        raise InputError(f"has {len(content)} bytes, its header says {expected}", file=file)
    image, table = body[_HEADER.size : _HEADER.size + text + data], body[_HEADER.size + text + data :]
    relocations = struct.unpack(f">{count}H", table)
    if any(place + 2 > text + data for place in relocations):
        raise InputError("relocates what lies outside its text and data", file=file)
    if start >= text:
        raise InputError(f"starts at {start}, behind its {text} bytes of text", file=file)
    program = Program(base, text, data, bss, stack, start, relocations, image)
    if program.room + stack > ROOM:
        raise InputError(f"needs {program.room + stack} bytes, too large for the RCX's {ROOM}", file=file)
    return program
