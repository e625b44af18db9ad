"""A brick as a process of this machine, with a pseudo-terminal or a TCP port as its end of the link."""

from __future__ import annotations

import select
import signal
import subprocess
from pathlib import Path

from brickpilot.errors import InputError, SimulationError

PROGRAM = Path(__file__).parents[1] / "brick"


def start_brick(options: str) -> tuple[subprocess.Popen[bytes], str]:
    """Starts a brick as a process and returns the process and its link. It ends when its standard input closes.

    Raises:
        InputError: the package was built where there is no such process, as on Windows and macOS.
    """
    if not PROGRAM.exists():
        raise InputError(
            "this system has no brick as a process; take can:virtual or a brick of your own", field="--link"
        )
    process = subprocess.Popen(
        [PROGRAM, *options.split(), "--until-eof"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    )
    assert process.stdout is not None
    ready = select.select([process.stdout], [], [], 5.0)[0]
    address = process.stdout.readline().decode().strip() if ready else ""
    if not address:
        end_brick(process)
        raise SimulationError(f"{PROGRAM.name} {options}: the brick did not start")
    return process, address


def end_brick(process: subprocess.Popen[bytes]) -> None:
    """Ends a brick: closes its standard input and waits."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    wait_for_end(process)
    process.stdout.close()


def wait_for_end(process: subprocess.Popen[bytes]) -> None:
    """Waits up to 2 s for the end of a process, then kills it."""
    try:
        process.wait(2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def restart_brick(process: subprocess.Popen[bytes]) -> None:
    """Restarts a brick by SIGUSR1 and waits until it prints a line."""
    assert process.stdout is not None
    process.send_signal(signal.SIGUSR1)
    if select.select([process.stdout], [], [], 2.0)[0]:
        process.stdout.readline()
