"""Delivers a file to an RCX: firmware by its ROM, programs by brickOS; and says what stands in the way."""

from __future__ import annotations

import dataclasses
import time

from brickpilot.errors import InputError
from brickpilot.flash import lx, srec
from brickpilot.flash.program import Loader
from brickpilot.flash.rom import Rom
from brickpilot.flash.tally import Progress, Tally
from brickpilot.link.tower import BYTE_S, Tower

_SILENCE = "no answer from the brick: is it on, its batteries good, its window towards the tower, 10 to 20 cm away?"


@dataclasses.dataclass(frozen=True)
class Delivered:
    """What arrived: `image` as it stands in the brick from `address` on."""

    image: bytes
    address: int
    tally: Tally
    seconds: float


def flash_firmware(image: srec.Image, device: str, *, progress: Progress, byte_s: float = BYTE_S) -> Delivered:
    """Replaces a brick's firmware and starts it.

    Raises:
        InputError: no port, no tower, no answer, or the brick refuses.
        TimeoutError: the brick fell silent midway.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        rom, loader = Rom(tower), Loader(tower)
        if not rom.alive():
            if loader.alive():
                raise InputError(
                    "brickOS is running on the brick, and nothing but its keys deletes it: stop its program, hold Prgm "
                    "and press On-Off, then flash again",
                    field=device,
                )
            raise InputError(
                f"{_SILENCE} A brickOS with another LNP address is deleted by holding Prgm and pressing On-Off",
                field=device,
            )
        if not rom.download(image, tally, progress) and not loader.alive():
            raise TimeoutError(
                f"{device}: all of the image is on the brick, but it did not confirm the start; if its display shows "
                "no firmware, flash again"
            )
    return Delivered(image.data, srec.START, tally, time.monotonic() - began)


def flash_program(
    program: lx.Program,
    device: str,
    *,
    slot: int = 0,
    host: int = 0,
    execute: bool = False,
    progress: Progress,
    byte_s: float = BYTE_S,
) -> Delivered:
    """Puts a program into a slot, 0..7, of a brick with brickOS, in place of what is there.

    Raises:
        InputError: no port, no tower, no answer, or the brick refuses.
        TimeoutError: the brick fell silent midway.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        loader = Loader(tower, host)
        if not loader.delete(slot):
            if loader.alive():
                raise InputError("a program is running on the brick: stop it with Run, then try again", field=device)
            if Rom(tower).alive():
                raise InputError("the brick has no brickOS: flash its brickOS.srec first", field=device)
            raise InputError(f"{_SILENCE} Is its LNP address {host}?", field=device)
        base = loader.send(program, slot, tally, progress)
        if execute:
            loader.run(slot)
    return Delivered(program.at(base), base, tally, time.monotonic() - began)
