"""Finds the checkout of the project, which has the firmware's sources, and runs its scripts."""

from __future__ import annotations

import subprocess
from pathlib import Path

from brickpilot.errors import InputError


def checkout(field: str | None = None) -> Path:
    """Returns the checkout of the project in this folder or above it.

    Raises:
        InputError: there is none.
    """
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / "firmware/targets/h8sim/build").exists():
            return folder
    raise InputError("needs a checkout of the project in this folder or above it", field=field)


def script_output(script: str, *arguments: str, field: str | None = None) -> str:
    """Runs a script of the checkout, and returns what it prints.

    Raises:
        InputError: there is no checkout, or the script fails.
    """
    done = subprocess.run([checkout(field) / script, *arguments], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{script} failed", field=field)
    return done.stdout.strip()
