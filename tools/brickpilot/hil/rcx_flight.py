"""Flies the mission with the image for an RCX, in a simulated brick with kernel, interrupts, drivers and timing.

Plant and brick exchange values every 3 ms, the plant's step. The plant gives the sensors' voltages as counts of the
brick's converter; the brick gives the time for which the kernel's motor port drove each motor. The brick is an RCX with
brickOS in simulated time: processor, interrupts, converter, timers and serial line (hal/h8sim).
"""

from __future__ import annotations

import os
import re
import struct
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import ACCEL_RANGE, GYRO_RANGE, STEP_MS, STEP_S
from brickpilot.errors import SimulationError
from brickpilot.flash import image_files
from brickpilot.flash.program import Loader
from brickpilot.flash.program import Tally as Packets
from brickpilot.hil.checkout import checkout, script_output
from brickpilot.hil.linked_flight import Progress
from brickpilot.hil.plant_end import open_plant
from brickpilot.link.tower import Tower
from brickpilot.vehicle import flight
from brickpilot.vehicle.flight_figures import Reached, waypoints_reached

SENSORS = {"imu": "imu", "rotation": "imu+encoders"}
"""Sensors for which an image is built -> sensors of the plant."""

BOOT_MS = 2000
"""Time in ms in which the kernel starts and plays its melody."""

PACKET_GAP_MS = 10
REPLY_MS = 300
AFTER_S = 1.0
"""Time in s that a flight lasts after the display has shown the mission's end."""

ARRIVED = "donE"

MIDDLE, RAW_MOST = 512, 1022
"""The converter's reading at 2.5 V, and the converter's highest reading with a connected sensor."""

ROTATION_LEVELS = (960, 832, 384, 576)
"""The converter's readings of a LEGO rotation sensor in its four positions, in the order of a forward turn."""

BATTERY_MV = 0xABD4 / 0x618
"""Millivolts of one count of the converter, by brickOS's own formula."""

T = TypeVar("T")


@dataclass(frozen=True)
class RcxFlight:
    """A flight of the mission.

    Attributes:
        reached: the waypoints that the plant reached.
        shown: the display's text at the end: ARRIVED, or a fault such as "Err 7"; None: the mission had not ended.
        ticks_ms: times in ms, each from the beginning of a control step to the beginning of the next step.
        tally: the processor's work since the press of Run.
    """

    reached: Reached
    shown: str | None
    ticks_ms: NDArray[np.float64]
    tally: Tally


class _Line(Tower):
    """An infrared tower in front of a simulated brick."""

    def __init__(self, rcx: SimulatedRcx) -> None:
        self.device = "the simulated RCX"
        self._rcx = rcx

    def exchange(
        self, packet: bytes, find: Callable[[bytes], T | None], reply_bytes: int, patience: float = 1.0
    ) -> T | None:
        self._rcx.run(PACKET_GAP_MS)
        received = b"".join(self._rcx.bring(value) for value in packet)
        for _ in range(0, round(patience * REPLY_MS), PACKET_GAP_MS):
            if (reply := find(received)) is not None:
                return reply
            received += self._rcx.run(PACKET_GAP_MS)
        return find(received)

    def lost(self, done: str = "") -> TimeoutError:
        return TimeoutError(f"{self.device} no longer replies{done}")


@dataclass(frozen=True)
class Image:
    """The autopilot as a program of brickOS.

    Attributes:
        functions: name of a function -> its address if the program's text is loaded at `program.base`.
    """

    program: image_files.Program
    functions: dict[str, int]


def build(sensors: str, folder: Path | None = None) -> Image:
    """Builds the image for these sensors, ``imu`` or ``rotation``, by the project's script.

    Raises:
        InputError: there is no checkout, or no compiler.
    """
    folder = folder or checkout() / f"build/rcx-{sensors}"
    script_output("firmware/targets/rcx/build", str(folder), sensors)
    listed = subprocess.run(
        ["h8300-hms-nm", folder / "brickpilot.coff"], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    functions = {name: int(at, 16) & 0xFFFF for at, name in re.findall(r"^(\w+) T _(\w+)$", listed, re.MULTILINE)}
    return Image(image_files.read_program(folder / "brickpilot.lx"), functions)


def start(rcx: SimulatedRcx, image: Image) -> None:
    """Loads the image over the infrared line, presses Run, and starts to record the beginnings of control steps."""
    rcx.run(BOOT_MS)
    loader = Loader(_Line(rcx))
    loader.delete(0)
    text = loader.send(image.program, 0, Packets(), lambda *_: None)
    rcx.watch(image.functions["loop_tick"] - image.program.base + text)
    rcx.press(RUN_BUTTON)


def fly(image: Image, plan: flight.Plan, progress: Progress) -> RcxFlight:
    """Loads the image, presses Run and flies until the mission or the plan ends.

    Args:
        plan: the plan; its route must be the route in the image, and its duration counts from the press of Run.
        progress: called with the steps done, all steps, and a text.

    Raises:
        InputError: no checkout of the project, no compiler or no brickOS.
        SimulationError: the brick switched itself off, or the plant's state diverges.
    """
    log, motors = np.zeros((plan.steps, len(flight.log_names()))), np.zeros((plan.steps, 2), dtype=np.int16)
    times = []
    with SimulatedRcx() as rcx, open_plant(plan, log, motors) as plant:
        start(rcx, image)
        before = rcx.tally()
        done, last = 0, plan.steps
        shown = None
        while done < last:
            plant.sense()
            rcx.convert(*_raw(plant.readings, plan.sensors))
            rcx.run(STEP_MS)
            plant.act(*(_duty(us) for us in rcx.driven))
            done += 1
            if done % _LOOK_STEPS == 0:
                progress(done, plan.steps, "")
                times.append(rcx.watched())
                if shown is None and (shown := next((end for end in _ENDS if rcx.shows(end)), None)):
                    last = min(last, done + round(AFTER_S / STEP_S))
        times.append(rcx.watched())
        tally = rcx.tally().since(before)
    columns = dict(zip(flight.log_names(), log[:done].T, strict=True))
    reached = waypoints_reached(columns["time_s"], columns["true_x_m"], columns["true_y_m"], plan.scenario.waypoints)
    return RcxFlight(reached, shown, 1e3 * np.diff(np.concatenate(times)), tally)


_ENDS = (ARRIVED, *(f"Err {fault}" for fault in range(1, 10)))
_LOOK_STEPS = 100  # number of steps between two readings of the display


def _duty(us: int) -> int:
    return max(-32767, min(32767, round(us / (1e3 * STEP_MS) * 32767)))


def _raw(now: Any, sensors: str) -> tuple[int, int, int, int]:
    """Returns the converter's readings of the battery and of inputs 1, 2 and 3."""
    battery = min(1023, round(now.battery_mv / BATTERY_MV))
    gyro = _axis(now.yaw_rate_mrad_s, GYRO_RANGE)
    if sensors == "imu":
        return battery, _axis(now.accel_surge_mm_s2, ACCEL_RANGE), gyro, _axis(now.accel_sway_mm_s2, ACCEL_RANGE)
    left, right = (ROTATION_LEVELS[count % 4] for count in (now.rotation_left, now.rotation_right))
    return battery, left, gyro, right


def _axis(value: float, full_scale: float) -> int:
    return max(1, min(RAW_MOST, MIDDLE + round(1e-3 * value * MIDDLE / full_scale)))


CLOCK_HZ = 16_000_000
RUN_BUTTON = 2
BYTE_MS = 11 / 2.4
PRESS_MS = 250
"""Duration of a press in ms. It is long enough for the kernel's driver, which checks the buttons twice in 100 ms."""

KINDS = ("idle", "program", "kernel", "clock", "motors", "subsystems", "ERI", "RXI", "TXI", "TEI", "converter")
"""The uses of the processor's time, in the order of hal/h8sim.

idle: the processor sleeps; program, kernel: a task of it runs. All others are interrupts. clock: the NMI of each ms;
motors: the timer's compare match A every 2 ms, which also switches tasks; subsystems: the timer's match B, for buttons,
display and time-outs; ERI to TEI: the serial line; converter: the A/D converter.
"""

DISPLAY, FONT = 0xEF43, 0xA906
"""Addresses in Debian's kernel: the display's memory, and the segments of each character."""

# For each digit, from left to right: where segments 0 to 6 of the font lie in the display's memory, as (byte, bit).
_SEGMENTS = (
    ((3, 5), (7, 1), (3, 4), (7, 5), (7, 7), (3, 7), (7, 3)),
    ((3, 1), (8, 1), (3, 0), (8, 5), (8, 7), (3, 3), (8, 3)),
    ((1, 1), (5, 1), (1, 0), (6, 5), (6, 7), (1, 3), (5, 3)),
    ((0, 5), (4, 1), (0, 4), (5, 5), (5, 7), (0, 7), (4, 3)),
    ((1, 5), (2, 5), (1, 4), (4, 5), (4, 7), (1, 7), (2, 7)),
)


@dataclass(frozen=True)
class Tally:
    """The work of the processor in a span of time.

    Attributes:
        states: number of clock periods ("states").
        count: kind -> number of interrupts of this kind; 0 for idle, program and kernel.
        spent: kind -> number of states that the processor spent in this kind of work.
    """

    states: int
    count: dict[str, int]
    spent: dict[str, int]

    def since(self, before: Tally) -> Tally:
        return Tally(
            self.states - before.states,
            {kind: self.count[kind] - before.count[kind] for kind in KINDS},
            {kind: self.spent[kind] - before.spent[kind] for kind in KINDS},
        )


class SimulatedRcx:
    """A brick with brickOS and no program, switched on during a `with` block. Time passes only in `run` and `bring`.

    Attributes:
        ms: simulated time since the brick was switched on.
        driven: time in us for which motors A and C were driven in the last `run` or `bring`, forward minus backward.

    Raises:
        InputError: no checkout of the project, no compiler or no brickOS.
    """

    def __init__(self) -> None:
        self.ms = 0.0
        self.driven = (0, 0)
        self._lock = threading.Lock()  # a thread that serves a serial line may use the brick at the same time
        simulator, kernel = script_output("hal/h8sim/simulator"), script_output("hal/h8sim/kernel")
        self._process = subprocess.Popen(
            [simulator, kernel],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"H8SIM_BRICK": "1"},
        )

    def __enter__(self) -> SimulatedRcx:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=10)

    def run(self, ms: int) -> bytes:
        """Lets time pass. Returns the bytes that the brick sends."""
        return self._pass(struct.pack(">sH", b"r", ms), ms)

    def bring(self, value: int, *, wrong: bool = False) -> bytes:
        """Sends a byte to the brick; `wrong`: with a wrong parity. Returns the bytes that the brick sends meanwhile."""
        return self._pass(struct.pack(">sBB", b"l", value, wrong), BYTE_MS)

    def hold(self, keys: int) -> None:
        """Holds the buttons `keys` from now on, and releases all others."""
        with self._lock:
            self._write(struct.pack(">sB", b"k", keys))

    def press(self, key: int) -> None:
        """Presses a button for `PRESS_MS`, and releases it for the same time."""
        for held in (key, 0):
            self.hold(held)
            self.run(PRESS_MS)

    def convert(self, battery: int, *inputs: int) -> None:
        """Sets the converter's readings of the battery and of inputs 1 to 3, 0..1023."""
        command = b"".join(struct.pack(">sBH", b"a", at, raw) for at, raw in enumerate((battery, *inputs)))
        with self._lock:
            self._write(command)

    def memory(self, address: int, size: int) -> bytes:
        with self._lock:
            self._write(struct.pack(">sHH", b"m", address, size))
            return self._read(size)

    def word(self, address: int) -> int:
        return int.from_bytes(self.memory(address, 2), "big")

    def shows(self, text: str) -> bool:
        """Returns whether the display shows `text` in its five digits."""
        display, font = self.memory(DISPLAY, 9), self.memory(FONT, 128)
        shown = [
            sum((display[byte] >> bit & 1) << segment for segment, (byte, bit) in enumerate(digit))
            for digit in _SEGMENTS
        ]
        return shown == [font[ord(character)] for character in text.ljust(len(_SEGMENTS))]

    def watch(self, address: int) -> None:
        """Starts to record each time at which the instruction at `address` begins; `watched` returns the times."""
        with self._lock:
            self._write(struct.pack(">sH", b"b", address))

    def watched(self) -> NDArray[np.float64]:
        """Returns the times recorded since the last call, in s since the start; at most the first 4096 times."""
        with self._lock:
            self._write(b"e")
            count = int.from_bytes(self._read(2), "big")
            return np.frombuffer(self._read(8 * count), dtype=">u8").astype(float) / CLOCK_HZ

    def tally(self) -> Tally:
        """Returns the work of the processor since the start."""
        with self._lock:
            self._write(b"t")
            states = int.from_bytes(self._read(8), "big")
            rows = [struct.unpack(">IQ", self._read(12)) for _ in KINDS]
        counts, spent = zip(*rows, strict=True)
        return Tally(states, dict(zip(KINDS, counts, strict=True)), dict(zip(KINDS, spent, strict=True)))

    def _pass(self, command: bytes, ms: float) -> bytes:
        with self._lock:
            self._write(command)
            left, right, size = struct.unpack(">iiH", self._read(10))
            self.ms += ms
            self.driven = (left, right)
            return self._read(size)

    def _write(self, command: bytes) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(command)
        self._process.stdin.flush()

    def _read(self, size: int) -> bytes:
        assert self._process.stdout is not None
        received = self._process.stdout.read(size)
        if len(received) != size:
            raise SimulationError("the simulated RCX has been switched off")
        return received
