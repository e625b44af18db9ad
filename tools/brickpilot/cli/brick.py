"""`brickpilot brick`."""

from __future__ import annotations

import os
import sys

import click


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
def brick(options: tuple[str, ...]) -> None:
    """Runs a brick on this machine: the firmware at the end of a line, until it is interrupted.

    OPTIONS: --pty, --serial PATH, --listen HOST:PORT, --slcan-pty or --slcan PATH. Its first line is
    what `brickpilot hil --link` takes.
    """
    from brickpilot.hil.ends import PROGRAM

    sys.stdout.flush()
    os.execv(PROGRAM, [str(PROGRAM), *options])
