"""An image that `brickpilot firmware` has made, and the flight of its robot with it on a simulator of its chip."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.firmware import robot, simulate
from brickpilot.vehicle.flight import Plan

FIGURES = "firmware.json"
_TARGETS = {
    ("avr", "imu"): "avr:328p-imu",
    ("avr", "imu+encoders"): "avr:328p-rotation",
    ("avr:2560", "imu"): "avr:2560",
    ("avr:2560", "imu+encoders"): "avr:2560",
    ("rcx", "imu"): "h8sim:imu",
    ("rcx", "imu+encoders"): "h8sim:rotation",
}
"""Board and sensors of an image -> the target whose chip it is for."""
_AVR_MACHINE = b"\x53\x00"
"""At byte 18 of an ELF file for an AVR."""


@dataclass(frozen=True)
class OwnImage:
    """An image, the target of `hil` whose chip it is for, and the sensors it was made for.

    `scales`: input -> what one of 1024 counts means to it, rad/s, m/s^2 or V, by its own board.h; empty: it is for an
    RCX, and gets its readings as messages in these units.
    """

    path: Path
    target: str
    scales: Mapping[str, float]
    sensors: str


def find(image: Path) -> OwnImage:
    """Returns an image in a folder of `firmware`, or in a folder below it, where build.sh puts one.

    Raises:
        InputError: there is no such file, or the folder does not say of what board it is; no simulator flies it.
    """
    if not image.is_file():
        raise InputError("no such file", file=image)
    made = next((one for one in (image.parent, image.resolve().parent.parent) if (one / FIGURES).is_file()), None)
    if made is None:
        raise InputError(f"stands in no folder of `brickpilot firmware`: {FIGURES} is missing beside it", file=image)
    told = json.loads((made / FIGURES).read_text(encoding="utf-8"))
    target = _TARGETS.get((told.get("board"), told.get("flight", {}).get("sensors")))
    if target is None or target.partition(":")[0] != _simulator(image):
        flown = "it flies an Arduino's ELF file and an RCX's brickpilot.h8sim"
        raise InputError(f"is nothing that hil flies of the board {told.get('board')}; {flown}", file=image)
    scales = _scales(made / "include/avr/board.h") if target.startswith("avr") else {}
    return OwnImage(image, target, scales, told["flight"]["sensors"])


def _simulator(image: Path) -> str | None:
    """Returns which targets fly a file, ``avr`` or ``h8sim``, by its machine or its ending; None: none do."""
    with image.open("rb") as file:
        head = file.read(20)
    if head.startswith(b"\x7fELF") and head[18:] == _AVR_MACHINE:
        return "avr"
    return "h8sim" if image.suffix == ".h8sim" and head.startswith(b"S0") else None


def plan(image: OwnImage, model: Path, scenario: str | None, sensors: str | None, seed: int) -> Plan:
    """Returns the plan of a flight of the robot of a model file with its image; `scenario`: None: the scaled mission.

    Raises:
        InputError: a file is bad; sensors that the image was not made for.
    """
    if sensors not in (None, image.sensors):
        raise InputError(f"the image was made for {image.sensors}", field=f"--sensors {sensors}")
    own = robot.load(model)
    return simulate.plan(own, simulate.mission(own, scenario), image.sensors, seed)


def _scales(board: Path) -> dict[str, float]:
    """Returns input -> what one of 1024 counts means, rad/s, m/s^2 or V, by a board.h.

    Raises:
        InputError: it is missing, or has not all scales.
    """
    if not board.is_file():
        raise InputError("is missing: it has the scales of the sensors", file=board)
    text = board.read_text(encoding="utf-8")
    found = {}
    for name in ("GYRO", "SURGE", "SWAY"):
        per_count = re.search(rf"#define BOARD_{name}_PER_COUNT_Q8 (\d+)", text)
        reversed_ = re.search(rf"#define BOARD_{name}_REVERSED (\w+)", text)
        if per_count is None or reversed_ is None:
            raise InputError(f"has no scale of {name}", file=board)
        found[name] = (-1e-3 if reversed_[1] in ("true", "1") else 1e-3) * int(per_count[1]) / 256
    full = re.search(r"#define BOARD_BATTERY_FULL_MV (\d+)", text)
    if full is None:
        raise InputError("has no scale of the battery", file=board)
    return {**found, "BATTERY_INPUT": int(full[1]) * 1e-3 / 1024}
