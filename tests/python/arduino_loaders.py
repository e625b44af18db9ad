"""Puts a boot loader of Arduino's core behind an image of this project, as in a board's flash.

The loaders are those of Debian's package arduino-core-avr. Optiboot is built from the package's source: the package's
own file is larger than its section of 512 bytes, so it does not start. The other loaders are the package's files.
"""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from arduino_build import CORE
from brickpilot.hil.checkout import AVR_TARGETS
from intelhex import IntelHex

FOLDER = CORE / "bootloaders"


@dataclass(frozen=True)
class Loader:
    """A board's loader.

    Attributes:
        target: key of `AVR_TARGETS`: the image that the loader starts.
        fuses: low, high and extended fuse of the board; the high fuse makes a reset begin in the loader.
        file: the loader in `FOLDER`; a C file is compiled to begin at `at`.
    """

    target: str
    fuses: tuple[int, int, int]
    file: str
    at: int


LOADERS: Mapping[str, Loader] = MappingProxyType(
    {
        # high fuse: boards.txt has 0xDE, for a loader section of 512 bytes; 0xDC gives a section of 1 KB.
        "uno": Loader("avr:328p-imu", (0xFF, 0xDC, 0xFD), "optiboot/optiboot.c", 0x7C00),
        "old nano": Loader("avr:328p-imu", (0xFF, 0xDA, 0xFD), "atmega/ATmegaBOOT_168_atmega328.hex", 0x7800),
        "mega": Loader("avr:2560", (0xFF, 0xD8, 0xFD), "stk500v2/stk500boot_v2_mega2560.hex", 0x3E000),
    }
)
"""Board -> its loader. A new Nano has the loader of the Uno. Fuses: boards.txt of the core."""

OPTIBOOT_FLAGS = (
    *("-mmcu=atmega328p", "-DF_CPU=16000000L", "-DLED_START_FLASHES=3", "-DBAUD_RATE=115200"),
    *("-Os", "-fno-inline-small-functions", "-fno-split-wide-types", "-w"),
    *("-Wl,--relax", "-Wl,--gc-sections", "-nostartfiles", "-nostdlib"),
)
"""The flags of Optiboot's Makefile for an Uno."""


def _run(*command: object) -> None:
    subprocess.run([str(part) for part in command], check=True)


def _loader(loader: Loader, folder: Path) -> IntelHex:
    file = FOLDER / loader.file
    if file.suffix == ".c":
        built, file = folder / "loader.elf", folder / "loader.hex"
        _run("avr-gcc", *OPTIBOOT_FLAGS, f"-Wl,--section-start=.text={loader.at:#x}", "-o", built, FOLDER / loader.file)
        _run("avr-objcopy", "-O", "ihex", "-j", ".text", built, file)
    read = IntelHex(str(file))
    read.start_addr = None
    if read.minaddr() != loader.at:
        raise ValueError(f"{file}: begins at {read.minaddr():#x} and not at {loader.at:#x}")
    return read


def behind(loader: Loader, image: Path, folder: Path) -> Path:
    """Makes an ELF file in `folder`: an image (.hex), the loader behind the image, and the fuses; returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    flash = IntelHex(str(image))
    flash.start_addr = None
    flash.merge(_loader(loader, folder), overlap="error")
    (folder / "flash.bin").write_bytes(bytes(flash.tobinarray(start=0)))
    source, made = folder / "board.S", folder / "board.elf"
    fuses = ", ".join(map(str, loader.fuses))
    source.write_text(f'.text\n.incbin "{folder / "flash.bin"}"\n.section .fuse, "a"\n.byte {fuses}\n')
    _run("avr-gcc", f"-mmcu={AVR_TARGETS[loader.target].chip}", "-nostartfiles", "-nostdlib", "-o", made, source)
    return made
