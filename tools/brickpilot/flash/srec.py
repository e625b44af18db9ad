"""Firmware images: Motorola S-records, judged by what the RCX's ROM demands before anything is sent.

The ROM loads from 0x8000 upwards without gaps, sums the bytes below 0xCC00 and looks for its string there; its own
variables begin at 0xEE5E (K. Proudfoot, RCX Internals, and lugnet.robotics, n=13499).
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from brickpilot.errors import InputError

START = 0x8000
"""Where the ROM puts the first byte."""
SUMMED_END = 0xCC00
"""End of what the ROM sums and searches."""
END = 0xEE5E
"""Where the ROM's own variables begin; they are in use while an image arrives."""
KNOCK = b"Do you byte, when I knock?\0"
"""Without it below SUMMED_END the ROM starts nothing; it compares the zero at the end too."""

_ADDRESS_BYTES = {"1": 2, "2": 3, "3": 4}
_ENTRY_BYTES = {"9": 2, "8": 3, "7": 4}


@dataclasses.dataclass(frozen=True)
class Image:
    """What goes to the brick: `data` from START on, gaps filled with zero, and the address at which it is entered."""

    data: bytes
    entry: int

    @property
    def checksum(self) -> int:
        """The 16-bit sum that the ROM forms of the bytes from START to SUMMED_END."""
        return sum(self.data[: SUMMED_END - START]) & 0xFFFF


def _record(line: str, file: Path, number: int) -> tuple[str, bytes]:
    """Type and bytes (address and data) of one record, its count and sum checked."""
    if len(line) < 4 or line[0] != "S" or not line[1].isdigit():
        raise InputError(f"is no S-record: {line[:20]!r}", file=file, line=number)
    try:
        content = bytes.fromhex(line[2:])
    except ValueError:
        raise InputError("an S-record has an even number of hexadecimal digits", file=file, line=number) from None
    if content[0] != len(content) - 1:
        raise InputError(f"says it has {content[0]} bytes, and has {len(content) - 1}", file=file, line=number)
    right = 0xFF - (sum(content[:-1]) & 0xFF)
    if content[-1] != right:
        raise InputError(f"wrong checksum {content[-1]:02X}, its bytes give {right:02X}", file=file, line=number)
    return line[1], content[1:-1]


def _lines(file: Path) -> list[str]:
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    if text.startswith(b"brickOS\0"):
        raise InputError("is a brickOS program, which travels as .lx; a firmware image is S-records", file=file)
    return text.decode("latin-1").splitlines()


def read(file: Path) -> Image:
    """Reads and checks an image.

    Raises:
        InputError: naming the line, where one is to blame.
    """
    memory = bytearray(END - START)
    written = bytearray(len(memory))
    entry: int | None = None
    for number, line in enumerate((text.strip() for text in _lines(file)), 1):
        if not line:
            continue
        if line.startswith("$$"):
            raise InputError(
                "S-records with symbols are a program's: makelx makes its .lx of them", file=file, line=number
            )
        kind, content = _record(line, file, number)
        if entry is not None:
            raise InputError("stands after the record that ends the image", file=file, line=number)
        width = _ADDRESS_BYTES.get(kind) or _ENTRY_BYTES.get(kind) or 0
        if len(content) < width:
            raise InputError("is too short for an address", file=file, line=number)
        address, data = int.from_bytes(content[:width], "big"), content[width:]
        if kind in _ENTRY_BYTES:
            entry = address
        elif kind in _ADDRESS_BYTES and data:
            if address < START or address + len(data) > END:
                raise InputError(
                    f"0x{address:04X}..0x{address + len(data) - 1:04X} is outside the RCX's memory for firmware, "
                    f"0x{START:04X}..0x{END - 1:04X}",
                    file=file,
                    line=number,
                )
            place = slice(address - START, address - START + len(data))
            if any(written[place]):
                raise InputError(f"writes again what an earlier line wrote at 0x{address:04X}", file=file, line=number)
            memory[place] = data
            written[place] = b"\1" * len(data)
    if not any(written):
        raise InputError("holds no data", file=file)
    if entry is None:
        raise InputError("has no record that ends it (S9): it is cut short", file=file)
    first, past = START + written.index(1), START + written.rindex(1) + 1
    image = Image(bytes(memory[: past - START]), entry)
    if first != START:
        raise InputError(f"starts at 0x{first:04X}; the ROM loads and starts firmware at 0x{START:04X}", file=file)
    if not START <= entry < past:
        raise InputError(f"is entered at 0x{entry:04X}, where it has nothing", file=file)
    if KNOCK not in image.data[: SUMMED_END - START]:
        raise InputError(
            f'lacks "{KNOCK[:-1].decode()}" below 0x{SUMMED_END:04X}, without which the ROM starts nothing', file=file
        )
    return image
