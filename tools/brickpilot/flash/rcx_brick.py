"""Puts a file on an RCX: firmware by its ROM, programs by brickOS."""

from __future__ import annotations

import dataclasses
import time

from brickpilot.errors import InputError
from brickpilot.flash import lx, srec
from brickpilot.flash.program import Loader
from brickpilot.flash.rom import Rom
from brickpilot.flash.tally import Progress, Tally
from brickpilot.link.tower import BYTE_S, Tower

_SILENCE = (
    "the brick does not reply: is it on, are its batteries good, and does its window face the tower at 10 to 20 cm?"
)


@dataclasses.dataclass(frozen=True)
class Delivered:
    """The result of a delivery. `image` is in the brick's memory from `address` on."""

    image: bytes
    address: int
    tally: Tally
    seconds: float


def flash_firmware(image: srec.Image, device: str, *, progress: Progress, byte_s: float = BYTE_S) -> Delivered:
    """Replaces a brick's firmware and starts it.

    Raises:
        InputError: there is no port, no tower or no reply, or the brick refuses the firmware.
        TimeoutError: the brick stopped replying.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        rom, loader = Rom(tower), Loader(tower)
        if not rom.alive():
            if loader.alive():
                raise InputError(
                    "brickOS runs on the brick, and only the brick's keys delete it: stop its program, hold Prgm and "
                    "press On-Off, then flash again",
                    field=device,
                )
            raise InputError(
                f"{_SILENCE} If it runs a brickOS with another LNP address, hold Prgm and press On-Off to delete it",
                field=device,
            )
        if not rom.download(image, tally, progress) and not loader.alive():
            raise TimeoutError(
                f"{device}: the whole image is on the brick, but the brick did not confirm the start. If its display "
                "shows no firmware, flash again"
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
    """Puts a program into a slot, 0..7, of a brick with brickOS, and replaces the program that is there.

    Raises:
        InputError: there is no port, no tower or no reply, or the brick refuses the program.
        TimeoutError: the brick stopped replying.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        loader = Loader(tower, host)
        if not loader.delete(slot):
            if loader.alive():
                raise InputError("a program runs on the brick: stop it with Run, then try again", field=device)
            if Rom(tower).alive():
                raise InputError("the brick has no brickOS: flash brickOS.srec first", field=device)
            raise InputError(f"{_SILENCE} Is its LNP address {host}?", field=device)
        base = loader.send(program, slot, tally, progress)
        if execute:
            loader.run(slot)
    return Delivered(program.at(base), base, tally, time.monotonic() - began)
