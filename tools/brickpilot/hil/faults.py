"""Faults beneath the controller, from a scenario's [[faults]]: in messages, in sensors, in either end. Seeded.

They act on messages, above the carrier, so that they are the same in every one; damage done here therefore meets the
checks that messages carry themselves, not those of a carrier.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from brickpilot.vehicle.faults import MESSAGE_KINDS, Fault

if TYPE_CHECKING:
    from brickpilot.link.links import Frame, Link

HELD_FOR = 20
"""Messages that overtake a delayed one."""

FLOOD = 20
"""Messages of rubbish beside each message that a flood hits."""

BROWN_OUT_MV = 4500


class _Way:
    """One direction of a link: what is held back, and the dice."""

    def __init__(self, name: str, faults: Sequence[Fault], seed: int) -> None:
        self._faults = [fault for fault in faults if fault.direction in ("both", name)]
        self._dice = random.Random(f"{seed} {name}")
        self._held: list[tuple[int, Frame]] = []  # messages still to pass first, message

    def through(self, frames: Sequence[Frame], step: int) -> list[Frame]:
        """What comes out for what goes in at control step `step`."""
        if not self._held and not any(fault.acts(step) for fault in self._faults):
            return list(frames)
        out: list[Frame] = []
        for frame in frames:
            passed = [frame]
            for fault in self._faults:
                if fault.acts(step):
                    passed = [each for one in passed for each in self._hit(fault, one)]
            out += passed
            due = [frame for left, frame in self._held if left <= 1]
            self._held = [(left - 1, frame) for left, frame in self._held if left > 1]
            out += due
        return out

    def _hit(self, fault: Fault, frame: Frame) -> list[Frame]:
        dice = self._dice
        if dice.random() >= fault.rate:
            return [frame]
        identifier, data = frame
        if fault.kind in ("drop", "disconnect"):
            return []
        if fault.kind == "duplicate":
            return [frame, frame]
        if fault.kind in ("delay", "reorder"):
            self._held.append((HELD_FOR if fault.kind == "delay" else 2, frame))
            return []
        if fault.kind == "truncate":
            return [(identifier, data[: dice.randrange(len(data) or 1)])]
        if fault.kind == "corrupt":
            bit = dice.randrange(11 + 8 * len(data))
            if bit < 11:
                return [(identifier ^ 1 << bit, data)]
            whole = int.from_bytes(data, "little") ^ 1 << bit - 11
            return [(identifier, whole.to_bytes(len(data), "little"))]
        return [(dice.randrange(0x800), dice.randbytes(dice.randrange(9))) for _ in range(FLOOD)] + [frame]


class FaultyLink:
    """A link whose messages meet faults on their way. ``step`` is the control step of now: the owner sets it.

    Args:
        link: closed with this one.
        faults: those of MESSAGE_KINDS act, the others are left alone.
        seed: of the dice.
    """

    def __init__(self, link: Link, faults: Sequence[Fault], seed: int) -> None:
        hits = [fault for fault in faults if fault.kind in MESSAGE_KINDS]
        self.step = 0
        self._link = link
        self._out, self._back = _Way("to_brick", hits, seed), _Way("from_brick", hits, seed)

    @property
    def damaged(self) -> int:
        return self._link.damaged

    @damaged.setter
    def damaged(self, count: int) -> None:
        self._link.damaged = count

    def send(self, frames: Sequence[Frame]) -> None:
        self._link.send(self._out.through(frames, self.step))

    def receive(self, timeout: float) -> list[Frame]:
        return self._back.through(self._link.receive(timeout), self.step)

    def close(self) -> None:
        self._link.close()


FIELDS = {
    "imu": ("accel_surge_mm_s2", "accel_sway_mm_s2", "yaw_rate_mrad_s"),
    "rotation": ("rotation_left", "rotation_right"),
    "battery": ("battery_mv",),
    "reference": ("x_um", "y_um", "heading_bam16", "speed_mm_s_q4", "true_yaw_rate_mrad_s"),
}
"""Of ``bp_sensed``."""

STALE = 2


class SensorFaults:
    """What faults make of the readings.

    Args:
        faults: those of SENSOR_KINDS, brown-outs and restarts of the plant act.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = [fault for fault in faults if fault.kind not in MESSAGE_KINDS]
        self._stuck: dict[Fault, tuple[int, ...]] = {}
        self._clock_ms = 0

    def act(self, sensed: Any, step: int) -> None:
        """Changes a ``bp_sensed`` in place, at control step `step`."""
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
    """Whether the controller is switched on afresh at control step `step`: it does so when a brown-out ends, too."""
    return any(
        (fault.kind == "controller_restart" and fault.begins(step)) or (fault.kind == "brown_out" and fault.ends(step))
        for fault in faults
    )
