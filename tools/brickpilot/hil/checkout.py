"""Finds the firmware's sources, in a checkout of the project or in the package, and runs a checkout's scripts.

This module lists the images of `firmware/targets/avr` that `hil` flies, and the program that `brickpilot brick` runs.
So commands find these files without the libraries of the extra `hil`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from brickpilot.errors import InputError

_MARK = "firmware/targets/h8sim/build"
_PACKED = Path(__file__).parents[1] / "sources"

BRICK_PROGRAM = Path(__file__).parents[1] / "brick"
"""Program that is a brick on this machine, with a pseudo-terminal or a TCP port as its end of the link."""


def checkout(field: str | None = None) -> Path:
    """Returns the checkout of the project in this folder or above it.

    Raises:
        InputError: there is no checkout.
    """
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / _MARK).exists():
            return folder
    raise InputError("needs a checkout of the project in this folder or above it", field=field)


def sources(field: str | None = None) -> Path:
    """Returns the checkout of the project, or its copy in an installed package, which is for reading only.

    Raises:
        InputError: there is neither a checkout nor a copy.
    """
    try:
        return checkout(field)
    except InputError:
        if (_PACKED / _MARK).exists():
            return _PACKED
        raise


def script_output(script: str, *arguments: str, field: str | None = None, packed: bool = False) -> str:
    """Runs a script of the checkout, and returns what it prints.

    Args:
        script: the script's path in the checkout.
        arguments: the script's arguments.
        field: the option that needs the script, for error messages.
        packed: whether the installed package's script, which must not write into the package, runs without a checkout.

    Raises:
        InputError: there is no checkout, or the script fails.
    """
    root = (sources if packed else checkout)(field)
    done = subprocess.run([root / script, *arguments], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{script} failed", field=field)
    return done.stdout.strip()


def in_lab(
    module: str, *arguments: str, field: str | None = None, stdout: int | None = None
) -> subprocess.CompletedProcess[bytes]:
    """Runs a module of the checkout's `tests/lab`, which no package contains, and waits for its end.

    Args:
        module: the module's name in `lab`.
        arguments: the module's arguments.
        field: the option or task that needs the module, for error messages.
        stdout: as in `subprocess.run`; None: the module prints to the stdout of this process.

    Raises:
        InputError: there is no checkout.
    """
    paths = [str(checkout(field) / "tests"), os.environ.get("PYTHONPATH", "")]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    return subprocess.run([sys.executable, "-m", f"lab.{module}", *arguments], env=env, stdout=stdout, check=False)


@dataclass(frozen=True)
class AvrTarget:
    """An image of `firmware/targets/avr`: simavr's name of the chip, the arguments of the build, and the sensors."""

    chip: str
    build: tuple[str, str]
    sensors: tuple[str, ...]


AVR_TARGETS = {
    "avr:328p-imu": AvrTarget("atmega328p", ("328p", "imu"), ("imu",)),
    "avr:328p-rotation": AvrTarget("atmega328p", ("328p", "rotation"), ("imu+encoders",)),
    "avr:328p-mpu6050": AvrTarget("atmega328p", ("328p", "imu-mpu6050"), ("imu",)),
    "avr:328p-lsm6ds": AvrTarget("atmega328p", ("328p", "imu-lsm6ds"), ("imu",)),
    "avr:2560": AvrTarget("atmega2560", ("2560", "all"), ("imu+encoders",)),
}
"""Name of a target -> image, chip and sensors of the target."""
