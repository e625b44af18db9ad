"""A brick on the simulator of the RCX's processor."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.link.links import Link, StreamLink

H8SIM = "h8sim"
"""The firmware on the simulator of the RCX's processor, linked by its standard input and output."""

H8SIM_TARGETS = {H8SIM: None, "h8sim:imu": "imu", "h8sim:rotation": "rotation"}
"""Target -> the sensors for which it is built (firmware/targets/rcx/flags); None: built as for this machine."""

H8SIM_REPLY_S = 10.0
"""Time for a reply: a simulated instruction takes microseconds, and the simulator takes seconds to start."""


def h8_simulator(target: str) -> tuple[str, str]:
    """Builds the simulator and its program by the project's scripts if necessary, and returns their paths.

    Args:
        target: one of `H8SIM_TARGETS`.

    Raises:
        InputError: no checkout is in this folder or above it, or a build fails.
    """
    folder = next((folder for folder in _here_and_above() if (folder / "firmware/targets/h8sim/build").exists()), None)
    if folder is None:
        raise InputError("needs a checkout of the project in this folder or above it", field=f"--target {target}")

    def output(*command: str) -> str:
        done = subprocess.run([folder / command[0], *command[1:]], stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode != 0:
            raise InputError(f"{command[0]} failed", field=f"--target {target}")
        return done.stdout.strip()

    sensors = H8SIM_TARGETS[target]
    built = []
    if sensors is not None:
        built = [str(folder / f"build/h8sim-{sensors}"), *output("firmware/targets/rcx/flags", sensors).split()]
    return output("hal/h8sim/simulator"), output("firmware/targets/h8sim/build", *built)


def check_sensors(target: str, sensors: str) -> None:
    """Raises InputError if the target's brick cannot have these sensors."""
    if H8SIM_TARGETS.get(target) is not None and sensors == "ideal":
        raise InputError(
            f"a brick has no ideal sensors; {target} flies with imu or imu+encoders", field=f"--sensors {sensors}"
        )


def _here_and_above() -> tuple[Path, ...]:
    here = Path.cwd()
    return (here, *here.parents)


def start_h8(target: str, trace: Path | None = None) -> tuple[subprocess.Popen[bytes], Link]:
    """Starts the firmware on the simulator, which ends with its standard input. Returns it and the link to it.

    Args:
        target: one of `H8SIM_TARGETS`.
        trace: file to which it writes the address and the stack pointer of each instruction, as native 16-bit words.
    """
    simulator, image = h8_simulator(target)
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            ["stdbuf", "-o0", simulator, image],
            bufsize=0,
            stdin=theirs.fileno(),
            stdout=theirs.fileno(),
            stderr=subprocess.DEVNULL,
            env=os.environ | ({} if trace is None else {"H8SIM_TRACE": str(trace)}),
        )
    return process, StreamLink(ours)
