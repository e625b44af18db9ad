"""Flies with every kind of fault over every transport with many seeds, and prints the table of hal/README.md.

    python tests/loop/fault_matrix.py [RUNS]      default: 1000 flights

A flight is the first 1.5 s of the mission in lockstep. The fault begins at 0.6 s; it ends at 0.9 s, or at the flight's
end for a fault of a sensor. The seed draws the share of messages that a fault of messages affects. Before the fault,
the motor commands have to equal those of a flight without faults. A fault of messages may change them only by a safe
stop: the first command that differs has to be 0. If a fault must stop the motors, they have to stop in time.
"""

from __future__ import annotations

import dataclasses
import random
import sys
from dataclasses import dataclass

import numpy as np
from brickpilot.constants import STEP_S
from brickpilot.hil import ends, fly
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.scenario import END_KINDS, MESSAGE_KINDS, SENSOR_KINDS, Fault
from numpy.typing import NDArray

KINDS = (*MESSAGE_KINDS, *SENSOR_KINDS, *END_KINDS)
"""The kinds of faults that every brick at the end of a link may have."""

TRANSPORTS = ("serial:pty", "tcp", "can:slcan", "can:virtual")
BEGIN_S, END_S, DURATION_S = 0.6, 0.9, 1.5
REPLY_S = 0.03
STOPS_WITHIN = 100
"""If a fault must stop the motors, they must stop within this many steps: 0.25 s plus the time to notice the fault."""


@dataclass(frozen=True)
class Outcome:
    """The result of one flight. `trouble` names the condition that the flight violates; "": it violates none."""

    trouble: str
    stopped: bool  # whether a safe stop occurred
    lost_frames: int


def plan(kind: str, seed: int, transport: str) -> flight.Plan:
    """Returns the plan of a flight; the seed draws the sensors, and the rate, direction or sensor of the fault."""
    dice = random.Random(f"{seed} {kind}")
    sensors = dice.choice(("ideal", "imu+encoders"))
    fault = Fault(kind, BEGIN_S, END_S)
    if kind in MESSAGE_KINDS and kind != "disconnect":
        rate = dice.choice((0.002, 0.02, 0.2, 1.0))
        fault = dataclasses.replace(fault, rate=rate, direction=dice.choice(("both", "to_brick", "from_brick")))
    if kind in SENSOR_KINDS:
        present = ("battery", "reference") if sensors == "ideal" else ("imu", "rotation", "battery")
        fault = dataclasses.replace(fault, sensor=dice.choice(present), to_s=DURATION_S)
    mission = dataclasses.replace(
        scenario.load(scenario.packaged()["mission"]), duration=DURATION_S, start_at=0.1, faults=(fault,)
    )
    return flight.plan(mission, rcx(), sensors=sensors, seed=seed)


def unharmed(wanted: flight.Plan) -> NDArray[np.int16]:
    """Returns the motor commands (steps, 2) of the same flight without faults."""
    calm = dataclasses.replace(wanted.scenario, faults=())
    return flight.fly(dataclasses.replace(wanted, scenario=calm)).motors


def run(kind: str, seed: int, transport: str) -> Outcome:
    """Flies once with a fault over a transport, and returns the result."""
    wanted = plan(kind, seed, transport)
    with ends.both_ends(transport) as both:
        flown = fly.fly(
            dataclasses.replace(both, reply_s=REPLY_S),
            transport,
            wanted,
            pace="lockstep",
            telemetry_every=10,
            progress=lambda *_: None,
        )
    return Outcome(trouble_of(wanted, flown), flown.safe_stops > 0, flown.lost_frames)


def trouble_of(wanted: flight.Plan, flown: fly.HilFlight) -> str:
    """Returns the condition that the flight `flown` violates; "": it violates none."""
    (fault,) = wanted.scenario.faults
    motors, calm = flown.flight.motors, unharmed(wanted)[: len(flown.flight.motors)]
    begin = round(fault.from_s / STEP_S)
    if not np.array_equal(motors[:begin], calm[:begin]):
        return "differs before the fault"
    if fault.kind in MESSAGE_KINDS:
        return _message_trouble(fault, flown, motors, calm)
    if fault.kind in END_KINDS or (fault.kind == "missing_sensor" and fault.sensor in ("imu", "reference")):
        late = begin + STOPS_WITHIN + (round((END_S - BEGIN_S) / STEP_S) if fault.kind == "brown_out" else 0)
        return "" if not motors[late:].any() else "the motors were not stopped in time"
    return ""


def _message_trouble(fault: Fault, flown: fly.HilFlight, motors: NDArray[np.int16], calm: NDArray[np.int16]) -> str:
    differs = np.flatnonzero((motors != calm).any(axis=1))
    if fault.kind == "disconnect":
        held = motors[round(fault.from_s / STEP_S) : round(fault.to_s / STEP_S)]
        return "" if not held.any() and flown.safe_stops else "the motors ran although the link was lost"
    if len(differs) == 0:
        return ""
    if flown.safe_stops == 0:
        return "a motor command that the controller did not give"
    return "" if not motors[differs[0]].any() else "the first difference is not a stop"


def main() -> int:
    """Flies every fault over every transport and prints the table. Returns 1 if a flight violated a condition."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    cells = [(kind, transport) for kind in KINDS for transport in TRANSPORTS]
    found: dict[tuple[str, str], list[Outcome]] = {cell: [] for cell in cells}
    for number in range(runs):
        kind, transport = cells[number % len(cells)]
        outcome = run(kind, number // len(cells), transport)
        found[kind, transport].append(outcome)
        if outcome.trouble:
            print(f"{kind} over {transport}, seed {number // len(cells)}: {outcome.trouble}", file=sys.stderr)
    print(f"| fault | {' | '.join(TRANSPORTS)} |\n|---|{'---|' * len(TRANSPORTS)}")
    for kind in KINDS:
        texts = []
        for transport in TRANSPORTS:
            held = found[kind, transport]
            good, stops = sum(not each.trouble for each in held), sum(each.stopped for each in held)
            texts.append(f"{good} of {len(held)}, {stops} stopped")
        print(f"| `{kind}` | {' | '.join(texts)} |")
    return 1 if any(outcome.trouble for cell in found.values() for outcome in cell) else 0


if __name__ == "__main__":
    raise SystemExit(main())
