"""Puts an image on an Arduino with an AVR: avrdude speaks to the board's boot loader."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from intelhex import HexReaderError, IntelHex

from brickpilot.errors import InputError, WorkFailedError


@dataclass(frozen=True)
class Part:
    """A chip on an Arduino: avrdude's names of the chip and of its boot loader, and the largest image in bytes."""

    name: str
    programmer: str
    room: int


PARTS = {
    "328p": Part("atmega328p", "arduino", 32768 - 512),
    "2560": Part("atmega2560", "wiring", 262144 - 8192),
}

BAUD = 115200
TIMEOUT_S = 120.0
"""The longest time for a delivery, s. avrdude needs a minute to write an image of 250 KB and to read it back."""

_SILENT = ("not in sync", "is not responding", "timeout", "getsync")
_NO_PORT = ("can't open device", "cannot open port", "unable to open port")
_BUSY = ("busy", "permission denied")


@dataclass(frozen=True)
class Delivered:
    """The result of a delivery: the image's size in bytes, and the delivery's duration in s."""

    size: int
    seconds: float


def read(file: Path, part: Part) -> int:
    """Checks an image in Intel HEX and returns its size in bytes.

    Raises:
        InputError: the file cannot be read, is no Intel HEX, is empty, or is too large for the part.
    """
    image = IntelHex()
    try:
        image.loadhex(str(file))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from error
    except (HexReaderError, UnicodeDecodeError) as error:
        raise InputError(f"is no Intel HEX: {error}", file=file) from error
    size = len(image)
    if size == 0:
        raise InputError("holds no data", file=file)
    end = image.maxaddr() + 1
    if end > part.room:
        raise InputError(
            f"needs {end} bytes of flash; the {part.name} has {part.room} beside its boot loader", file=file
        )
    return size


def flash(
    file: Path, part: Part, port: str, *, baud: int = BAUD, dry: bool = False, timeout_s: float = TIMEOUT_S
) -> Delivered:
    """Writes an image and reads it back.

    Args:
        file: an image in Intel HEX.
        part: the chip.
        port: the board's serial port.
        baud: the boot loader's rate.
        dry: whether to check only that the board and its chip are there, without writing.
        timeout_s: time for the whole delivery, s.

    Raises:
        InputError: the image does not fit, avrdude or the port is missing, or the board has another chip.
        TimeoutError: nothing answers, or the delivery takes too long.
        WorkFailedError: the image that is read back differs, or avrdude failed in another way.
    """
    size = read(file, part)
    program = shutil.which("avrdude")
    if program is None:
        raise InputError("is missing: sudo apt-get install avrdude", field="avrdude")
    if port.startswith("/") and not Path(port).exists():
        raise InputError("there is no such port: is the board plugged in?", field=f"--port {port}")
    command = [program, "-p", part.name, "-c", part.programmer, "-P", port, "-b", str(baud), "-D"]
    command += ["-U", f"flash:w:{file}:i", *(["-n"] if dry else [])]
    began = time.monotonic()
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"{port}: avrdude was not done after {timeout_s:g} s, and was stopped") from None
    if done.returncode != 0:
        _explain(done.stderr + done.stdout, part, port, baud)
    return Delivered(size, time.monotonic() - began)


def _explain(message: str, part: Part, port: str, baud: int) -> None:
    """Raises the error that corresponds to avrdude's message."""
    text = message.lower()
    if "signature" in text and ("expected" in text or "invalid" in text):
        guess = re.search(r"probably (?:\w+: )?(\w+)", message)
        other = f", probably {guess[1]}" if guess else ""
        raise InputError(f"the board has another chip than {part.name}{other}", field=f"--port {port}")
    if any(phrase in text for phrase in _BUSY):
        raise InputError("is in use, or may not be opened by this user", field=f"--port {port}")
    if any(phrase in text for phrase in _NO_PORT):
        raise InputError("cannot be opened: is it a serial port, and is the board plugged in?", field=f"--port {port}")
    if any(phrase in text for phrase in _SILENT):
        raise TimeoutError(
            f"{port}: no boot loader answers at {baud} baud: is it this board, with --part and --baud of its kind?"
        )
    if "verification" in text or "mismatch" in text:
        raise WorkFailedError(f"{port}: what was read back differs from the image: flash again, with a shorter cable")
    last = [line.strip() for line in message.splitlines() if line.strip() and "Thank you" not in line]
    raise WorkFailedError(f"{port}: avrdude failed: {last[-1] if last else 'without a word'}")
