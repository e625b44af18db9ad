"""`brickpilot flash`."""

from __future__ import annotations

from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, progress_shown, show
from brickpilot.errors import InputError


@click.group()
def flash() -> None:
    """Puts an image on a brick."""


@flash.command("rcx")
@click.argument("file")
@click.option(
    "-t", "--tty", "device", envvar="RCXTTY", show_envvar=True, metavar="DEVICE",
    help="The serial port of the infrared tower, such as /dev/ttyUSB0.",
)  # fmt: skip
@click.option(
    "-p", "--program", "number", type=click.IntRange(1, 8), metavar="1..8", help="The place of the program; default 1."
)
@click.option(
    "-r", "--rcxaddr", "host", type=click.IntRange(0, 15), metavar="0..15", help="The brick's LNP address; default 0."
)
@click.option("-e", "--execute", is_flag=True, help="Start the program when it has arrived.")
@as_json
def flash_rcx(
    file: str, device: str | None, number: int | None, host: int | None, execute: bool, as_json: bool
) -> None:
    """Puts FILE on a LEGO RCX over its serial infrared tower: firmware (.srec) or a program for brickOS (.lx).

    FILE is checked before anything is sent. A lost or damaged packet is sent again, and is shorter from the third try
    on. At 2400 baud, 11 KB of firmware take two minutes, and a program of 12 KB takes one minute. The options -p, -r
    and -e apply to programs alone, and mean the same as in dll, the loader of brickOS.
    """
    from brickpilot.flash import image_files, rom

    path = Path(file)
    figures: dict[str, object] = {"file": file, "device": device}
    if path.suffix.lower() == ".lx":
        program = image_files.read_program(path)
        port = _given("tower", "--tty", "RCXTTY", device)
        with progress_shown(as_json) as progress:
            done = rom.flash_program(
                program, port, slot=(number or 1) - 1, host=host or 0, execute=execute, progress=progress
            )
        figures |= {"kind": "program", "program": number or 1, "executed": execute}
        what = f"program {number or 1}, {'started' if execute else 'not started'}"
    else:
        if number is not None or host is not None or execute:
            raise InputError("apply to programs (.lx), and this file is not one", file=file, field="-p, -r and -e")
        image = image_files.read_firmware(path)
        port = _given("tower", "--tty", "RCXTTY", device)
        with progress_shown(as_json) as progress:
            done = rom.flash_firmware(image, port, progress=progress)
        figures |= {"kind": "firmware"}
        what = "firmware, started"
    figures |= {
        "bytes": len(done.image), "address": done.address, "checksum": sum(done.image) & 0xFFFF,
        "packets": done.tally.packets, "sent_again": done.tally.sent_again, "seconds": round(done.seconds, 3),
    }  # fmt: skip
    line = (
        f"{file}: {len(done.image)} bytes at 0x{done.address:04X}, {what}; {done.tally.packets} packets, "
        f"{done.tally.sent_again} of them sent again, {done.seconds:.1f} s"
    )
    show(figures, [line], as_json=as_json)


@flash.command("avr")
@click.argument("file")
@click.option(
    "-P", "--port", envvar="AVRPORT", show_envvar=True, metavar="PORT",
    help="The board's serial port, such as /dev/ttyACM0 or COM3.",
)  # fmt: skip
@click.option(
    "-p", "--part", type=click.Choice(["328p", "2560"]), default="328p", show_default=True,
    help="The chip: ATmega328P (Uno, Nano) or ATmega2560 (Mega).",
)  # fmt: skip
@click.option(
    "-b", "--baud", type=click.IntRange(300, 2_000_000), default=115200, show_default=True,
    help="The boot loader's rate.",
)  # fmt: skip
@click.option("-n", "--dry-run", is_flag=True, help="Only check whether this board is there; write nothing.")
@as_json
def flash_avr(file: str, port: str | None, part: str, baud: int, dry_run: bool, as_json: bool) -> None:
    """Puts FILE (Intel HEX) on an Arduino Uno, Nano or Mega by its boot loader.

    avrdude does the work (sudo apt-get install avrdude). FILE is checked, then written, read back and compared.
    An old Nano has a boot loader at 57600 baud. `firmware/targets/avr/build` makes FILE.
    """
    from brickpilot.flash import avr

    chip = avr.PARTS[part]
    avr.read(Path(file), chip)
    done = avr.flash(Path(file), chip, _given("board", "--port", "AVRPORT", port), baud=baud, dry=dry_run)
    figures = {"file": file, "port": port, "part": chip.name, "bytes": done.size, "written": not dry_run}
    what = "not written: a dry run" if dry_run else "written and compared"
    line = f"{file}: {done.size} bytes, {what}; {chip.name} at {port}, {done.seconds:.1f} s"
    show(figures | {"seconds": round(done.seconds, 3)}, [line], as_json=as_json)


def _given(what: str, flag: str, variable: str, port: str | None) -> str:
    if port is None:
        message = f"is missing: name the {what}'s serial port here or in the environment as {variable}"
        raise InputError(message, field=flag)
    return port
