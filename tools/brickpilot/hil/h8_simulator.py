"""A brick on the simulator of the RCX's processor."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.hil.checkout import checkout, script_output
from brickpilot.link.links import Link, StreamLink

H8SIM = "h8sim"
"""The firmware on the simulator of the RCX's processor, linked by its standard input and output."""

H8SIM_TARGETS = {H8SIM: None, "h8sim:imu": "imu", "h8sim:rotation": "rotation"}
"""Target -> the sensors for which it is built (firmware/targets/rcx/flags); None: built as for this machine."""

H8SIM_REPLY_S = 10.0
"""Time for a reply: a simulated instruction takes microseconds, and the simulator takes seconds to start."""


def h8_simulator(target: str, image: Path | None = None) -> tuple[str, str]:
    """Builds the simulator and its program by the project's scripts if necessary, and returns their paths.

    Args:
        target: one of `H8SIM_TARGETS`.
        image: the program, built already; None: that of `target` is built in a checkout.

    Raises:
        InputError: no checkout is in this folder or above it, where a program is built, or a build fails.
    """
    if image is not None:
        return script_output("hal/h8sim/simulator", field="--image", packed=True), str(image)
    sensors = H8SIM_TARGETS[target]
    built = []
    if sensors is not None:
        folder = checkout(f"--target {target}")
        flags = script_output("firmware/targets/rcx/flags", sensors, field=f"--target {target}").split()
        built = [str(folder / f"build/h8sim-{sensors}"), *flags]
    return (
        script_output("hal/h8sim/simulator", field=f"--target {target}"),
        script_output("firmware/targets/h8sim/build", *built, field=f"--target {target}"),
    )


def check_sensors(target: str, sensors: str) -> None:
    """Raises InputError if the target's brick cannot have these sensors."""
    if H8SIM_TARGETS.get(target) is not None and sensors == "ideal":
        raise InputError(
            f"a brick has no ideal sensors; {target} flies with imu or imu+encoders", field=f"--sensors {sensors}"
        )


def start_h8(target: str, trace: Path | None = None, image: Path | None = None) -> tuple[subprocess.Popen[bytes], Link]:
    """Starts the firmware on the simulator, which ends with its standard input. Returns it and the link to it.

    Args:
        target: one of `H8SIM_TARGETS`.
        trace: file to which it writes the address and the stack pointer of each instruction, as native 16-bit words.
        image: see `h8_simulator`.
    """
    simulator, program = h8_simulator(target, image)
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            ["stdbuf", "-o0", simulator, program],
            bufsize=0,
            stdin=theirs.fileno(),
            stdout=theirs.fileno(),
            stderr=subprocess.DEVNULL,
            env=os.environ | ({} if trace is None else {"H8SIM_TRACE": str(trace)}),
        )
    return process, StreamLink(ours)
