"""The generator's coefficients of random robots fulfil what harness/body.c assumes, in the firmware's integers."""

from __future__ import annotations

import copy
import random
import tomllib
from pathlib import Path
from typing import Any

from brickpilot.vehicle.coefficients import PROFILES
from brickpilot.vehicle.fixed_point import QuantisationError, Scale
from brickpilot.vehicle.settings import plain

ROOT = Path(__file__).resolve().parents[2]
INT32 = 2**31 - 1
SPEED, VOLTAGE, LOAD = 786432000, 2 * 16383, 163840000  # harness/body.c: speed_most, domain_of(), admitted()
BODY_SPEED, SQUARE = 1073479680, 16380**2


def applied(scale: Scale, value: int) -> int:
    """Returns |scale_apply(scale, value)| for a `value` of 0 or more, as firmware/model/scale.c computes it."""
    return (((abs(scale.mantissa) * value >> 14) >> scale.shift) + 1) >> 1


def applied16(scale: Scale, value: int) -> int:
    return (((abs(scale.mantissa) * value << 1) >> scale.shift) + 1) >> 1


def bad_motor(motor: Any) -> str:
    """Returns which sum of the motor's step may exceed its bound: "current ..." or "change ..."; "": neither."""
    row, change = motor["current"], motor["speed"]
    fixed = applied(row["from_speed"], SPEED) + applied16(row["from_voltage"], VOLTAGE)
    share = abs(row["from_current"].factor)
    most = min(int((fixed + 2) / (1 - share)) + 2, INT32 // 2)  # bound that the current should never exceed
    if applied(row["from_current"], most) + fixed > most:
        return f"current {most}"
    total = (
        applied(change["from_current"], most)
        + applied(change["from_speed"], SPEED)
        + applied16(change["from_voltage"], VOLTAGE)
    )
    return "" if total + LOAD + SPEED <= INT32 else f"change {total}"


def drawn(vehicle: dict[str, Any], chance: random.Random) -> dict[str, Any]:
    values = copy.deepcopy(vehicle)
    for name in ("mass", "wheel_radius", "half_track", "resistance", "inductance", "torque_constant", "emf_constant",
                 "yaw_inertia", "wheel_inertia", "viscous_friction", "drag_area"):  # fmt: skip
        if name in values["parameters"]:
            values["parameters"][name]["value"] *= 10 ** chance.uniform(-0.7, 0.7)
    return values


def test_admitted() -> None:
    vehicle = tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text(encoding="utf-8"))
    chance = random.Random(29)
    robots = [vehicle, *(drawn(vehicle, chance) for _ in range(3000))]
    admitted, bad = 0, []
    for number, robot in enumerate(robots):
        for step in (0.003, 0.009):
            try:
                made: Any = PROFILES["coupled"](plain(robot["parameters"]), step)
            except QuantisationError:
                continue
            admitted += 1
            why = [bad_motor(motor) for motor in made["motor"]]
            why += [] if applied(made["drag"], SQUARE) <= LOAD else ["drag"]
            why += [] if applied(made["surge_from_wheel"], SPEED) <= BODY_SPEED else ["surge"]
            bad += [(number, step, one) for one in why if one]
    assert admitted > 300
    assert not bad, f"{len(bad)} of {admitted}: {bad[:5]}"
