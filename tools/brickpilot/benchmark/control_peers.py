"""The control law on a brick's processor: the firmware's arithmetic beside Q16.16 and floating point in software.

The law is line of sight, two PIDs and the mixer, of `tests/peers`. Every program is fed the same steps of a recorded
mission (`flight_records`), and must give the firmware's answers within `BOUNDS_V`: they do the same work. Q16.16 is of
libfixmath's kind, and ours. Floating point is that of the brick's own tools: avr-libc's, and brickOS's on the RCX.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.benchmark import flight_records, step_budget
from brickpilot.errors import InputError, SimulationError
from brickpilot.hil.checkout import checkout, script_output

Array = NDArray[np.float64]

STEPS = 500
"""Steps of the mission that are compared: their tables and the largest program fit into an ATmega328P's flash."""

BOUNDS_V = {"typical": 0.005, "most": 0.05}
"""Difference of a motor's voltage from the firmware's, median and largest. The firmware brakes by a distance in whole
mm: one of them is 0.03 V near a waypoint."""

ARITHMETICS = {
    "ours": "the firmware's 16 and 32 bits",
    "q16": "Q16.16 of libfixmath's kind, ours",
    "float": "soft-float, 32 bits",
}

BRICKS = {
    "h8": "H8/300 at 16 MHz, simulated, all in external RAM",
    "avr": "ATmega328P at 16 MHz, simulated by simavr",
}
UNITS = {"h8": "states/step", "avr": "cycles/step"}

_SCALES = {"ours": (1e-3, 1.0 / 32767), "q16": (1.0 / 65536, 1.0 / 65536), "float": (1.0, 1.0)}
_ROW_BYTES = {"ours": 20, "q16": 30, "float": 30, "none": 20}
_NUMBERS = 5


@dataclass(frozen=True)
class LawCost:
    """What a step of the control law costs in one arithmetic.

    Attributes:
        cycles: of each step, shape (steps,); states on the H8.
        flash: bytes of code and constants, with the routines of the arithmetic.
        voltages: the answers, shape (steps, 2), V.
    """

    cycles: NDArray[np.int64]
    flash: int
    voltages: Array


def measure(brick: str, steps: int = STEPS) -> dict[str, LawCost]:
    """Runs the law on the simulator of a brick's processor, in each of `ARITHMETICS`.

    Args:
        brick: of `BRICKS`.
        steps: of the mission; at most `STEPS`.

    Raises:
        InputError: no checkout of the project, no compiler or no simulator.
        SimulationError: a program failed, or its answers are not the firmware's within `BOUNDS_V`.
    """
    records = flight_records.record(steps)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        flight_records.write(records, folder)
        script_output("tests/peers/build", brick, str(folder), field=f"peers on {brick}")
        run = _on_h8 if brick == "h8" else _on_avr
        sizes = {name: _code_bytes(brick, folder / name) - steps * _ROW_BYTES[name] for name in _ROW_BYTES}
        empty, _ = run(folder, "none", steps)
        found = {}
        for name in ARITHMETICS:
            cycles, answers = run(folder, name, steps)
            if name == "float":
                answers = np.ascontiguousarray(answers, dtype=np.int32).view(np.float32)
            voltages = np.asarray(answers[:, :2] * _SCALES[name][0], dtype=np.float64)
            found[name] = LawCost(cycles - int(empty.min()), sizes[name] - sizes["none"], voltages)
    for name, cost in found.items():
        check_same_answers(f"{ARITHMETICS[name]} on {brick}", found["ours"].voltages, cost.voltages)
    return found


def check_same_answers(what: str, ours: Array, theirs: Array) -> None:
    """Raises SimulationError where two programs' voltages differ by more than `BOUNDS_V`."""
    apart = np.abs(theirs - ours)
    typical, most = float(np.median(apart)), float(apart.max())
    if not (typical <= BOUNDS_V["typical"] and most <= BOUNDS_V["most"]):
        raise SimulationError(
            f"{what} does not compute the firmware's control law: voltages differ by {typical:.4f} V typically, "
            f"and by {most:.4f} V at most"
        )


def missing(brick: str) -> str | None:
    """Returns why the law cannot be measured on a brick here, or None."""
    try:
        checkout(f"peers on {brick}")
    except InputError as error:
        return str(error)
    tools = {"h8": ("h8300-hms-gcc", "h8300-hms-ar"), "avr": ("avr-gcc", "avr-size")}[brick]
    files = {"h8": "/usr/lib/brickos/libfloat.a", "avr": "/usr/include/simavr"}
    absent = [tool for tool in tools if not any((Path(at) / tool).exists() for at in os.get_exec_path())]
    absent += [] if Path(files[brick]).exists() else [files[brick]]
    return f"peers on {brick}: needs {', '.join(absent)}" if absent else None


def _numbers(output: bytes, steps: int) -> NDArray[np.int32]:
    if len(output) != 4 * _NUMBERS * steps:
        raise SimulationError("a program of the control law ended early")
    return np.frombuffer(output, dtype="<i4").reshape(steps, _NUMBERS)


def _on_avr(folder: Path, name: str, steps: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    command: list[str | Path] = [folder / "run", "atmega328p", folder / name]
    numbers = _numbers(subprocess.run(command, stdout=subprocess.PIPE, check=False).stdout, steps)
    return numbers[:, 4].astype(np.int64), numbers[:, :4]


def _on_h8(folder: Path, name: str, steps: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Counts the states of each call of control_law() in the simulator's trace."""
    trace = folder / "trace"
    done = subprocess.run(
        [script_output("hal/h8sim/simulator"), folder / name],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        env=os.environ | {"H8SIM_TRACE": str(trace)},
        check=False,
    )
    numbers = _numbers(done.stdout, steps)
    program = step_budget.Program.of(folder / f"{name}.coff")
    at, stack = np.fromfile(trace, dtype=np.uint16).reshape(-1, 2).T
    trace.unlink()
    sums = np.concatenate([[0], np.cumsum(program.costs["external"][at])])
    begins = np.flatnonzero(at == program.at["control_law"])
    ends = [step_budget.end_of_call(stack, begin) for begin in begins.tolist()]
    if len(begins) != steps or None in ends:
        raise SimulationError("the trace of the control law has not one call a step")
    return np.asarray(sums[np.array(ends, dtype=np.int64)] - sums[begins], dtype=np.int64), numbers[:, :4]


def _code_bytes(brick: str, program: Path) -> int:
    """Returns the bytes of code, constants and start values of a program."""
    file = program.with_suffix(".coff") if brick == "h8" else program
    tool = "h8300-hms-size" if brick == "h8" else "avr-size"
    listed = subprocess.run([tool, file], stdout=subprocess.PIPE, text=True, check=True).stdout
    sizes = re.findall(r"\d+", listed.splitlines()[1])
    return int(sizes[0]) + int(sizes[1])
