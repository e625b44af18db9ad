"""What the control law is fed when it is compared with other arithmetic: steps of a recorded mission, as tables in C.

`tests/peers` has the programs. The firmware's own gets its signals as they are; the peers get SI units, in Q16.16 or as
float. Constants are those of the packaged robot's controller.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import RCX, STEP_S
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import Model, rcx

Array = NDArray[np.float64]

PHASES = (1, 2, 3)
"""BRAKE, TURN and DRIVE, as the firmware's guidance numbers them."""

_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Records:
    """Steps of a flight in SI units: ``x`` to ``battery`` (steps,), ``waypoint`` and ``phase`` as integers.

    ``waypoints`` is (count, 2), m. The firmware's own signals are rounded to its formats, so each value is exactly one
    of these.
    """

    x: Array
    y: Array
    heading: Array
    speed: Array
    accel: Array
    yaw_rate: Array
    battery: Array
    waypoint: NDArray[np.int64]
    phase: NDArray[np.int64]
    waypoints: Array


def record(steps: int) -> Records:
    """Flies the packaged mission and returns `steps` of its steps that drive, spread evenly over it.

    The rate of change of the speed is the difference of two steps: the log has no filtered one.
    """
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0))
    log = flown.log
    drives = np.flatnonzero((log["mode"] == 1) & np.isin(log["phase"], PHASES))
    chosen = drives[np.linspace(0, len(drives) - 1, steps).astype(int)]
    accel = np.diff(log["estimate_speed_m_s"], prepend=0.0) / STEP_S

    def rounded(name: str, unit: float) -> Array:
        return np.asarray(np.round(log[name][chosen] / unit) * unit)

    return Records(
        x=rounded("estimate_x_m", 1e-6),
        y=rounded("estimate_y_m", 1e-6),
        heading=rounded("estimate_heading_rad", _TURN / 65536),
        speed=rounded("estimate_speed_m_s", 1e-3 / 16),
        accel=np.round(accel[chosen], 3),
        yaw_rate=rounded("estimate_yaw_rate_rad_s", 1e-3),
        battery=rounded("battery_v", 1e-3),
        waypoint=log["waypoint"][chosen].astype(np.int64),
        phase=log["phase"][chosen].astype(np.int64),
        waypoints=np.asarray(mission.waypoints, dtype=np.float64),
    )


def write(records: Records, folder: Path) -> None:
    """Writes what tests/peers/build compiles: constants.inc, and a records.inc in each of the folders inputs_FORMAT."""
    _write_constants(records, folder / "constants.inc")
    native = [
        np.round(one).astype(np.int64)
        for one in (
            records.x * 1e6,
            records.y * 1e6,
            (records.heading * 65536 / _TURN) % 65536,
            records.speed * 16e3,
            records.accel * 1e3,
            records.yaw_rate * 1e3,
            records.battery * 1e3,
        )
    ]
    si = (records.x, records.y, records.heading, records.speed, records.accel, records.yaw_rate, records.battery)
    tables: dict[str, tuple[str, Iterable[Iterable[object]]]] = {
        "native": ("native_t", zip(*native, strict=True)),
        "q16": ("record_t", zip(*(np.round(one * 65536).astype(np.int64) for one in si), strict=True)),
        "float": ("record_t", zip(*([f"{value:.9e}f" for value in one] for one in si), strict=True)),
    }
    for name, (kind, rows) in tables.items():
        place = folder / f"inputs_{name}"
        place.mkdir(parents=True, exist_ok=True)
        lines = [
            "    {" + ", ".join(map(str, (*row, waypoint, phase))) + "},"
            for row, waypoint, phase in zip(rows, records.waypoint, records.phase, strict=True)
        ]
        text = "\n".join([f"static const FLASH {kind} RECORDS[] = {{", *lines, "};", ""])
        (place / "records.inc").write_text(text, encoding="utf-8")


def holding_voltage(model: Model) -> float:
    """Returns the volts per m/s that both motors need on level ground: back EMF, and the current against eq. 13, 14."""
    p = model.parameters
    loss = p["viscous_friction"] + p["mass"] * p["gravity"] * p["rolling_friction"] * p["wheel_radius"] ** 2
    return (p["emf_constant"] + p["resistance"] * loss / p["torque_constant"]) / p["wheel_radius"]


def _write_constants(records: Records, path: Path) -> None:
    rows = tomllib.loads(RCX.read_text(encoding="utf-8"))["controller"]
    c = {name: row["value"] for name, row in {**rows, **rows["coupled"]}.items() if "value" in row}
    constants = {
        "PI": math.pi,
        **{f"SPEED_{name.upper()}": c[f"speed_{name}"] for name in ("kp", "kd", "limit")},
        **{f"HEADING_{name.upper()}": c[f"heading_{name}"] for name in ("kp", "kd", "limit")},
        "SPEED_KI_PERIOD": c["speed_ki"] * STEP_S,
        "HEADING_KI_PERIOD": c["heading_ki"] * STEP_S,
        "FEEDFORWARD": c["feedforward_share"] * holding_voltage(rcx()),
        "CRUISE": c["cruise"],
        "CRUISE_SQUARED": c["cruise"] ** 2,
        "CREEP": c["creep"],
        "TWICE_DECEL": 2 * c["decel"],
        "BEARING_HOLD_SQUARED": c["bearing_hold"] ** 2,
        "BATTERY_FLOOR": c["battery_floor"],
    }
    lines = [f"#define {name} ({float(value)!r})" for name, value in constants.items()]
    pairs = ", ".join(f"{{NUM({x!r}), NUM({y!r})}}" for x, y in records.waypoints.tolist())
    whole = ", ".join(f"{{{round(1e3 * x)}, {round(1e3 * y)}}}" for x, y in records.waypoints.tolist())
    lines += [f"#define WAYPOINTS_SI {pairs}", f"#define WAYPOINTS_MM {whole}", ""]
    path.write_text("\n".join(lines), encoding="utf-8")
