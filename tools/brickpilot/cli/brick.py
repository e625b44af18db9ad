"""`brickpilot brick`."""

from __future__ import annotations

import os
import sys

import click


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
def brick(options: tuple[str, ...]) -> None:
    """Runs the firmware as a brick on this machine until it is interrupted.

    OPTIONS: --pty, --serial PATH, --listen HOST:PORT, --slcan-pty or --slcan PATH. The first line that it prints is
    the link that `brickpilot hil --link` takes. An address that other machines reach needs a token of 16 to 64 bytes
    in the environment variable BRICKPILOT_TOKEN, here and where the link is opened.
    """
    from brickpilot.hil.brick_process import PROGRAM

    sys.stdout.flush()
    os.execv(PROGRAM, [str(PROGRAM), *options])
