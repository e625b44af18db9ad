"""Measures the cost of a control step on the RCX's processor, and the kernel's share of processor time.

A mission is flown in lockstep on the instruction-set simulator, and the instructions are counted. A step is one call of
`loop_tick`, which reads sensors, drives motors and sends telemetry. The HAL is counted separately, because it differs:
on the simulator it is the link to the host, on a brick it consists of drivers.

To measure the share of kernel and interrupts, and the timing of control steps, the image flies the mission in a
simulated brick, in which every instruction and every interrupt takes its real time.

A "state" is a clock cycle. An access to on-chip memory takes 2 states, for a byte or a word. An access to external
memory takes 3 states for a byte and 6 states for a word, because the external bus has 8 bits; wait states are not
counted. On the RCX, brickOS and programs are in external RAM, so `EXTERNAL` has code, data and stack in external RAM.
"""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot.errors import SimulationError
from brickpilot.gen.value_headers import Cost, h8_costs
from brickpilot.hil import ends, fly, rcx_flight
from brickpilot.hil.rcx_flight import CLOCK_HZ
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from numpy.typing import NDArray

STEP = "loop_tick"
STAGES = {
    "model": ("body_predict", "body_correct_surge"),
    "heading": ("heading_step",),
    "speed": ("speed_step",),
    "pose": ("pose_step",),
    "guidance": ("mode_step",),
    "control": ("pid_step",),
    "mixer": ("mixer_step",),
    "telemetry": ("telemetry_part",),
}
"""Stage -> its functions in firmware/. Two more stages are counted: "hal" has the HAL's functions, and "rest" has all
other instructions of a step."""

COSTS = h8_costs((Path(__file__).parents[2] / "hal/h8sim/states.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Memory:
    """A memory. ``word``: states of an access to a word of code, stack or data; ``byte``: to a byte of data."""

    word: int
    byte: int

    def states(self, cost: Cost) -> int:
        """Returns the states of an instruction if code, stack and data are in this memory."""
        return (cost.code + cost.words) * self.word + cost.data_bytes * self.byte + cost.own

    def by_first_byte(self) -> NDArray[np.int64]:
        """Returns (256,): first byte of an instruction -> its states; -1: no instruction, or the states vary."""
        return np.array([self.states(COSTS[first]) if first in COSTS else -1 for first in range(256)], dtype=np.int64)


EXTERNAL = Memory(word=6, byte=3)
ON_CHIP = Memory(word=2, byte=2)
MEMORIES = {"external": EXTERNAL, "on_chip": ON_CHIP}

_CHUNK = 1 << 22
"""Number of instructions of a trace that are read at once."""


@dataclass(frozen=True)
class Counts:
    """Counts of one stage in each step. ``instructions``: (steps,); ``states``: name in `MEMORIES` -> (steps,) states.

    The states are those if code, stack and data are all in this memory.
    """

    instructions: NDArray[np.int64]
    states: dict[str, NDArray[np.int64]]


@dataclass(frozen=True)
class Size:
    """Bytes of code and constants (text), of data with a start value (data), and of data that starts as 0 (bss)."""

    text: int
    data: int
    bss: int


@dataclass(frozen=True)
class Budget:
    """What a control step costs on the RCX's processor.

    Attributes:
        stages: stage -> counts, for the stages of `STAGES`, "rest", "step" (the sum of these stages), and "hal".
        stack: largest stack of a step, in bytes.
        sizes: folder of firmware/, or hal/wire -> size of its compiled objects before linking.
    """

    stages: dict[str, Counts]
    stack: int
    sizes: dict[str, Size]


@dataclass(frozen=True)
class Program:
    """A linked program.

    Attributes:
        costs: name in `MEMORIES` -> (65536,) states of the instruction at each address.
        at: function -> its address.
    """

    costs: dict[str, NDArray[np.int64]]
    at: dict[str, int]

    @classmethod
    def of(cls, coff: Path) -> Program:
        """Reads a linked program with the compiler's own tools."""
        with tempfile.TemporaryDirectory() as folder:
            raw = Path(folder) / "raw"
            subprocess.run(["h8300-hms-objcopy", "-I", "coff-h8300", "-O", "binary", coff, raw], check=True)
            image = np.frombuffer(raw.read_bytes(), dtype=np.uint8)
        sections = subprocess.run(
            ["h8300-hms-objdump", "-h", coff], check=True, stdout=subprocess.PIPE, text=True
        ).stdout
        text = re.search(r" \.text +\w+ +(\w+)", sections)
        assert text is not None
        begin = int(text[1], 16)
        memory = np.zeros(0x10000, dtype=np.uint8)
        memory[begin : begin + len(image)] = image
        listed = subprocess.run(["h8300-hms-nm", coff], check=True, stdout=subprocess.PIPE, text=True).stdout
        at = {
            name: int(address, 16) & 0xFFFF for address, name in re.findall(r"^(\w+) T _(\w+)$", listed, re.MULTILINE)
        }
        return cls({name: kind.by_first_byte()[memory] for name, kind in MEMORIES.items()}, at)


class Counter:
    """Counts the cost of each step in a trace, which may arrive in pieces of any size. ``stack``: as in `Budget`."""

    def __init__(self, program: Program) -> None:
        self._program = program
        hal = [name for name in program.at if name.startswith("hal_")]
        self._entered = np.zeros(0x10000, dtype=np.uint8)  # address -> 1 + number of the stage that begins there
        for number, functions in enumerate((*STAGES.values(), hal)):
            self._entered[[program.at[name] for name in functions]] = 1 + number
        self._rest = np.empty((0, 2), dtype=np.uint16)
        self._steps: list[dict[str, tuple[int, ...]]] = []
        self.stack = 0

    def take(self, trace: NDArray[np.uint16]) -> None:
        """Counts the next piece of the trace, (n, 2): address and stack pointer of each executed instruction.

        Most of a trace is between the steps, where the brick waits for its link. Only the steps are looked at.
        """
        trace = np.concatenate([self._rest, trace])
        self._rest = trace[:0]
        for begin in np.flatnonzero(trace[:, 0] == self._program.at[STEP]).tolist():
            end = end_of_call(trace[:, 1], begin)
            if end is None:
                self._rest = trace[begin:]
                break
            self._count(*np.ascontiguousarray(trace[begin:end].T))
            self.stack = max(self.stack, int(trace[begin, 1]) + 2 - int(trace[begin:end, 1].min()))

    def _count(self, program_counter: NDArray[np.uint16], stack_pointer: NDArray[np.uint16]) -> None:
        """Counts the instructions of one step."""
        costs = self._program.costs.values()
        sums = [np.concatenate([[0], np.cumsum(cost[program_counter])]) for cost in costs]

        def took(first: int, last: int) -> NDArray[np.int64]:
            return np.array([last - first, *(total[last] - total[first] for total in sums)], dtype=np.int64)

        entered = self._entered[program_counter]
        counts = np.zeros((len(STAGES) + 1, 1 + len(sums)), dtype=np.int64)
        for entry in np.flatnonzero(entered).tolist():
            finish = end_of_call(stack_pointer, entry)
            assert finish is not None
            counts[entered[entry] - 1] += took(entry, finish)
        hal = counts[-1]
        whole = took(0, len(program_counter)) - hal
        found = dict(zip(STAGES, counts[:-1], strict=True))
        found |= {"rest": whole - counts[:-1].sum(axis=0), "step": whole, "hal": hal}
        self._steps.append({stage: tuple(row.tolist()) for stage, row in found.items()})

    def stages(self) -> dict[str, Counts]:
        """Returns stage -> counts of all steps so far."""
        if not self._steps:
            raise SimulationError("no step ended on the simulator")
        table = {name: np.array([step[name] for step in self._steps], dtype=np.int64) for name in self._steps[0]}
        return {
            name: Counts(rows[:, 0], {memory: rows[:, 1 + i] for i, memory in enumerate(MEMORIES)})
            for name, rows in table.items()
        }


def end_of_call(stack_pointer: NDArray[np.uint16], entry: int) -> int | None:
    """Returns the index in a trace of the first instruction after a function; None: the trace ends within the function.

    At this instruction, the function's return address is no longer on the stack.

    Args:
        stack_pointer: (n,) the stack pointer at each instruction of the trace.
        entry: index of the function's first instruction.
    """
    first, size = entry, 256  # most calls are short
    while first < len(stack_pointer):
        popped = stack_pointer[first : first + size] > stack_pointer[entry]
        at = int(popped.argmax())
        if popped[at]:
            return first + at
        first, size = first + size, min(2 * size, 1 << 14)
    return None


def mission(
    target: str, profile: str, sensors: str, duration: float | None, progress: Callable[[int, int, str], None]
) -> Budget:
    """Flies the packaged mission on the simulator and counts the cost of its steps.

    Args:
        target: one of `ends.H8SIM_TARGETS`.
        profile: ``coupled`` or ``paper``.
        sensors: as in `brickpilot run`.
        duration: the mission is cut after this time, s; None: the whole mission.
        progress: is called with the number of steps done, the number of all steps, and a text.

    Raises:
        InputError: the checkout of the project or the compiler is missing.
        SimulationError: the flight ended early.
    """
    ends.check_sensors(target, sensors)
    _, image = ends.h8_simulator(target)
    counter = Counter(Program.of(Path(image).with_suffix(".coff")))
    mission = scenario.load(scenario.packaged()["mission"])
    if duration is not None:
        mission = dataclasses.replace(mission, duration=duration)
    plan = flight.plan(mission, rcx(), profile=profile, sensors=sensors, seed=0)
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace"
        os.mkfifo(trace)
        reader = threading.Thread(target=_read, args=(trace, counter), daemon=True)
        reader.start()
        with ends.both_ends(target, trace) as both:
            flown = fly.fly(both, target, plan, pace=LOCKSTEP, telemetry_every=10, progress=progress)
        reader.join()
    if flown.broke_off is not None:
        raise SimulationError(f"the mission on the simulator ended early: {flown.broke_off}")
    return Budget(counter.stages(), counter.stack, sizes(Path(image).parent))


def sizes(folder: Path) -> dict[str, Size]:
    """Returns `Budget.sizes`, from the objects FOLDER_FOLDER_FILE.o of firmware/targets/h8sim/build in `folder`."""
    listed = subprocess.run(
        ["h8300-hms-size", *sorted(folder.glob("*.o"))], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    found: dict[str, Size] = {}
    for line in listed.splitlines()[1:]:
        text, data, bss, *_, path = line.split()
        kind, part, *_ = Path(path).name.split("_")
        if kind == "firmware" or part == "wire":
            before = found.get(f"{kind}/{part}", Size(0, 0, 0))
            found[f"{kind}/{part}"] = Size(before.text + int(text), before.data + int(data), before.bss + int(bss))
    return found


def _read(path: Path, counter: Counter) -> None:
    with path.open("rb") as file:
        while data := file.read(4 * _CHUNK):
            counter.take(np.frombuffer(data, dtype=np.uint16).reshape(-1, 2))


def as_dict(budget: Budget) -> dict[str, Any]:
    """Returns a dictionary for JSON: median ("typical") and maximum ("most") of each stage, and the sizes in bytes."""

    def pair(counts: NDArray[np.int64]) -> dict[str, int]:
        return {"typical": int(np.median(counts)), "most": int(counts.max())}

    stages = {
        name: {"instructions": pair(counts.instructions)}
        | {f"states_{memory}": pair(taken) for memory, taken in counts.states.items()}
        for name, counts in budget.stages.items()
    }
    bytes_of = {name: dataclasses.asdict(size) for name, size in budget.sizes.items()}
    return {"stages": stages, "stack_bytes": budget.stack, "bytes": bytes_of, "clock_hz": CLOCK_HZ}


LABELS = {
    "idle": "idle",
    "program": "the program's own code",
    "kernel": "the kernel's code in tasks",
    "clock": "interrupt of each ms: clock",
    "motors": "interrupt of 2 ms: motors, task switch",
    "subsystems": "interrupt of 2 ms: buttons, display",
    "converter": "interrupts of the A/D converter",
    "serial": "interrupts of the infrared line",
}
SERIAL = ("ERI", "RXI", "TXI", "TEI")


@dataclass(frozen=True)
class Share:
    """The processor time of one kind of work.

    Attributes:
        share: share of all processor time, 0..1.
        per_s: number of interrupts of this kind per second.
        states: mean number of states per interrupt.
    """

    share: float
    per_s: float
    states: float


@dataclass(frozen=True)
class KernelShare:
    """The processor time in a flight, by kind of work, and the timing of its control steps.

    Attributes:
        seconds: simulated time since the button Run was pressed, s.
        ticks_ms: (n,) time from the beginning of each control step to the beginning of the next step, ms.
        shares: kind of work in `LABELS` -> its processor time.
    """

    seconds: float
    ticks_ms: NDArray[np.float64]
    shares: dict[str, Share]


def measure_shares(sensors: str, seconds: float, progress: Callable[[int, int, str], None]) -> KernelShare:
    """Flies the first part of the packaged mission with the image for `sensors`, and returns the processor times.

    Args:
        sensors: ``imu`` or ``rotation``.
        seconds: duration of the flight after the button Run is pressed, s; the robot rests for the first two seconds.
        progress: is called with the number of steps done, the number of all steps, and a text.

    Raises:
        InputError: the checkout of the project, the compiler or brickOS is missing.
    """
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=seconds)
    plan = flight.plan(mission, rcx(), sensors=rcx_flight.SENSORS[sensors], seed=0)
    flown = rcx_flight.fly(rcx_flight.build(sensors), plan, progress)
    tally = flown.tally
    time = tally.states / CLOCK_HZ
    count = tally.count | {"serial": sum(tally.count[kind] for kind in SERIAL)}
    spent = tally.spent | {"serial": sum(tally.spent[kind] for kind in SERIAL)}
    shares = {
        kind: Share(spent[kind] / tally.states, count[kind] / time, spent[kind] / max(1, count[kind]))
        for kind in LABELS
    }
    return KernelShare(time, flown.ticks_ms, shares)


def shares_as_dict(measured: KernelShare) -> dict[str, Any]:
    """Returns the measured values as a dictionary for JSON."""
    ticks = measured.ticks_ms
    tick = {"median": float(np.median(ticks)), "p99": float(np.percentile(ticks, 99)), "most": float(ticks.max())}
    shares = {kind: dataclasses.asdict(share) for kind, share in measured.shares.items()}
    return {"seconds": measured.seconds, "tick_ms": tick, "shares": shares}
