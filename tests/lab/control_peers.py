"""Measures a control law on a brick's processor in the firmware's arithmetic, Q16.16 and software floating point.

The law of `tests/peers` consists of line of sight, two PIDs and the mixer. Every program gets the same steps of a
recorded mission, and must give the firmware's voltages within `BOUNDS_V`: this shows that all programs do the same
work. The Q16.16 arithmetic is written here, similar to libfixmath. The routines for floating point are those of
avr-libc on the AVR, and of brickOS on the RCX.
"""

from __future__ import annotations

import math
import os
import re
import subprocess
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from brickpilot.bench.speed import LawFigure
from brickpilot.constants import RCX, STEP_S
from brickpilot.errors import SimulationError
from brickpilot.hil.checkout import script_output
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import Model, rcx
from numpy.typing import NDArray

from lab import rcx_budget

Array = NDArray[np.float64]

STEPS = 500
"""Number of compared steps of the mission: a table of so many steps and the largest program fit the flash of an
ATmega328P together."""

BOUNDS_V = {"typical": 0.005, "most": 0.05}
"""Largest allowed median ("typical") and maximum ("most") of the difference from the firmware's motor voltages, V. The
firmware computes the speed for braking from a distance in whole mm; near a waypoint, 1 mm changes the voltage by
0.03 V."""

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
    """The cost of a step of the control law in one arithmetic.

    Attributes:
        cycles: clock cycles of each step, shape (steps,).
        flash: bytes of code and constants, including the arithmetic's routines.
        voltages: the computed motor voltages, shape (steps, 2), V.
    """

    cycles: NDArray[np.int64]
    flash: int
    voltages: Array


def measure(brick: str, steps: int = STEPS) -> dict[str, LawCost]:
    """Runs the law on the simulator of a brick's processor; returns arithmetic of `ARITHMETICS` -> cost.

    Args:
        brick: one of `BRICKS`.
        steps: number of steps of the mission, at most `STEPS`.

    Raises:
        InputError: the checkout of the project, the compiler or the simulator is missing.
        SimulationError: a program failed, or its voltages differ from the firmware's by more than `BOUNDS_V`.
    """
    records = record(steps)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_records(records, folder)
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
    """Raises SimulationError if two programs' voltages differ by more than `BOUNDS_V`."""
    apart = np.abs(theirs - ours)
    typical, most = float(np.median(apart)), float(apart.max())
    if not (typical <= BOUNDS_V["typical"] and most <= BOUNDS_V["most"]):
        raise SimulationError(
            f"{what} does not compute the firmware's control law: voltages differ by {typical:.4f} V typically, "
            f"and by {most:.4f} V at most"
        )


def missing(brick: str) -> str | None:
    """Returns why the law cannot be measured on a brick on this machine; None: it can be measured."""
    tools = {"h8": ("h8300-hms-gcc", "h8300-hms-ar"), "avr": ("avr-gcc", "avr-size")}[brick]
    files = {"h8": "/usr/lib/brickos/libfloat.a", "avr": "/usr/include/simavr"}
    absent = [tool for tool in tools if not any((Path(at) / tool).exists() for at in os.get_exec_path())]
    absent += [] if Path(files[brick]).exists() else [files[brick]]
    return f"peers on {brick}: needs {', '.join(absent)}" if absent else None


def figures_here() -> tuple[dict[str, LawFigure], list[str]]:
    """Returns the figures of the bricks that this machine can measure, and for each other brick the reason."""
    reasons = {brick: missing(brick) for brick in BRICKS}
    found: dict[str, LawFigure] = {}
    for brick, reason in reasons.items():
        if reason is None:
            found |= figures(brick, measure(brick))
    return found, [reason for reason in reasons.values() if reason is not None]


def figures(brick: str, costs: Mapping[str, LawCost]) -> dict[str, LawFigure]:
    """Returns name -> figure of `brickpilot bench`: the firmware's arithmetic beside each of the others in `costs`."""
    ours = costs["ours"]
    value = float(np.median(ours.cycles))
    return {
        f"control_{brick}_{name}": LawFigure(
            value=value,
            unit=UNITS[brick],
            peer=ARITHMETICS[name],
            ratio=float(np.median(theirs.cycles)) / value,
            machine=BRICKS[brick],
            most=int(ours.cycles.max()),
            peer_most=int(theirs.cycles.max()),
            flash_bytes=ours.flash,
            peer_flash_bytes=theirs.flash,
            apart_v=float(np.abs(theirs.voltages - ours.voltages).max()),
        )
        for name, theirs in costs.items()
        if name != "ours"
    }


def _numbers(output: bytes, steps: int) -> NDArray[np.int32]:
    if len(output) != 4 * _NUMBERS * steps:
        raise SimulationError("a program of the control law ended early")
    return np.frombuffer(output, dtype="<i4").reshape(steps, _NUMBERS)


def _on_avr(folder: Path, name: str, steps: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    command: list[str | Path] = [folder / "run", "atmega328p", folder / name]
    numbers = _numbers(subprocess.run(command, stdout=subprocess.PIPE, check=False).stdout, steps)
    return numbers[:, 4].astype(np.int64), numbers[:, :4]


def _on_h8(folder: Path, name: str, steps: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Runs a program on the H8 simulator. Returns the clock cycles of each step, (steps,), and its answers, (steps, 4).

    The clock cycles ("states") of each call of control_law() are counted in the simulator's trace.
    """
    trace = folder / "trace"
    done = subprocess.run(
        [script_output("hal/h8sim/simulator"), folder / name],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        env=os.environ | {"H8SIM_TRACE": str(trace)},
        check=False,
    )
    numbers = _numbers(done.stdout, steps)
    program = rcx_budget.Program.of(folder / f"{name}.coff")
    at, stack = np.fromfile(trace, dtype=np.uint16).reshape(-1, 2).T
    trace.unlink()
    sums = np.concatenate([[0], np.cumsum(program.costs["external"][at])])
    begins = np.flatnonzero(at == program.at["control_law"])
    ends = [rcx_budget.end_of_call(stack, begin) for begin in begins.tolist()]
    if len(begins) != steps or None in ends:
        raise SimulationError("the trace of the control law has not one call a step")
    return np.asarray(sums[np.array(ends, dtype=np.int64)] - sums[begins], dtype=np.int64), numbers[:, :4]


def _code_bytes(brick: str, program: Path) -> int:
    """Returns the size of a program's code, constants and start values of variables, bytes."""
    file = program.with_suffix(".coff") if brick == "h8" else program
    tool = "h8300-hms-size" if brick == "h8" else "avr-size"
    listed = subprocess.run([tool, file], stdout=subprocess.PIPE, text=True, check=True).stdout
    sizes = re.findall(r"\d+", listed.splitlines()[1])
    return int(sizes[0]) + int(sizes[1])


PHASES = (1, 2, 3)
"""The numbers of BRAKE, TURN and DRIVE in the firmware's guidance."""

_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Records:
    """Steps of a flight: signals in SI units, index of the waypoint, and phase, (steps,) each.

    ``waypoints`` is (count, 2), m. The firmware's formats hold each signal exactly, because the signals are rounded to
    these formats.
    """

    x: Array
    y: Array
    heading: Array
    speed: Array
    accel: Array
    yaw_rate: Array
    battery: Array
    waypoint: NDArray[np.int64]
    phase: NDArray[np.int64]
    waypoints: Array


def record(steps: int) -> Records:
    """Flies the packaged mission and returns `steps` of its steps in the phases `PHASES`, spread evenly.

    The acceleration is computed from the change of the estimated speed per step, because the log has no filtered
    acceleration.
    """
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0))
    log = flown.log
    drives = np.flatnonzero((log["mode"] == 1) & np.isin(log["phase"], PHASES))
    chosen = drives[np.linspace(0, len(drives) - 1, steps).astype(int)]
    accel = np.diff(log["estimate_speed_m_s"], prepend=0.0) / STEP_S

    def rounded(name: str, unit: float) -> Array:
        return np.asarray(np.round(log[name][chosen] / unit) * unit)

    return Records(
        x=rounded("estimate_x_m", 1e-6),
        y=rounded("estimate_y_m", 1e-6),
        heading=rounded("estimate_heading_rad", _TURN / 65536),
        speed=rounded("estimate_speed_m_s", 1e-3 / 16),
        accel=np.round(accel[chosen], 3),
        yaw_rate=rounded("estimate_yaw_rate_rad_s", 1e-3),
        battery=rounded("battery_v", 1e-3),
        waypoint=log["waypoint"][chosen].astype(np.int64),
        phase=log["phase"][chosen].astype(np.int64),
        waypoints=np.asarray(mission.waypoints, dtype=np.float64),
    )


def write_records(records: Records, folder: Path) -> None:
    """Writes the files that tests/peers/build compiles: constants.inc, and records.inc in each folder inputs_FORMAT."""
    _write_constants(records, folder / "constants.inc")
    native = [
        np.round(one).astype(np.int64)
        for one in (
            records.x * 1e6,
            records.y * 1e6,
            (records.heading * 65536 / _TURN) % 65536,
            records.speed * 16e3,
            records.accel * 1e3,
            records.yaw_rate * 1e3,
            records.battery * 1e3,
        )
    ]
    si = (records.x, records.y, records.heading, records.speed, records.accel, records.yaw_rate, records.battery)
    tables: dict[str, tuple[str, Iterable[Iterable[object]]]] = {
        "native": ("native_t", zip(*native, strict=True)),
        "q16": ("record_t", zip(*(np.round(one * 65536).astype(np.int64) for one in si), strict=True)),
        "float": ("record_t", zip(*([f"{value:.9e}f" for value in one] for one in si), strict=True)),
    }
    for name, (kind, rows) in tables.items():
        place = folder / f"inputs_{name}"
        place.mkdir(parents=True, exist_ok=True)
        lines = [
            "    {" + ", ".join(map(str, (*row, waypoint, phase))) + "},"
            for row, waypoint, phase in zip(rows, records.waypoint, records.phase, strict=True)
        ]
        text = "\n".join([f"static const FLASH {kind} RECORDS[] = {{", *lines, "};", ""])
        (place / "records.inc").write_text(text, encoding="utf-8")


def holding_voltage(model: Model) -> float:
    """Returns the voltage per speed, V s/m, that holds a steady speed on level ground against back EMF and losses."""
    p = model.parameters
    loss = p["viscous_friction"] + p["mass"] * p["gravity"] * p["rolling_friction"] * p["wheel_radius"] ** 2
    return (p["emf_constant"] + p["resistance"] * loss / p["torque_constant"]) / p["wheel_radius"]


def _write_constants(records: Records, path: Path) -> None:
    rows = tomllib.loads(RCX.read_text(encoding="utf-8"))["controller"]
    c = {name: row["value"] for name, row in {**rows, **rows["coupled"]}.items() if "value" in row}
    constants = {
        "PI": math.pi,
        **{f"SPEED_{name.upper()}": c[f"speed_{name}"] for name in ("kp", "kd", "limit")},
        **{f"HEADING_{name.upper()}": c[f"heading_{name}"] for name in ("kp", "kd", "limit")},
        "SPEED_KI_PERIOD": c["speed_ki"] * STEP_S,
        "HEADING_KI_PERIOD": c["heading_ki"] * STEP_S,
        "FEEDFORWARD": c["feedforward_share"] * holding_voltage(rcx()),
        "CRUISE": c["cruise"],
        "CRUISE_SQUARED": c["cruise"] ** 2,
        "CREEP": c["creep"],
        "TWICE_DECEL": 2 * c["decel"],
        "BEARING_HOLD_SQUARED": c["bearing_hold"] ** 2,
        "BATTERY_FLOOR": c["battery_floor"],
    }
    lines = [f"#define {name} ({float(value)!r})" for name, value in constants.items()]
    pairs = ", ".join(f"{{NUM({x!r}), NUM({y!r})}}" for x, y in records.waypoints.tolist())
    whole = ", ".join(f"{{{round(1e3 * x)}, {round(1e3 * y)}}}" for x, y in records.waypoints.tolist())
    lines += [f"#define WAYPOINTS_SI {pairs}", f"#define WAYPOINTS_MM {whole}", ""]
    path.write_text("\n".join(lines), encoding="utf-8")
