"""Flies an image of a robot's firmware on the simulator of the RCX's processor, over the simulator's pipes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from brickpilot.firmware import boards
from brickpilot.hil import ends, fly
from brickpilot.hil.ends import H8SIM_REPLY_S
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle.flight import Plan
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]


def motors(headers: Path, flags: Sequence[str], plan: Plan, scratch: Path) -> NDArray[np.int16]:
    """Builds the image in `scratch`, flies the plan with it, and returns the duties (steps, 2), 32767 = 1."""
    built = boards.run([str(ROOT / "firmware/targets/h8sim/build"), str(scratch / "h8"), f"-I{headers}", *flags], ROOT)
    simulator = boards.run([str(ROOT / "hal/h8sim/simulator")], ROOT).strip()
    brick, link = ends.start_program(["stdbuf", "-o0", simulator, built.strip()])
    end = ends.Ends(link, None, H8SIM_REPLY_S)
    flown = fly.fly(end, "h8", plan, pace=LOCKSTEP, telemetry_every=255, progress=lambda *_: None)
    link.close()
    brick.wait(10.0)
    return flown.flight.motors
