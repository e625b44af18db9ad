"""Flies the mission with the RCX's own image in a simulated brick: its kernel, its interrupts, its drivers, its time.

The plant gives the sensors' voltages, as numbers of the brick's converter, and takes the time that the kernel's motor
port drove each motor. Both pass every 3 ms, the plant's step.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import ACCEL_RANGE, GYRO_RANGE, STEP_MS, STEP_S
from brickpilot.errors import InputError
from brickpilot.flash import lx
from brickpilot.flash.program import Loader
from brickpilot.flash.tally import Tally as Packets
from brickpilot.hil.checkout import checkout
from brickpilot.hil.linked_flight import Progress
from brickpilot.hil.plant_end import open_plant
from brickpilot.hil.simulated_rcx import RUN_BUTTON, SimulatedRcx, Tally
from brickpilot.vehicle import flight
from brickpilot.vehicle.flight_figures import Reached, waypoints_reached

SENSORS = {"imu": "imu", "rotation": "imu+encoders"}
"""The sensors for which an image is built -> those of the plant."""

BOOT_MS = 2000
"""The kernel sets itself up, and plays its melody."""

PACKET_GAP_MS = 10
REPLY_MS = 300
AFTER_S = 1.0
"""A flight ends so long after the display has shown its end."""

ARRIVED = "donE"

MIDDLE, RAW_MOST = 512, 1022
"""The converter's reading at 2.5 V, and the highest one that is no open input."""

ROTATION_LEVELS = (960, 832, 384, 576)
"""What a LEGO rotation sensor shows in its four positions, in the order of turning forward."""

BATTERY_MV = 0xABD4 / 0x618
"""Millivolts of one count of the converter, by brickOS's own formula."""

T = TypeVar("T")


@dataclass(frozen=True)
class RcxFlight:
    """A flight of the mission.

    Attributes:
        reached: the waypoints that the plant has passed.
        shown: what the display showed at the end: ARRIVED, a fault as "Err 7", or None: the mission had not ended.
        ticks_ms: from the beginning of one control step to that of the next, for all steps.
        tally: the work of the processor from Run on.
    """

    reached: Reached
    shown: str | None
    ticks_ms: NDArray[np.float64]
    tally: Tally


class _Line:
    """The infrared line to a simulated brick, for the loader."""

    device = "the simulated RCX"

    def __init__(self, rcx: SimulatedRcx) -> None:
        self._rcx = rcx

    def exchange(
        self, packet: bytes, find: Callable[[bytes], T | None], reply_bytes: int, patience: float = 1.0
    ) -> T | None:
        """Sends `packet` and returns its reply, or None if there was none."""
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
        functions: name -> address, if its text begins at the program's own base.
    """

    program: lx.Program
    functions: dict[str, int]


def build(sensors: str, folder: Path | None = None) -> Image:
    """Builds the image for these sensors, ``imu`` or ``rotation``, by the project's script.

    Raises:
        InputError: there is no checkout, or no compiler.
    """
    root = checkout()
    folder = folder or root / f"build/rcx-{sensors}"
    script = root / "firmware/targets/rcx/build"
    if subprocess.run([script, folder, sensors], stdout=subprocess.DEVNULL, check=False).returncode != 0:
        raise InputError(f"{script.relative_to(root)} failed")
    listed = subprocess.run(
        ["h8300-hms-nm", folder / "brickpilot.coff"], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    functions = {name: int(at, 16) & 0xFFFF for at, name in re.findall(r"^(\w+) T _(\w+)$", listed, re.MULTILINE)}
    return Image(lx.read(folder / "brickpilot.lx"), functions)


def load(rcx: SimulatedRcx, program: lx.Program) -> int:
    """Puts a program into the brick's first slot over its infrared line. Returns the address of its text."""
    loader = Loader(_Line(rcx))
    loader.delete(0)
    return loader.send(program, 0, Packets(), lambda *_: None)


def start(rcx: SimulatedRcx, image: Image) -> None:
    """Loads the image and presses Run. From then on the brick keeps the times at which a control step begins."""
    rcx.run(BOOT_MS)
    text = load(rcx, image.program)
    rcx.watch(image.functions["loop_tick"] - image.program.base + text)
    rcx.press(RUN_BUTTON)


def fly(image: Image, plan: flight.Plan, progress: Progress) -> RcxFlight:
    """Loads the image, presses Run and flies until the mission or the plan ends.

    Args:
        plan: its route must be the image's own; its duration counts from Run on.
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
_LOOK_STEPS = 100  # the display is read at this interval


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
