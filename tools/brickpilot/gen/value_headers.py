"""The headers with values of plant, controllers, model coefficients, settings and instructions of the H8/300.

- sim_host/models/rcx_gen.h: the plant's presets, from the vehicle file `rcx.toml`.
- tests/numeric/controllers_gen.h: the controller's constants for both profiles, in SI units and not rounded.
- tests/numeric/model_sets_gen.h: sets of the model's coefficients, with the SI values from which they are made.
- firmware/app/settings_gen.h: the firmware's table of settings; the settings' names also go into brickpilot.dbc.
- hal/h8sim/states_gen.h: the memory accesses of each H8/300 instruction, for the simulator.
"""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.text_template import render_text
from brickpilot.vehicle.coefficients import PROFILES, body
from brickpilot.vehicle.fixed_point import QuantisationError, initialiser
from brickpilot.vehicle.settings import INT32, Setting, plain


def plant_presets(vehicle: Mapping[str, Any]) -> str:
    """Returns the text of sim_host/models/rcx_gen.h.

    Args:
        vehicle: the tables `parameters`, `rates` and `sensors.*` of a vehicle file; each entry is `{value, unit,
            basis}`.
    """
    tables = [("RCX", vehicle["parameters"]), ("RCX", vehicle["rates"])]
    tables += [(f"RCX_{sensor.upper()}", table) for sensor, table in vehicle["sensors"].items()]
    return render_text("gen", "rcx_gen.h", tables=tables)


OF_THE_LOOP = ("lost_time", "watchdog_time", "silent_time", "telemetry_every")


def controllers(vehicle: Mapping[str, Any]) -> str:
    """Returns the text of tests/numeric/controllers_gen.h.

    Args:
        vehicle: a vehicle file's tables.
    """
    profiles = {}
    for profile in PROFILES:
        own = plain(vehicle["controller"][profile])
        profiles[profile] = {
            "acceptance": plain(vehicle["robot"])["length"] / 2,
            **{name: value for name, value in own.items() if name not in OF_THE_LOOP},
            "accel_filter_time": plain(vehicle["estimator"])["accel_filter_time"],
        }
    return render_text("gen", "controllers_gen.h", profiles=profiles)


SEED = 2006
PERTURBED_SETS = 6
SPREAD = 0.25
FIXED = ("gravity", "air_density", "battery_voltage")


def value_sets(nominal: Mapping[str, float]) -> list[dict[str, float]]:
    """Returns the set of nominal values, then sets drawn within +-25 % of them; values in `FIXED` stay nominal."""
    draw = random.Random(SEED)
    sets = [dict(nominal)]
    for _ in range(PERTURBED_SETS):
        perturbed = {
            name: value if name in FIXED else float(f"{value * draw.uniform(1 - SPREAD, 1 + SPREAD):.6g}")
            for name, value in nominal.items()
        }
        # Values of eq. 16 and 17, computed from those of eq. 12. If they were drawn as well, full voltage could brake.
        torque, volts = perturbed["torque_constant"], perturbed["battery_voltage"]
        perturbed["stall_torque"] = torque * volts / perturbed["resistance"]
        perturbed["no_load_speed"] = volts / perturbed["emf_constant"]
        sets.append(perturbed)
    return sets


def model_sets(nominal: Mapping[str, float], step: float) -> str:
    """Returns the text of tests/numeric/model_sets_gen.h."""
    sets = [
        {
            "values": list(values.values()),
            **{profile: initialiser(body(profile, values, step), 1) for profile in PROFILES},
        }
        for values in value_sets(nominal)
    ]
    return render_text("gen", "model_sets_gen.h", names=list(nominal), sets=sets, spread=f"{SPREAD:.0%}")


RANGES_MOST = 16
"""Largest number of ranges, because parameters.c has 4 bits for the number of a range."""

_VALUE_TABLE = re.compile(r"^VAL_ 256 parameter .*;$", re.MULTILINE)


def ranges(settings: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """Returns the different ranges, (low, high); ranges without negative values come first.

    Raises:
        QuantisationError: there are more ranges than the firmware's table has bits for.
    """
    pairs = sorted({(setting.low, setting.high) for setting in settings.values()}, key=lambda pair: (pair[0] < 0, pair))
    if len(pairs) > RANGES_MOST:
        raise QuantisationError(f"{len(pairs)} ranges: parameters.c has bits for {RANGES_MOST}")
    return pairs


def settings_table(settings: Mapping[str, Setting]) -> str:
    """Returns the text of firmware/app/settings_gen.h."""
    return render_text("gen", "settings_gen.h", ranges=ranges(settings), settings=list(settings.values()), int32=INT32)


def name_in(dbc: str, settings: Mapping[str, Setting]) -> str:
    """Returns the DBC's text with the names of the settings in the value table of PARAMETER_REQUEST."""
    names = " ".join(f'{setting.number} "{setting.name}"' for setting in settings.values())
    text, count = _VALUE_TABLE.subn(f"VAL_ 256 parameter {names} ;", dbc)
    if count != 1:
        raise ValueError("brickpilot.dbc has no line `VAL_ 256 parameter ... ;`")
    return text


PLACES = ("nothing", "stack", "register", "short", "word", "displaced", "stepped")
"""The places of an instruction's data, as named in the table; nothing: the instruction has no data."""


@dataclass(frozen=True)
class Cost:
    """What an instruction takes: ``code`` words of code, ``words`` and ``data_bytes`` at ``place``, ``own`` states."""

    code: int
    words: int
    data_bytes: int
    own: int
    place: str


def h8_costs(text: str) -> dict[int, Cost]:
    """Returns first byte of an H8/300 instruction -> its cost, from the text of `hal/h8sim/states.toml`.

    An instruction's number of states depends neither on the data nor on whether a branch is taken. The only exception
    is `eepmov`, whose number of states depends on its count, so `eepmov` is not in the table.
    """
    costs: dict[int, Cost] = {}
    for row in tomllib.loads(text)["instruction"]:
        words, data_bytes, own = (row.get(key, 0) for key in ("words", "bytes", "own"))
        cost = Cost(row["code"], words, data_bytes, own, row.get("at", "nothing"))
        for first in row["first"]:
            begin, end = first if isinstance(first, list) else (first, first)
            costs.update(dict.fromkeys(range(begin, end + 1), cost))
    return costs


def h8_states(table: str) -> str:
    """Returns the text of hal/h8sim/states_gen.h; `table`: the text of states.toml."""
    return render_text("gen", "states_gen.h", places=PLACES, costs=h8_costs(table))
