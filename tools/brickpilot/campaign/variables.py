"""The inputs that a campaign can vary: names, units and physical ranges, and how a value gets into a flight's plan."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import cache

from brickpilot import catalogue
from brickpilot.campaign.distributions import Range
from brickpilot.compiled import interface
from brickpilot.constants import RCX
from brickpilot.data.toml_file import TomlFile
from brickpilot.vehicle import gains, setting_defaults
from brickpilot.vehicle.faults import AVR_KINDS, KINDS, Fault
from brickpilot.vehicle.flight import Plan
from brickpilot.vehicle.settings import settings

Value = float | bool | str
Drawn = Mapping[str, Value]
"""Input -> its value in one run. A number is in the input's unit; `None` never stands here."""

ON = "on"
"""The last word of the input that says whether a run has an effect or a fault."""

LINK_KINDS = tuple(kind for kind in KINDS if kind not in AVR_KINDS)
"""The faults that a campaign can have."""

_AXES = {"accel": "m/s^2", "gyro": "rad/s"}
_OF_AXES = {"noise_sd": (0.0, 1e3), "range": (0.1, 1e3), "bias": (-100.0, 100.0)}
_OTHER_DEVICES = {
    "bits": Range(0, 24, "", whole=True),
    "counts_per_turn": Range(1.0, 1e5, ""),
    "battery_resolution": Range(1e-6, 10.0, "V"),
}


def _sensor_ranges() -> dict[str, Range]:
    """Returns the fields of `bp_devices`, each with the range of its kind."""
    found = {}
    for name, _ in interface()[0].typeof("bp_devices").fields:
        axis, _, rest = name.partition("_")
        kind = next((kind for kind in _OF_AXES if rest.startswith(kind)), "")
        found[name] = Range(*_OF_AXES[kind], _AXES[axis]) if kind else _OTHER_DEVICES[name]
    return found


@cache
def devices() -> Mapping[str, float]:
    """Returns field of `bp_devices` -> value of the packaged robot's sensors, SI."""
    sensors = TomlFile(RCX).data["sensors"]
    return {
        **setting_defaults.plain(sensors["imu"]),
        **setting_defaults.plain(sensors["encoder"]),
        "battery_resolution": setting_defaults.plain(sensors["battery"])["resolution"],
    }


@cache
def ranges() -> Mapping[str, Mapping[str, Range]]:
    """Returns kind -> name -> range of all inputs of `[vary]`: parameter, sensor, gain and start."""
    far = float(interface()[1].BP_MAX_COORDINATE_M)
    tuned = {
        name: Range(one.value(one.low), one.value(one.high), "" if one.format.unit == "1" else one.format.unit)
        for name, one in gains.tunable().items()
    }
    return {
        "parameter": {info.name: Range(info.minimum, info.maximum, info.unit) for info in catalogue.parameters()},
        "sensor": _sensor_ranges(),
        "gain": tuned,
        "start": {
            "x_m": Range(-far, far, "m"),
            "y_m": Range(-far, far, "m"),
            "heading_deg": Range(-360.0, 360.0, "deg"),
        },
    }


@cache
def effects() -> Mapping[str, Mapping[str, Range]]:
    """Returns effect -> parameter -> range."""
    return {
        effect.name: {info.name: Range(info.minimum, info.maximum, info.unit) for info in effect.parameters}
        for effect in catalogue.effects()
    }


def tuned(known: gains.Gains | None, drawn: Drawn) -> gains.Gains | None:
    """Returns the gain set of a run: the known one with the drawn gains; None: the firmware's own."""
    raw = {name: settings()[name].raw(float(value)) for name, value in _by_kind(drawn).get("gain", {}).items()}
    if not raw:
        return known
    return gains.Gains("campaign", raw if known is None else {**known.raw, **raw})


def _by_kind(drawn: Drawn) -> dict[str, dict[str, Value]]:
    of: dict[str, dict[str, Value]] = {}
    for name, value in drawn.items():
        kind, _, rest = name.partition(".")
        of.setdefault(kind, {})[rest] = value
    return of


def applied(plan: Plan, drawn: Drawn, faults: Mapping[str, Fault]) -> Plan:
    """Returns the plan with the values of a run in it.

    Args:
        plan: of the scenario, the sensors and the gains that were drawn for the run.
        drawn: the inputs that are named KIND.NAME; other names are ignored.
        faults: name -> the part of a fault that the file fixes.
    """
    of = _by_kind(drawn)
    numbers = {kind: {name: float(value) for name, value in of.get(kind, {}).items()} for kind in ranges()}
    x, y, heading = plan.scenario.start
    start = numbers["start"]
    scenario = dataclasses.replace(
        plan.scenario,
        start=(start.get("x_m", x), start.get("y_m", y), math.radians(start.get("heading_deg", math.degrees(heading)))),
        faults=(*plan.scenario.faults, *_faults(of.get("fault", {}), faults)),
    )
    model = dataclasses.replace(
        plan.model,
        parameters={**plan.model.parameters, **numbers["parameter"]},
        effects=_effects(plan.model.effects, of.get("effect", {})),
    )
    return dataclasses.replace(
        plan,
        scenario=scenario,
        model=model,
        devices={**(plan.devices or devices()), **numbers["sensor"]} if numbers["sensor"] else plan.devices,
    )


def _effects(effects: Mapping[str, Mapping[str, float]], drawn: Mapping[str, Value]) -> dict[str, Mapping[str, float]]:
    """Returns the effects of a run: the model's own that are on, with the drawn parameters."""
    found: dict[str, Mapping[str, float]] = dict(effects)
    for name, value in drawn.items():
        effect, _, parameter = name.partition(".")
        if drawn.get(f"{effect}.{ON}", True) is False:
            found.pop(effect, None)
        elif parameter == ON:
            found.setdefault(effect, {})
        else:
            found[effect] = {**found.get(effect, {}), parameter: float(value)}
    return found


def _faults(drawn: Mapping[str, Value], faults: Mapping[str, Fault]) -> list[Fault]:
    """Returns the faults of a run, with the drawn numbers."""
    found = []
    for name, fault in faults.items():
        if drawn.get(f"{name}.{ON}", True) is False:
            continue
        own = {key: float(drawn[f"{name}.{key}"]) for key in ("from_s", "to_s", "rate") if f"{name}.{key}" in drawn}
        found.append(dataclasses.replace(fault, **own))  # type: ignore[arg-type]
    return found
