"""The plant's end of a link: the C plant, its sensor readings as messages, and its motors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import compiled
from brickpilot.errors import SimulationError
from brickpilot.hil.fault_injection import SensorFaults
from brickpilot.link.links import Message
from brickpilot.link.messages import book, set_crc
from brickpilot.vehicle import flight

OK = 0


class PlantEnd:
    """One closed loop whose controller is at the other end of the link; `open_plant` makes it."""

    def __init__(self, library: Any, loop: Any, sensed: Any, faults: SensorFaults) -> None:
        self._faults = faults
        self._step = 0
        self._library = library
        self._loop = loop
        self._sensed = sensed
        self._layouts = book().by_name

    def sense(self) -> None:
        """Reads the sensors; call it once per step."""
        self._library.bp_loop_sense(self._loop, self._sensed)
        self._faults.act(self._sensed, self._step)
        self._step += 1

    @property
    def readings(self) -> Any:
        """The readings of this step, a ``bp_sensed``."""
        return self._sensed

    @property
    def tick_ms(self) -> int:
        """The low byte of the readings' time, which the reply also carries."""
        return int(self._sensed.time_ms) & 255

    def messages(self, sequence: int) -> list[Message]:
        """Returns the readings as a set of messages with this sequence number."""
        now, by = self._sensed, self._layouts
        tick = now.time_ms & 255
        parts: list[Message] = []
        if now.imu_status == OK:
            layout = by["IMU"]
            data = layout.pack(now.accel_surge_mm_s2, now.accel_sway_mm_s2, now.yaw_rate_mrad_s, sequence, tick)
            parts.append((layout.id, data))
        if now.rotation_status == OK:
            layout = by["ROTATION"]
            parts.append((layout.id, layout.pack(now.rotation_left, now.rotation_right, sequence, tick)))
        if now.battery_status == OK:
            layout = by["BATTERY"]
            parts.append((layout.id, layout.pack(now.battery_mv, sequence, tick)))
        if now.reference_status == OK:
            heading = now.heading_bam16 - ((now.heading_bam16 & 0x8000) << 1)
            x, y, turn = by["REFERENCE_X"], by["REFERENCE_Y"], by["REFERENCE_TURN"]
            parts.append((x.id, x.pack(now.x_um, heading, sequence, tick)))
            parts.append((y.id, y.pack(now.y_um, now.speed_mm_s_q4, sequence, tick)))
            parts.append((turn.id, turn.pack(now.true_yaw_rate_mrad_s, sequence, tick)))
        sync = by["SYNC"]
        status = (now.imu_status, now.rotation_status, now.battery_status, now.reference_status)
        head = sync.pack(now.time_ms, sequence, *status, 0)
        crc = set_crc(head, [data for _, data in parts])
        parts.append((sync.id, head[:6] + crc.to_bytes(2, "little")))
        return parts

    def act(self, left: int, right: int) -> None:
        """Drives the motors with this duty (32767 is 1) for one step.

        Raises:
            SimulationError: the plant's state diverges.
        """
        if status := self._library.bp_loop_act(self._loop, left, right):
            raise SimulationError(f"the simulation ended with status {status}", status=status)


@contextmanager
def open_plant(plan: flight.Plan, log: NDArray[np.float64], motors: NDArray[np.int16]) -> Iterator[PlantEnd]:
    """Opens the plant of a mission, which fills `log` and `motors` as `flight.fly` does.

    Raises:
        SimulationError: the plant does not start.
    """
    ffi, library = compiled.interface()
    with flight.request(plan, log, motors) as asked:
        status = ffi.new("int *")
        loop = library.bp_loop_open(asked, status)
        if loop == ffi.NULL:
            raise SimulationError(f"{plan.scenario.name}: the simulation does not start, status {status[0]}")
        try:
            yield PlantEnd(library, loop, ffi.new("bp_sensed *"), SensorFaults(plan.scenario.faults))
        finally:
            library.bp_loop_close(loop)
