"""Measures the cycles of a control step on an AVR chip, with drivers and interrupts, and the memory of the image.

The image flies the mission on simavr, in simulated time: the image itself reads the sensors and drives the motors.
simavr counts for each instruction the cycles that the data sheet states.
"""

from __future__ import annotations

import dataclasses
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot.constants import STEP_MS
from brickpilot.errors import SimulationError
from brickpilot.hil import avr_flight
from brickpilot.hil.avr_flight import AvrRobot, avr_image
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.hil.linked_flight import Progress
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from numpy.typing import NDArray

from lab.rcx_budget import STAGES, STEP

CLOCK_HZ = 16_000_000
PERIOD = CLOCK_HZ // 1000 * STEP_MS
"""Number of cycles in a control period."""

COMMANDS = "serve"
"""The function that reads the host's requests."""

MEMORY = {"atmega328p": (32 * 1024, 2048), "atmega2560": (256 * 1024, 8192)}
"""Chip -> (size of the flash, size of the RAM), bytes."""

TELEMETRY_EVERY = 10


@dataclass(frozen=True)
class Image:
    """The memory that an image needs, in bytes.

    Attributes:
        flash: size of code, constants and the start values of variables.
        ram: size of the variables; the rest of the RAM is for the stack.
        at: function -> its address.
        vectors_end: the first address after the interrupt vectors.
    """

    flash: int
    ram: int
    at: dict[str, int]
    vectors_end: int

    @classmethod
    def of(cls, elf: Path) -> Image:
        """Reads an image with the compiler's own tools."""
        sizes = {name: int(size) for name, size in re.findall(r"^(\.\w+) +(\d+)", _tool("avr-size", "-A", elf), re.M)}
        symbols = re.findall(r"^(\w+) (\w) (\w+)$", _tool("avr-nm", elf), re.M)
        at = {name: int(address, 16) for address, kind, name in symbols if kind == "T"}
        return cls(
            flash=sizes[".text"] + sizes[".data"],
            ram=sum(sizes.get(name, 0) for name in (".data", ".bss", ".noinit")),
            at=at,
            vectors_end=at["__trampolines_start"],
        )


@dataclass(frozen=True)
class AvrBudget:
    """What a control period costs on an AVR chip.

    Attributes:
        cycles: part -> (periods,) cycles of this part in each period. The parts are the stages of `rcx_budget.STAGES`,
            "rest", "step" (the sum of the stages and "rest"), "drivers" (the HAL's functions that the step calls),
            "commands" (the host's requests, with the drivers that they call), "interrupts", and "all" (all cycles in
            which the chip does not sleep).
        stack: largest stack in bytes, including interrupts.
    """

    target: str
    image: Image
    cycles: dict[str, NDArray[np.int64]]
    stack: int


def _tool(*command: str | Path) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def _functions(image: Image) -> tuple[list[str], list[tuple[int, int]]]:
    """Returns the names of the parts, and (entry address, number of its part) of each function; part 0 is "rest"."""
    parts = {"rest": (STEP,)} | STAGES | {"commands": (COMMANDS,)}
    parts["drivers"] = tuple(name for name in image.at if name.startswith("hal_"))
    functions = [
        (image.at[name], part) for part, names in enumerate(parts.values()) for name in names if name in image.at
    ]
    return list(parts), functions


class Profile:
    """Counts the cycles of a program's parts, from the time when this object is made: see `bp_avr_profile`.

    Args:
        functions: (entry address, number of its part) of each function.
        vectors_end: the first address after the interrupt vectors.
        room: the number of control steps whose cycles can be stored.
    """

    def __init__(self, robot: AvrRobot, functions: Sequence[tuple[int, int]], vectors_end: int, room: int) -> None:
        self._robot = robot
        given = robot.ffi.new("bp_avr_function[]", list(functions))
        self._rows = robot.ffi.new("bp_avr_costs[]", room)
        if robot.library.bp_avr_profile(robot.brick, given, len(given), vectors_end, self._rows, room):
            raise ValueError("too many functions or parts")

    def counted(self) -> tuple[NDArray[np.int64], int]:
        """Returns the cycles of each control step so far, and the largest stack in bytes.

        The cycles have the shape (steps, parts + 2). The last two columns are the cycles of interrupts, and all cycles
        in which the chip does not sleep.
        """
        report = self._robot.tell()
        rows = np.frombuffer(self._robot.ffi.buffer(self._rows), dtype=np.uintc).reshape(len(self._rows), -1)
        return rows[: report.profiled].astype(np.int64), int(report.stack)


def mission(target: str, duration: float | None, progress: Progress) -> AvrBudget:
    """Flies the packaged mission with the image of `target` and counts the cost of its control periods.

    Args:
        target: one of `AVR_TARGETS`.
        duration: the mission is cut after this time, s; None: the whole mission.
        progress: is called with the number of steps done, the number of all steps, and a text.

    Raises:
        InputError: the checkout of the project, the compiler or simavr is missing.
        SimulationError: the flight ended early.
    """
    elf = avr_image(target)
    image = Image.of(elf)
    names, functions = _functions(image)
    flown = scenario.load(scenario.packaged()["mission"])
    if duration is not None:
        flown = dataclasses.replace(flown, duration=duration)
    sensors = AVR_TARGETS[target].sensors[0]
    plan = flight.plan(flown, rcx(), profile="coupled", sensors=sensors, seed=0)
    profile: list[Profile] = []
    counted: list[tuple[NDArray[np.int64], int]] = []

    def look(robot: AvrRobot, step: int) -> None:
        if step == 0:
            profile.append(Profile(robot, functions, image.vectors_end, plan.steps))
        counted[:] = [profile[0].counted()]

    done = avr_flight.fly(plan, target, elf, telemetry_every=TELEMETRY_EVERY, progress=progress, each_step=look)
    if done.broke_off is not None:
        raise SimulationError(f"the mission on simavr ended early: {done.broke_off}")
    rows, stack = counted[0]
    return AvrBudget(target, image, _by_name(names, rows), stack)


def _by_name(names: list[str], rows: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Returns `AvrBudget.cycles` from the array `rows` (periods, parts + 2) of `Profile.counted`."""
    found = {name: rows[:, part] for part, name in enumerate(names)}
    rest, commands, drivers = (found.pop(name) for name in ("rest", "commands", "drivers"))
    step = rest + sum(found.values())
    return found | {
        "rest": rest,
        "step": step,
        "drivers": drivers,
        "commands": commands,
        "interrupts": rows[:, -2],
        "all": rows[:, -1],
    }


def as_dict(budget: AvrBudget) -> dict[str, Any]:
    """Returns a dictionary for JSON: median ("typical") and maximum ("most") of each part, and the image's sizes."""
    flash, ram = MEMORY[AVR_TARGETS[budget.target].chip]
    return {
        "target": budget.target,
        "cycles": {
            name: {"typical": int(np.median(taken)), "most": int(taken.max())} for name, taken in budget.cycles.items()
        },
        "periods": len(budget.cycles["all"]),
        "period_cycles": PERIOD,
        "clock_hz": CLOCK_HZ,
        "flash_bytes": budget.image.flash,
        "flash_of": flash,
        "ram_bytes": budget.image.ram,
        "stack_bytes": budget.stack,
        "ram_of": ram,
    }
