"""Files with images for an RCX: firmware as Motorola S-records, and brickOS programs (.lx) of makelx.

Firmware is checked against the rules of the RCX's ROM before it is sent. The ROM loads one block of memory from 0x8000
upwards. It sums the bytes below 0xCC00, and looks for its string in these bytes. The ROM's own variables begin at
0xEE5E (K. Proudfoot, RCX Internals, and lugnet.robotics, n=13499).

A .lx file holds "brickOS" and a zero byte; eight 16-bit numbers, big-endian; the text; the data; and the relocations.
The numbers are the version, the base (the address for which the text was linked), the sizes of text, data, bss and
stack in bytes, the start as an offset in the text, and the number of relocations. A relocation is the offset, from the
start of the text, of a 16-bit address that moves with the text.
"""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

from brickpilot.errors import InputError

START = 0x8000
"""The address of an image's first byte."""
SUMMED_END = 0xCC00
"""The end of the memory that the ROM sums and searches."""
END = 0xEE5E
"""The start of the ROM's own variables, which the ROM uses while an image arrives."""
KNOCK = b"Do you byte, when I knock?\0"
"""The ROM starts an image only if this string, with its zero byte, is below SUMMED_END."""

MAGIC = b"brickOS\0"
"""The beginning of a program's file."""

_ADDRESS_BYTES = {"1": 2, "2": 3, "3": 4}
_ENTRY_BYTES = {"9": 2, "8": 3, "7": 4}


@dataclasses.dataclass(frozen=True)
class Image:
    """A firmware image: `data` begins at START and is 0 where the file has no data; `entry`: where it starts."""

    data: bytes
    entry: int

    @property
    def checksum(self) -> int:
        """The 16-bit sum of the bytes from START to SUMMED_END, as the ROM computes it."""
        return sum(self.data[: SUMMED_END - START]) & 0xFFFF


def _record(line: str, file: Path, number: int) -> tuple[str, bytes]:
    """Checks count and sum of one S-record; returns the record's type and its bytes (address and data)."""
    if len(line) < 4 or line[0] != "S" or not line[1].isdigit():
        raise InputError(f"is no S-record: {line[:20]!r}", file=file, line=number)
    try:
        content = bytes.fromhex(line[2:])
    except ValueError:
        raise InputError(
            "is no S-record: it needs an even number of hexadecimal digits", file=file, line=number
        ) from None
    if content[0] != len(content) - 1:
        raise InputError(f"gives its length as {content[0]} bytes, but has {len(content) - 1}", file=file, line=number)
    right = 0xFF - (sum(content[:-1]) & 0xFF)
    if content[-1] != right:
        raise InputError(
            f"has the wrong checksum {content[-1]:02X}; its bytes give {right:02X}", file=file, line=number
        )
    return line[1], content[1:-1]


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None


def read_firmware(file: Path) -> Image:
    """Reads and checks an image.

    Raises:
        InputError: the file is no valid image; the message names the line if there is one.
    """
    text = _content(file)
    if text.startswith(MAGIC):
        raise InputError("is a brickOS program and needs the suffix .lx; a firmware image is S-records", file=file)
    memory = bytearray(END - START)
    written = bytearray(END - START)  # for each byte, 1 if a line of the file has written it
    entry: int | None = None
    for number, line in enumerate(text.decode("latin-1").splitlines(), 1):
        line = line.strip()
        if line.startswith("$$"):
            raise InputError(
                "holds a program: S-records with symbols. Convert them to .lx with makelx", file=file, line=number
            )
        if not line:
            continue
        kind, content = _record(line, file, number)
        if entry is not None:
            raise InputError("stands behind the S-record that ends the image", file=file, line=number)
        width = _ADDRESS_BYTES.get(kind) or _ENTRY_BYTES.get(kind) or 0
        if len(content) < width:
            raise InputError("is too short for an address", file=file, line=number)
        address, data = int.from_bytes(content[:width], "big"), content[width:]
        if kind in _ENTRY_BYTES:
            entry = address
        elif kind in _ADDRESS_BYTES and data:
            place = _place(address, len(data), file, number)
            if any(written[place]):
                raise InputError(
                    f"writes to 0x{address:04X}, where an earlier line wrote already", file=file, line=number
                )
            memory[place] = data
            written[place] = b"\1" * len(data)
    return _checked(file, bytes(memory), bytes(written), entry)


def _place(address: int, size: int, file: Path, number: int) -> slice:
    """Returns the place of a line's data in the memory for firmware."""
    if address < START or address + size > END:
        raise InputError(
            f"0x{address:04X}..0x{address + size - 1:04X} is outside the RCX's memory for firmware, "
            f"0x{START:04X}..0x{END - 1:04X}",
            file=file,
            line=number,
        )
    return slice(address - START, address - START + size)


def _checked(file: Path, memory: bytes, written: bytes, entry: int | None) -> Image:
    """Returns the image if it obeys the rules of the ROM."""
    if not any(written):
        raise InputError("holds no data", file=file)
    if entry is None:
        raise InputError("is cut short: its end record (S9) is missing", file=file)
    first, past = START + written.index(1), START + written.rindex(1) + 1
    if first != START:
        raise InputError(f"starts at 0x{first:04X}; the ROM loads and starts firmware at 0x{START:04X}", file=file)
    if not START <= entry < past:
        raise InputError(f"has its entry at 0x{entry:04X}, outside its data", file=file)
    image = Image(memory[: past - START], entry)
    if KNOCK not in image.data[: SUMMED_END - START]:
        raise InputError(
            f'lacks "{KNOCK[:-1].decode()}" below 0x{SUMMED_END:04X}, which the ROM needs to start it', file=file
        )
    return image


VERSION = 0
ROOM = 0x7000
"""Largest size of a program in bytes: the RCX's memory. Only the brick knows how much of it the kernel leaves free."""

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
        """Number of bytes that the brick reserves. They include a second copy of the data, for the next start."""
        return self.text_size + 2 * self.data_size + self.bss_size

    def at(self, base: int) -> bytes:
        """Returns text and data, relocated so that the text begins at `base`."""
        moved = bytearray(self.image)
        for place in self.relocations:
            address = int.from_bytes(moved[place : place + 2], "big") + base - self.base
            moved[place : place + 2] = (address & 0xFFFF).to_bytes(2, "big")
        return bytes(moved)


def read_program(file: Path) -> Program:
    """Reads and checks a program.

    Raises:
        InputError: the file is no valid program; the message names the fault.
    """
    content = _content(file)
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
