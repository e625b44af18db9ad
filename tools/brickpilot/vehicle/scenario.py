"""A scenario: the task that `brickpilot run` and `hil` fly.

A mission gives the autopilot waypoints; a manoeuvre drives the motors by a schedule and leaves the controller out. The
packaged scenarios are in `sim_host/run/scenarios`.

    name       = "square"
    title      = "Round the table"    # optional, like all keys below except those that the kind needs
    kind       = "mission"            # or "manoeuvre"
    duration_s = 60                   # up to an hour
    start      = { x_m = 0, y_m = 0, heading_deg = 0 }
    profile    = "coupled"            # profile, sensors and seed are used if the command line does not give them
    sensors    = "imu"
    seed       = 0
    waypoints_m = [[0.5, 0], [0.5, 0.5]]    # a mission needs 1 to 32 within 30 m
    cruise_m_s  = 0.3                       # or a speed for each profile; default: the firmware's
    start_at_s  = 1                         # rest before the start; default 1 if a gyro's bias is estimated, else 0
    faults      = [{ kind = "drop", from_s = 5, to_s = 6, rate = 0.1 }]    # of the link; see hal/README.md
    # segments  = [{ from_s = 1, left_V = 5, right_V = "float" }]    of a manoeuvre
    # stop_at_m = 1.0                       of a manoeuvre: path length after which both motors are shorted

    sets_in_at_s = 20                 # [parameters] and [effects] act from then on; default 0: all the time
    [parameters]                      # of the plant alone, like [effects.NAME]; the controller does not know them
    mass = 0.9
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import tomlkit

from brickpilot import catalogue
from brickpilot.compiled import interface
from brickpilot.constants import STEP_S
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.vehicle.model import read_effects, read_values

PROFILES = ("coupled", "paper")
SENSORS = ("ideal", "imu", "imu+encoders")
LONGEST_S = 3600.0

_KEYS = {
    "name", "title", "kind", "duration_s", "start", "start_at_s", "waypoints_m", "cruise_m_s", "segments", "stop_at_m",
    "profile", "sensors", "seed", "parameters", "effects", "faults",
    "sets_in_at_s",
}  # fmt: skip
_ONLY = {"mission": {"waypoints_m", "cruise_m_s", "start_at_s", "faults"}, "manoeuvre": {"segments", "stop_at_m"}}


@dataclass(frozen=True)
class Segment:
    """The motors' voltages from ``from_s`` on (V, -20..20; NaN: the motor floats)."""

    from_s: float
    left: float
    right: float


@dataclass(frozen=True)
class Scenario:
    """One flight. Lengths in m, angles in rad, the paper's frame (x forward, y right, clockwise positive).

    Attributes:
        kind: "mission" or "manoeuvre".
        duration: the duration, s.
        start: x, y and heading at the start.
        start_at: time at rest before a mission begins, s; None: 1 s if the firmware has to learn a gyro bias, else 0.
        cruise: profile -> the cruise speed, m/s.
        stop_at: path length, m, after which a manoeuvre short-circuits both motors.
        parameters, effects: values in which the plant differs from the controller's model.
        sets_in_at: the time from which these values act, s; before it the plant is that of the model.
        faults: the faults to inject while a brick flies the scenario over a link.
        packaged: whether the scenario comes with the package.
    """

    name: str
    title: str
    kind: str
    duration: float
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start_at: float | None = None
    waypoints: tuple[tuple[float, float], ...] = ()
    cruise: Mapping[str, float] = field(default_factory=dict)
    segments: tuple[Segment, ...] = ()
    stop_at: float | None = None
    profile: str | None = None
    sensors: str | None = None
    seed: int | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    sets_in_at: float = 0.0
    faults: tuple[Fault, ...] = ()
    packaged: bool = False


def packaged() -> dict[str, Path]:
    """Returns name -> file of the scenarios that come with the package."""
    folder = Path(str(resources.files("brickpilot"))) / "scenarios"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find(name_or_file: str) -> Path:
    """Returns the file of a packaged scenario, or the user's own file.

    Raises:
        InputError: neither exists.
    """
    known = packaged()
    if name_or_file in known:
        return known[name_or_file]
    path = Path(name_or_file)
    if path.is_file():
        return path
    raise InputError(f"no such file, and no scenario of that name; known: {', '.join(known)}", file=name_or_file)


def load(path: Path) -> Scenario:
    """Reads and checks a scenario file.

    Raises:
        InputError: the scenario is not valid; the message names file, line and key.
    """
    toml = TomlFile(path)
    data = toml.data
    toml.known_keys((), data, _KEYS, ("name", "kind", "duration_s"))
    kind = toml.choice(("kind",), data["kind"], ("mission", "manoeuvre"))
    other = "manoeuvre" if kind == "mission" else "mission"
    for key in sorted(_ONLY[other] & data.keys()):
        toml.refuse((key,), f"belongs to a {other}, not to a {kind}")
    duration = toml.number(("duration_s",), data["duration_s"], STEP_S, LONGEST_S, "s")
    seed = data.get("seed")
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63):
        toml.refuse(("seed",), f"{seed!r} is not a whole number from 0 to 2^63 - 1")
    return Scenario(
        name=toml.file_name(("name",), data["name"]),
        title=toml.text(("title",), data.get("title", data["name"])),
        kind=kind,
        duration=duration,
        start=_start(toml, data.get("start", {})),
        start_at=toml.number(("start_at_s",), data["start_at_s"], 0.0, duration, "s") if "start_at_s" in data else None,
        waypoints=_waypoints(toml, data) if kind == "mission" else (),
        cruise=_cruise(toml, data.get("cruise_m_s", {})),
        segments=_segments(toml, data, duration) if kind == "manoeuvre" else (),
        stop_at=toml.number(("stop_at_m",), data["stop_at_m"], 0.001, 100.0, "m") if "stop_at_m" in data else None,
        profile=toml.choice(("profile",), data["profile"], PROFILES) if "profile" in data else None,
        sensors=toml.choice(("sensors",), data["sensors"], SENSORS) if "sensors" in data else None,
        seed=seed,
        parameters=read_values(toml, ("parameters",), data.get("parameters", {}), catalogue.parameters(), {}),
        effects=read_effects(toml, {}),
        sets_in_at=toml.number(("sets_in_at_s",), data.get("sets_in_at_s", 0.0), 0.0, duration, "s"),
        faults=parse_faults(toml, data["faults"], duration) if "faults" in data else (),
        packaged=path in packaged().values(),
    )


def _list(toml: TomlFile, key: str, data: Mapping[str, Any], most: int) -> list[Any]:
    value = data.get(key)
    if not isinstance(value, list) or not 1 <= len(value) <= most:
        toml.refuse((key,), f"needs a list of 1 to {most} entries")
    return value


def farthest() -> float:
    """Returns the largest coordinate of a waypoint that the firmware takes, m."""
    return float(interface()[1].BP_MAX_COORDINATE_M)


def _start(toml: TomlFile, value: object) -> tuple[float, float, float]:
    table = toml.table(("start",), value)
    toml.known_keys(("start",), table, {"x_m", "y_m", "heading_deg"})
    far = farthest()
    x, y = (toml.number(("start", key), table.get(key, 0), -far, far, "m") for key in ("x_m", "y_m"))
    heading = toml.number(("start", "heading_deg"), table.get("heading_deg", 0), -360.0, 360.0, "deg")
    return x, y, math.radians(heading)


def _waypoints(toml: TomlFile, data: Mapping[str, Any]) -> tuple[tuple[float, float], ...]:
    points = _list(toml, "waypoints_m", data, interface()[1].BP_MAX_WAYPOINTS)
    for index, point in enumerate(points):
        if not isinstance(point, list) or len(point) != 2:
            toml.refuse(("waypoints_m", index), f"{point!r} is not a pair [x, y]")
    far = farthest()
    waypoints = tuple(
        (toml.number(("waypoints_m", i), x, -far, far, "m"), toml.number(("waypoints_m", i), y, -far, far, "m"))
        for i, (x, y) in enumerate(points)
    )
    millimetres = [(round(1000 * x), round(1000 * y)) for x, y in waypoints]  # the firmware's unit
    for index, (before, point) in enumerate(itertools.pairwise(millimetres), 1):
        if point == before:
            toml.refuse(("waypoints_m", index), "is the same as the waypoint before it, within a millimetre")
    return waypoints


def _cruise(toml: TomlFile, value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        value = dict.fromkeys(PROFILES, value)
    toml.known_keys(("cruise_m_s",), value, PROFILES)
    return {profile: toml.number(("cruise_m_s", profile), speed, 0.05, 1.5, "m/s") for profile, speed in value.items()}


def _segments(toml: TomlFile, data: Mapping[str, Any], duration: float) -> tuple[Segment, ...]:
    segments: list[Segment] = []
    for index, entry in enumerate(_list(toml, "segments", data, 1000)):
        key = ("segments", index)
        table = toml.table(key, entry)
        toml.known_keys(key, table, ("from_s", "left_V", "right_V"), ("from_s", "left_V", "right_V"))
        start = toml.number((*key, "from_s"), table["from_s"], 0.0, duration, "s")
        if segments and start <= segments[-1].from_s:
            toml.refuse((*key, "from_s"), f"{start:g} s does not come after the segment before")
        left, right = (
            math.nan if table[name] == "float" else toml.number((*key, name), table[name], -20.0, 20.0, "V")
            for name in ("left_V", "right_V")
        )
        segments.append(Segment(start, left, right))
    return tuple(segments)


def render_mission(mission: Scenario) -> str:
    """Returns the text of a mission's file, which `load` reads back, without `packaged` and the faults of a link."""
    document = tomlkit.document()
    document.update({"name": mission.name, "title": mission.title, "kind": "mission", "duration_s": mission.duration})
    x, y, heading = mission.start
    document["start"] = {"x_m": x, "y_m": y, "heading_deg": math.degrees(heading)}
    optional: dict[str, object] = {
        "start_at_s": mission.start_at, "profile": mission.profile, "sensors": mission.sensors, "seed": mission.seed,
        "cruise_m_s": dict(mission.cruise) or None,
    }  # fmt: skip
    document.update({name: value for name, value in optional.items() if value is not None})
    document["waypoints_m"] = [list(point) for point in mission.waypoints]
    if mission.sets_in_at:
        document["sets_in_at_s"] = mission.sets_in_at
    if mission.parameters:
        document["parameters"] = dict(mission.parameters)
    if mission.effects:
        document["effects"] = {name: dict(table) for name, table in mission.effects.items()}
    return tomlkit.dumps(document)


MESSAGE_KINDS = ("drop", "delay", "duplicate", "reorder", "corrupt", "truncate", "flood", "disconnect")
SENSOR_KINDS = ("stuck_sensor", "missing_sensor")
END_KINDS = ("brown_out", "controller_restart", "plant_restart")
AVR_KINDS = ("main_held", "interrupt_stuck", "converter_stuck", "overrun", "encoder_noise")
"""Faults in an AVR and at its pins: only `hil --target avr` has them."""

FAULT_KINDS = (*MESSAGE_KINDS, *SENSOR_KINDS, *END_KINDS, *AVR_KINDS)
RATED_KINDS = (*MESSAGE_KINDS, "overrun", "encoder_noise")
FAULT_SENSORS = ("imu", "rotation", "battery", "reference")
FAULT_DIRECTIONS = ("both", "to_brick", "from_brick")


@dataclass(frozen=True)
class Fault:
    """One fault, from ``from_s`` until ``to_s``.

    Attributes:
        kind: one of FAULT_KINDS.
        from_s, to_s: times of the flight, s; a restart happens at ``from_s``.
        rate: 0..1: share of the messages or bytes that are disturbed; for noise pulses, share of their highest rate.
        direction: the direction of the disturbed messages, one of FAULT_DIRECTIONS.
        sensor: for SENSOR_KINDS, one of FAULT_SENSORS.
    """

    kind: str
    from_s: float
    to_s: float
    rate: float = 1.0
    direction: str = "both"
    sensor: str = ""

    def acts(self, step: int) -> bool:
        """Whether the fault acts at control step `step`."""
        return self.from_s - STEP_S / 2 <= step * STEP_S < self.to_s - STEP_S / 2

    def begins(self, step: int) -> bool:
        """Whether `step` is the fault's first step."""
        return self.acts(step) and not self.acts(step - 1)

    def ends(self, step: int) -> bool:
        """Whether `step` is the first step after the fault."""
        return self.acts(step - 1) and not self.acts(step)


def parse_faults(toml: TomlFile, value: object, duration: float) -> tuple[Fault, ...]:
    """Reads the [[faults]] of a scenario.

    Raises:
        InputError: a fault is not valid; the message names file, line and key.
    """
    if not isinstance(value, list):
        toml.refuse(("faults",), "needs to be a list of tables, [[faults]]")
    return tuple(_fault(toml, ("faults", index), entry, duration) for index, entry in enumerate(value))


def _fault(toml: TomlFile, key: tuple[str, int], entry: object, duration: float) -> Fault:
    table: Mapping[str, Any] = toml.table(key, entry)
    toml.known_keys(key, table, {"kind", "from_s", "to_s", "rate", "direction", "sensor"}, ("kind", "from_s"))
    kind = toml.choice((*key, "kind"), table["kind"], FAULT_KINDS)
    begin = toml.number((*key, "from_s"), table["from_s"], 0.0, duration, "s")
    end = toml.number((*key, "to_s"), table.get("to_s", duration), begin, duration, "s")
    if kind in SENSOR_KINDS and "sensor" not in table:
        toml.refuse((*key, "sensor"), f"is missing: {', '.join(FAULT_SENSORS)}")
    for name, kinds in (("sensor", SENSOR_KINDS), ("rate", RATED_KINDS), ("direction", MESSAGE_KINDS)):
        if name in table and kind not in kinds:
            toml.refuse((*key, name), f"cannot be used with {kind}")
    return Fault(
        kind,
        begin,
        end,
        toml.number((*key, "rate"), table.get("rate", 1.0), 0.0, 1.0),
        toml.choice((*key, "direction"), table.get("direction", "both"), FAULT_DIRECTIONS),
        toml.choice((*key, "sensor"), table["sensor"], FAULT_SENSORS) if "sensor" in table else "",
    )
