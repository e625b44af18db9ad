"""What the kernel, its interrupts and the program take of the RCX's processor, and whether a control step is in time.

The image flies the mission in a simulated brick, in which every instruction and every interrupt takes its time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.bench.h8_states import CLOCK_HZ
from brickpilot.hil import rcx_flight
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx

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
    """Of one kind: its share of the time, 0..1; how often an interrupt came per s; and its states, on average."""

    share: float
    per_s: float
    states: float


@dataclass(frozen=True)
class KernelShare:
    """What was measured in a flight.

    Attributes:
        seconds: simulated, from the button Run on.
        ticks_ms: from the beginning of one control step to that of the next.
        shares: each kind of `LABELS`.
    """

    seconds: float
    ticks_ms: NDArray[np.float64]
    shares: dict[str, Share]


def measure(sensors: str, seconds: float, progress: Callable[[int, int, str], None]) -> KernelShare:
    """Flies the first part of the packaged mission with the image for these sensors.

    Args:
        sensors: ``imu`` or ``rotation``.
        seconds: from the button Run on; the robot rests for the first two.
        progress: called with the steps done, all steps, and a text.

    Raises:
        InputError: no checkout of the project, no compiler or no brickOS.
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


def as_dict(measured: KernelShare) -> dict[str, Any]:
    """Returns the figures for JSON."""
    ticks = measured.ticks_ms
    tick = {"median": float(np.median(ticks)), "p99": float(np.percentile(ticks, 99)), "most": float(ticks.max())}
    shares = {kind: dataclasses.asdict(share) for kind, share in measured.shares.items()}
    return {"seconds": measured.seconds, "tick_ms": tick, "shares": shares}
