"""Compares lengths of the control step: the firmware of an RCX flies the mission with some seeds and each length.

Prints the table of firmware/README.md: `.venv/bin/python tests/loop/step_study.py`. The firmware is built for this
machine, with the flags of an RCX and the link of the RCX's simulator. `tests/python/test_hil_h8sim.py` shows that this
program and the program on the simulator give the same motor commands.
"""

from __future__ import annotations

import copy
import dataclasses
import re
import socket
import subprocess
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot.constants import STEP_S
from brickpilot.firmware import params_header
from brickpilot.hil import ends, fly
from brickpilot.link.links import StreamLink
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.settings import settings

ROOT = Path(__file__).resolve().parents[2]
SEEDS = 12
STEPS_MS = (3, 6, 9, 12, 15)
RESTS_S = (1.0, 2.0)  # rest before the start, s: of `brickpilot run`, and of firmware/targets/rcx/main.c
SENSORS = {"imu": "imu", "rotation": "imu+encoders"}  # name of the brick's build -> name in a scenario


def build(sensors: str, folder: Path, *, step_ms: int | None = None) -> Path:
    """Builds the brick's program for this machine, with the flags of `firmware/targets/rcx/flags`; returns its path.

    Args:
        sensors: name of the brick's build, a key of `SENSORS`.
        step_ms: length of the control step, to which the constants are adapted; None: the step in the flags.
    """
    command = [ROOT / "firmware/targets/rcx/flags", sensors]
    flags = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    if step_ms is not None:
        flags = re.sub(r"STEP_MS=\d+", f"STEP_MS={step_ms}", flags)
        vehicle = copy.deepcopy(tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text(encoding="utf-8")))
        vehicle["rates"]["rcx_step"]["value"] = step_ms / 1e3
        (folder / "app").mkdir(parents=True)
        (folder / "app/params_gen.h").write_text(params_header.render(vehicle, settings()), encoding="utf-8")
    program = folder / "brick"
    subprocess.run([ROOT / "firmware/targets/host/build", program, f"-I{folder}", *flags.split()], check=True)
    return program


def fly_by(program: Path, plan: flight.Plan) -> fly.HilFlight:
    """Flies `plan` in lockstep with a brick's program. The program's stdin and stdout are its link."""
    ours, theirs = socket.socketpair()
    with theirs:
        brick = subprocess.Popen([program], stdin=theirs, stdout=theirs)
    link = StreamLink(ours)
    flown = at_the_link(ends.Ends(link, None), plan)
    link.close()
    if brick.wait(5.0) != 0:
        raise RuntimeError(f"{program} ended with {brick.returncode}")
    return flown


def at_the_link(link: ends.Ends, plan: flight.Plan) -> fly.HilFlight:
    return fly.fly(link, "test", plan, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None)


def figures_of(program: Path, sensors: str, rest_s: float) -> list[dict[str, Any]]:
    """Returns `flight_figures.summary` of one flight of the packaged mission for each seed."""
    mission = scenario.load(scenario.packaged()["mission"])
    plans = [flight.plan(mission, rcx(), profile="coupled", sensors=sensors, seed=seed) for seed in range(SEEDS)]
    start_step = round(rest_s / STEP_S)
    flown = [fly_by(program, dataclasses.replace(plan, start_step=start_step)) for plan in plans]
    return [flight_figures.summary(one.flight) for one in flown]


def main() -> None:
    names = {"cross_track_rms_m": 1e3, "heading_rms_rad": 1e3, "position_estimate_error_m": 1e3}
    print("| sensors | rest | step | all 8 waypoints | cross-track | heading error | error of the position estimate |")
    print("|---|---|---|---|---|---|---|")
    for of_brick, sensors in SENSORS.items():
        for step_ms in STEPS_MS:
            with tempfile.TemporaryDirectory() as folder:
                program = build(of_brick, Path(folder), step_ms=step_ms)
                for rest_s in RESTS_S:
                    figures = figures_of(program, sensors, rest_s)
                    whole = sum(figure["waypoints_reached"] == 8 for figure in figures)
                    cross, heading, position = (
                        scale * np.mean([figure[name] for figure in figures]) for name, scale in names.items()
                    )
                    print(
                        f"| {of_brick} | {rest_s:.0f} s | {step_ms} ms | {whole} of {SEEDS} | {cross:.0f} mm "
                        f"| {heading:.0f} mrad | {position:.0f} mm |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
