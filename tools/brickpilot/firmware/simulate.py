"""Flies a robot with its own firmware, compiled for this machine, with the control step and sensors of the board.

An image from `brickpilot firmware` is flown on a simulator of its chip.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from brickpilot.constants import STEP_S
from brickpilot.errors import InputError, SimulationError
from brickpilot.firmware import boards, robot
from brickpilot.firmware.robot import Robot, packaged
from brickpilot.hil import ends, fly
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.compensation import FORMATS
from brickpilot.vehicle.flight import Plan
from brickpilot.vehicle.scenario import Scenario
from brickpilot.vehicle.settings import plain

REST_S = 2.0
"""Time in s at rest before the start, to learn the gyro's bias; the programs in firmware/targets use the same time."""

REPLY_S = 5.0
SHORTEST_LEG = 3.0  # least length of a leg, in acceptance radii; in the packaged mission it is 4.5
SLACK = 1.25  # factor on the duration of a mission, because the time for turns does not scale with the mission


def mission(robot: Robot, file: str | None) -> Scenario:
    """Returns the mission of a robot: the user's `file` without changes, or the packaged mission scaled to the robot.

    The scale is the robot's length over the packaged robot's length. A slow robot gets a smaller scale, so that its
    mission lasts no longer: with time, the error due to the learnt gyro bias grows. But no leg becomes shorter than
    `SHORTEST_LEG` acceptance radii.

    Raises:
        InputError: the file is bad or no mission, or the scaled mission is larger than a route can hold.
    """
    if file is not None:
        own = scenario.load(scenario.find(file))
        if own.kind != "mission":
            raise InputError("is a manoeuvre; firmware flies missions", file=file, field="kind")
        return own
    route, reference = scenario.load(scenario.packaged()["mission"]), packaged()
    cruise = robot.value("controller", "coupled", "cruise")
    packaged_cruise = plain(reference["controller"]["coupled"])["cruise"]
    shortest = min(math.dist(*leg) for leg in itertools.pairwise(route.waypoints))
    least = max(cruise / packaged_cruise, SHORTEST_LEG * robot.length / 2 / shortest)
    scale = min(robot.length / plain(reference["robot"])["length"], least)
    if max(abs(coordinate) for point in route.waypoints for coordinate in point) * scale > scenario.farthest():
        raise InputError(
            f"the packaged mission would be {scale:.3g} times as large; name one with --scenario", file=robot.toml.path
        )
    points = tuple((round(scale * x, 3), round(scale * y, 3)) for x, y in route.waypoints)
    duration = REST_S + SLACK * route.duration * max(scale * (packaged_cruise / cruise), 1.0)
    duration = min(math.ceil(duration / STEP_S) * STEP_S, scenario.LONGEST_S)
    same = math.isclose(scale, 1.0, rel_tol=1e-6)
    title = route.title if same else f"{route.title}, {scale:.2f} times as large"
    return dataclasses.replace(route, title=title, waypoints=points, duration=duration, start_at=REST_S, packaged=same)


def plan(robot: Robot, route: Scenario, sensors: str, seed: int) -> flight.Plan:
    """Returns the plan of the flight without cruise speed and compensation, because the firmware contains both."""
    made = flight.plan(route, robot.model, profile="coupled", sensors=sensors, seed=seed)
    devices = robot.vehicle["sensors"]  # [imu] and [encoder] have the names of the fields of `bp_devices`
    return dataclasses.replace(
        made,
        cruise=0.0,
        acceptance=robot.length / 2,
        devices={
            **plain(devices["imu"]),
            **plain(devices["encoder"]),
            "battery_resolution": robot.value("sensors", "battery", "resolution"),
        },
        start_step=round((REST_S if route.start_at is None else route.start_at) / STEP_S),
    )


def fly_own(root: Path, headers: Path, flags: Sequence[str], planned: flight.Plan, folder: Path) -> fly.HilFlight:
    """Compiles the firmware for this machine in `folder`, and flies the plan with it in lockstep.

    Raises:
        WorkFailedError: the compiler fails.
        SimulationError: the plant diverges, or the firmware ends early.
    """
    program = folder / "brick"
    boards.run([str(root / "firmware/targets/host/build"), str(program), f"-I{headers}", *flags], root)
    brick, link = ends.start_program([program])
    try:
        end = ends.Ends(link, None, REPLY_S)
        flown = fly.fly(end, "firmware", planned, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None)
    finally:
        link.close()
        status = ends.wait_for_end(brick)
    if status != 0 or flown.broke_off is not None:
        raise SimulationError(f"the firmware on this machine ended: {flown.broke_off or f'status {status}'}")
    return flown


def undone(robot: Robot) -> dict[str, float]:
    """Returns setting -> value in SI, for the robot's effects that the firmware compensates."""
    return {FORMATS[name].name: FORMATS[name].value(raw) for name, raw in robot.known.items() if raw}


FIGURES = "firmware.json"
_TARGETS = {
    ("avr", "imu"): "avr:328p-imu",
    ("avr", "imu+encoders"): "avr:328p-rotation",
    ("avr:2560", "imu"): "avr:2560",
    ("avr:2560", "imu+encoders"): "avr:2560",
    ("rcx", "imu"): "h8sim:imu",
    ("rcx", "imu+encoders"): "h8sim:rotation",
}
"""(Board, sensors) of an image -> the target of `hil` that simulates the image's chip."""
_AVR_MACHINE = b"\x53\x00"
"""Bytes 18 and 19 of an ELF file for an AVR."""


@dataclass(frozen=True)
class OwnImage:
    """An image, the target of `hil` that simulates its chip, and the sensors for which the image was made.

    `scales`: input -> size of one count of the 10-bit converter in rad/s, m/s^2 or V, from the board.h of the image;
    empty for an image for an RCX, because the simulated RCX receives its readings as messages.
    """

    path: Path
    target: str
    scales: Mapping[str, float]
    sensors: str


def find_image(image: Path) -> OwnImage:
    """Returns the image at this path: in a folder that `firmware` wrote, or in a folder below it that build.sh wrote.

    Raises:
        InputError: there is no such file, the folder does not name its board, or no simulator flies the image.
    """
    if not image.is_file():
        raise InputError("no such file", file=image)
    places = (image.parent, image.resolve().parent.parent)
    folder = next((place for place in places if (place / FIGURES).is_file()), None)
    if folder is None:
        raise InputError(f"stands in no folder of `brickpilot firmware`: {FIGURES} is missing beside it", file=image)
    figures = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    target = _TARGETS.get((figures.get("board"), figures.get("flight", {}).get("sensors")))
    if target is None or target.partition(":")[0] != _simulator(image):
        flown = "it flies an Arduino's ELF file and an RCX's brickpilot.h8sim"
        raise InputError(f"is nothing that hil flies of the board {figures.get('board')}; {flown}", file=image)
    scales = _scales(folder / "include/avr/board.h") if target.startswith("avr") else {}
    return OwnImage(image, target, scales, figures["flight"]["sensors"])


def _simulator(image: Path) -> str | None:
    """Returns the targets that fly a file: ``avr`` for an AVR's ELF file, ``h8sim`` for a .h8sim file, else None."""
    with image.open("rb") as file:
        head = file.read(20)
    if head.startswith(b"\x7fELF") and head[18:] == _AVR_MACHINE:
        return "avr"
    return "h8sim" if image.suffix == ".h8sim" and head.startswith(b"S0") else None


def image_plan(image: OwnImage, model: Path, scenario: str | None, sensors: str | None, seed: int) -> Plan:
    """Returns the flight plan of a model file's robot with its image. Without `scenario`: the scaled mission.

    Raises:
        InputError: a file is bad, or the image was not made for `sensors`.
    """
    if sensors not in (None, image.sensors):
        raise InputError(f"the image was made for {image.sensors}", field=f"--sensors {sensors}")
    own = robot.load(model)
    return plan(own, mission(own, scenario), image.sensors, seed)


def _scales(board: Path) -> dict[str, float]:
    """Returns input -> size of one count of the 10-bit converter in rad/s, m/s^2 or V, from a board.h.

    Raises:
        InputError: board.h is missing, or lacks a scale.
    """
    if not board.is_file():
        raise InputError("is missing: it has the scales of the sensors", file=board)
    text = board.read_text(encoding="utf-8")
    scales = {}
    for name in ("GYRO", "SURGE", "SWAY"):
        per_count = re.search(rf"#define BOARD_{name}_PER_COUNT_Q8 (\d+)", text)
        reversed_ = re.search(rf"#define BOARD_{name}_REVERSED (\w+)", text)
        if per_count is None or reversed_ is None:
            raise InputError(f"has no scale of {name}", file=board)
        scales[name] = (-1e-3 if reversed_[1] in ("true", "1") else 1e-3) * int(per_count[1]) / 256
    full = re.search(r"#define BOARD_BATTERY_FULL_MV (\d+)", text)
    if full is None:
        raise InputError("has no scale of the battery", file=board)
    return {**scales, "BATTERY_INPUT": int(full[1]) * 1e-3 / 1024}
