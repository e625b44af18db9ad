"""The plant's end of a link: the C plant with its motors, its sensor readings as messages, and injected faults.

The [[faults]] of a scenario act on messages, on sensors, and on the plant or the brick. The random numbers of the
faults are seeded. Faults of messages act above the transport, so they are the same on every transport. Only the CRC
inside a message can detect such a fault: the transport adds its checksum after the fault, or checks it before.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import compiled
from brickpilot.errors import SimulationError
from brickpilot.link.links import Link, Message, WrappedLink
from brickpilot.link.messages import book, set_crc
from brickpilot.vehicle import flight
from brickpilot.vehicle.scenario import MESSAGE_KINDS, Fault

OK = 0


class PlantEnd:
    """The plant of a closed loop whose controller is at the other end of the link; made by `open_plant`."""

    def __init__(self, library: Any, loop: Any, sensed: Any, faults: SensorFaults) -> None:
        self._faults = faults
        self._step = 0
        self._library = library
        self._loop = loop
        self._sensed = sensed
        self._layouts = book().by_name

    def sense(self) -> None:
        """Reads the sensors; it must be called once per step."""
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
        now = self._sensed
        tick = now.time_ms & 255
        parts: list[Message] = []

        def add(name: str, *values: int) -> None:
            layout = self._layouts[name]
            parts.append((layout.id, layout.pack(*values, sequence, tick)))

        if now.imu_status == OK:
            add("IMU", now.accel_surge_mm_s2, now.accel_sway_mm_s2, now.yaw_rate_mrad_s)
        if now.rotation_status == OK:
            add("ROTATION", now.rotation_left, now.rotation_right)
        if now.battery_status == OK:
            add("BATTERY", now.battery_mv)
        if now.reference_status == OK:
            heading = now.heading_bam16 - ((now.heading_bam16 & 0x8000) << 1)  # the heading as a signed number
            add("REFERENCE_X", now.x_um, heading)
            add("REFERENCE_Y", now.y_um, now.speed_mm_s_q4)
            add("REFERENCE_TURN", now.true_yaw_rate_mrad_s)
        sync = self._layouts["SYNC"]
        status = (now.imu_status, now.rotation_status, now.battery_status, now.reference_status)
        head = sync.pack(now.time_ms, sequence, *status, 0)
        crc = set_crc(head, [data for _, data in parts])
        parts.append((sync.id, head[:6] + crc.to_bytes(2, "little")))
        return parts

    def act(self, left: int, right: int) -> None:
        """Drives the motors with these duties (32767 means 1) for one step.

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
    with flight.request(plan, log, motors) as flight_request:
        status = ffi.new("int *")
        loop = library.bp_loop_open(flight_request, status)
        if loop == ffi.NULL:
            raise SimulationError(f"{plan.scenario.name}: the simulation does not start, status {status[0]}")
        try:
            yield PlantEnd(library, loop, ffi.new("bp_sensed *"), SensorFaults(plan.scenario.faults))
        finally:
            library.bp_loop_close(loop)


HELD_FOR = 20
"""The number of later messages that overtake a delayed message."""

FLOOD = 20
"""A flood puts this number of random messages before each message that it hits."""

BROWN_OUT_MV = 4500


class _Direction:
    """One direction of a link with its delayed messages and its random generator."""

    def __init__(self, name: str, faults: Sequence[Fault], seed: int) -> None:
        self._faults = [fault for fault in faults if fault.direction in ("both", name)]
        self._dice = random.Random(f"{seed} {name}")
        self._held: list[tuple[int, Message]] = []  # (number of messages that will still overtake the message, message)

    def through(self, messages: Sequence[Message], step: int) -> list[Message]:
        """Returns the messages that the link delivers when it gets `messages` at control step `step`."""
        if not self._held and not any(fault.acts(step) for fault in self._faults):
            return list(messages)
        out: list[Message] = []
        for message in messages:
            passed = [message]
            for fault in self._faults:
                if fault.acts(step):
                    passed = [later for earlier in passed for later in self._hit(fault, earlier)]
            out += passed
            due = [message for left, message in self._held if left <= 1]
            self._held = [(left - 1, message) for left, message in self._held if left > 1]
            out += due
        return out

    def _hit(self, fault: Fault, message: Message) -> list[Message]:
        """Returns the messages that the link delivers at once in place of `message` under `fault`."""
        dice = self._dice
        if dice.random() >= fault.rate:
            return [message]
        identifier, data = message
        if fault.kind in ("drop", "disconnect"):
            return []
        if fault.kind == "duplicate":
            return [message, message]
        if fault.kind in ("delay", "reorder"):
            self._held.append((HELD_FOR if fault.kind == "delay" else 2, message))
            return []
        if fault.kind == "truncate":
            return [(identifier, data[: dice.randrange(len(data) or 1)])]
        if fault.kind == "corrupt":
            bit = dice.randrange(11 + 8 * len(data))
            if bit < 11:
                return [(identifier ^ 1 << bit, data)]
            whole = int.from_bytes(data, "little") ^ 1 << bit - 11
            return [(identifier, whole.to_bytes(len(data), "little"))]
        return [(dice.randrange(0x800), dice.randbytes(dice.randrange(9))) for _ in range(FLOOD)] + [message]


class FaultyLink(WrappedLink):
    """A link that applies faults to its messages. The owner sets `step`, the present control step.

    Args:
        link: the link to wrap; it is closed when this link is closed.
        faults: the faults of the scenario; this class uses only those of MESSAGE_KINDS.
        seed: seed of the random generator.
    """

    def __init__(self, link: Link, faults: Sequence[Fault], seed: int) -> None:
        hits = [fault for fault in faults if fault.kind in MESSAGE_KINDS]
        super().__init__(link)
        self.step = 0
        self._out, self._back = _Direction("to_brick", hits, seed), _Direction("from_brick", hits, seed)

    def send(self, messages: Sequence[Message]) -> None:
        self._link.send(self._out.through(messages, self.step))

    def receive(self, timeout: float) -> list[Message]:
        return self._back.through(self._link.receive(timeout), self.step)


FIELDS = {
    "imu": ("accel_surge_mm_s2", "accel_sway_mm_s2", "yaw_rate_mrad_s"),
    "rotation": ("rotation_left", "rotation_right"),
    "battery": ("battery_mv",),
    "reference": ("x_um", "y_um", "heading_bam16", "speed_mm_s_q4", "true_yaw_rate_mrad_s"),
}
"""Sensor -> the fields of `bp_sensed` with its readings."""

STALE = 2


class SensorFaults:
    """Changes sensor readings according to the faults.

    Args:
        faults: the faults of the scenario; this class ignores faults of messages.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = [fault for fault in faults if fault.kind not in MESSAGE_KINDS]
        self._stuck: dict[Fault, tuple[int, ...]] = {}
        self._clock_ms = 0

    def act(self, sensed: Any, step: int) -> None:
        """Changes a `bp_sensed` in place, at control step `step`."""
        for fault in self._faults:
            if fault.kind == "plant_restart":
                self._clock_ms = sensed.time_ms if fault.begins(step) else self._clock_ms
            elif not fault.acts(step):
                continue
            elif fault.kind == "missing_sensor":
                status = f"{fault.sensor}_status"
                setattr(sensed, status, getattr(sensed, status) or STALE)
            elif fault.kind == "stuck_sensor":
                names = FIELDS[fault.sensor]
                held = self._stuck.setdefault(fault, tuple(getattr(sensed, name) for name in names))
                for name, value in zip(names, held, strict=True):
                    setattr(sensed, name, value)
            elif fault.kind == "brown_out":
                sensed.battery_mv = BROWN_OUT_MV
        sensed.time_ms -= self._clock_ms


def controller_restarts(faults: Sequence[Fault], step: int) -> bool:
    """Returns whether the controller restarts at control step `step`, by a restart fault or after a brown-out."""
    return any(
        (fault.kind == "controller_restart" and fault.begins(step)) or (fault.kind == "brown_out" and fault.ends(step))
        for fault in faults
    )
