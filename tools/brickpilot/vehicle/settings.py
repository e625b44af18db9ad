"""The settings of the firmware: names, formats and ranges, from the table `hal/wire/settings.toml`.

The initial value of a setting is the default in its row, or else the value in the packaged robot's file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from brickpilot.constants import ROBOT
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.errors import InputError, did_you_mean
from brickpilot.vehicle.combinations import holding_voltage
from brickpilot.vehicle.fixed_point import QuantisationError, integer

NUMBER_MOST = 63
"""The largest number of a setting: a request has 6 bits for it."""

INT32 = 2**31 - 1
_ROW = ("number", "field", "format", "low", "high", "default", "compensation", "meaning")


@dataclass(frozen=True)
class Format:
    """How the firmware holds a value: raw = value * per_unit, rounded to the nearest integer.

    ``text`` names the format; ``unit`` is the value's SI unit.
    """

    text: str
    unit: str
    per_unit: float


@dataclass(frozen=True)
class Setting:
    """A row of the table; the table's header explains every field.

    Attributes:
        default: the default in `format.unit`; None: the vehicle file has the value.
        compensation: the key in a compensation file; empty: the setting tunes the controller.
    """

    name: str
    number: int
    field: str
    format: Format
    low: int
    high: int
    default: float | None
    compensation: str
    meaning: str

    @property
    def is_switch(self) -> bool:
        """Whether the setting is on or off: a `bool` in C."""
        return (self.low, self.high) == (0, 1)

    @property
    def range(self) -> str:
        return f"{self.low}..{self.high}"

    @property
    def range_in_unit(self) -> str:
        """The range in the SI unit of the format, as "0.001 to 2.05 m/s"."""
        unit = "" if self.format.unit == "1" else f" {self.format.unit}"
        return f"{self.value(self.low):.4g} to {self.value(self.high):.4g}{unit}"

    def check(self, raw: int) -> None:
        """Raises InputError if `raw` is out of the range."""
        if not self.low <= raw <= self.high:
            means = "" if self.format.per_unit == 1 else f", which is {self.range_in_unit}"
            raise InputError(
                f"{raw} is out of range: it takes {self.range} ({self.format.text}){means}", field=self.name
            )

    def raw(self, value: float) -> int:
        """Returns the firmware's integer for `value`, not limited to the range."""
        return round(value * self.format.per_unit)

    def value(self, raw: int) -> float:
        """Returns the value of `raw` in the firmware, SI."""
        return raw / self.format.per_unit


@cache
def settings() -> Mapping[str, Setting]:
    """Returns the packaged table: name -> setting, in the order of their numbers."""
    return load(Path(__file__).parents[1] / "settings.toml")


def named(name: str) -> Setting:
    """Returns the setting of that name.

    Raises:
        InputError: no setting has that name; the message lists similar names.
    """
    if name not in settings():
        like = did_you_mean(name, settings())
        raise InputError(f"is no setting{like or '; `brickpilot settings` lists them'}", field=name)
    return settings()[name]


def load(path: Path) -> dict[str, Setting]:
    """Reads a table of settings.

    Raises:
        InputError: a row lacks a field or contradicts another row; the message has file, line and row.
    """
    toml = TomlFile(path)
    formats = {
        name: _format(toml, ("formats", name), row)
        for name, row in toml.table(("formats",), toml.data["formats"]).items()
    }
    rows = toml.table(("settings",), toml.data["settings"])
    table = {name: _setting(toml, ("settings", name), row, formats) for name, row in rows.items()}
    for place, (name, setting) in enumerate(table.items()):
        if setting.number != place:
            toml.refuse(("settings", name, "number"), f"{setting.number} should be {place}: numbers must have no gap")
    if len(table) > NUMBER_MOST + 1:
        toml.refuse(("settings",), f"{len(table)} settings, but a request has room for the numbers 0..{NUMBER_MOST}")
    return table


def _format(toml: TomlFile, key: Key, row: object) -> Format:
    table = toml.table(key, row)
    toml.known_keys(key, table, ("text", "unit", "per_unit"))
    return Format(
        text=toml.text((*key, "text"), table.get("text")),
        unit=toml.text((*key, "unit"), table.get("unit")),
        per_unit=toml.number((*key, "per_unit"), table.get("per_unit"), 1e-9, 1e9),
    )


def _setting(toml: TomlFile, key: Key, row: object, formats: Mapping[str, Format]) -> Setting:
    table = toml.table(key, row)
    toml.known_keys(key, table, _ROW)

    def whole(name: str, low: int, high: int) -> int:
        return int(toml.number((*key, name), table.get(name), low, high))

    low = whole("low", -32767, INT32)
    high = whole("high", low, INT32)
    if high > 65535 and (low, high) != (1, INT32):
        toml.refuse((*key, "high"), f"a field of 32 bits takes 1..{INT32}")
    if low < 0 and high > 32767:
        toml.refuse((*key, "high"), "a signed field has 16 bits: 32767 is the most")
    default = table.get("default")
    return Setting(
        name=str(key[-1]),
        number=whole("number", 0, NUMBER_MOST),
        field=toml.text((*key, "field"), table.get("field")),
        format=formats[toml.choice((*key, "format"), table.get("format"), formats)],
        low=low,
        high=high,
        default=None if default is None else toml.number((*key, "default"), default, -1e9, 1e9),
        compensation=toml.text((*key, "compensation"), table["compensation"]) if "compensation" in table else "",
        meaning=toml.text((*key, "meaning"), table.get("meaning")),
    )


def read_raw(toml: TomlFile, key: Key, table: Mapping[str, Any], setting: Setting) -> int:
    """Returns the raw integer of a setting in a user's file: the `raw` of its table, or else its converted `value`.

    Raises:
        InputError: another unit, neither `raw` nor `value`, a number outside the range, or two contradicting numbers.
    """
    if table.get("unit", setting.format.unit) != setting.format.unit:
        toml.refuse((*key, "unit"), f"{table['unit']!r} should be {setting.format.unit!r}")
    if "raw" not in table and "value" not in table:
        toml.refuse(key, "needs a value or a raw integer")
    value = toml.number((*key, "value"), table["value"], -1e9, 1e9) if "value" in table else None
    raw = table.get("raw", None if value is None else setting.raw(value))
    if isinstance(raw, bool) or not isinstance(raw, int):
        toml.refuse((*key, "raw"), f"{raw!r} is not a whole number")
    if not setting.low <= raw <= setting.high:
        outside = f"{setting.value(raw):.6g} {setting.format.unit} is outside {setting.range_in_unit}"
        toml.refuse(key, f"{outside}: raw {setting.range}")
    if value is not None and abs(value * setting.format.per_unit - raw) > 0.5:
        toml.refuse((*key, "value"), f"{value:g} {setting.format.unit} does not agree with raw = {raw}")
    return raw


def plain(table: Mapping[str, Any]) -> dict[str, float]:
    """Returns the values of a table of the vehicle file, without units and basis."""
    return {name: float(entry["value"]) for name, entry in table.items() if "value" in entry}


def constants(vehicle: Mapping[str, Any], profile: str) -> dict[str, float]:
    """Returns the controller's constants of a profile, SI: those in the vehicle file, and two computed from it."""
    own = plain(vehicle["controller"][profile])
    own["acceptance"] = plain(vehicle["robot"])["length"] / 2
    own["feedforward"] = own["feedforward_share"] * holding_voltage(plain(vehicle["parameters"]))
    return own


def default(setting: Setting, own: Mapping[str, float], profile: str) -> int:
    """Returns the initial raw integer of a setting; 0 if the setting belongs to a compensation.

    Args:
        own: the result of `constants` for the profile.

    Raises:
        QuantisationError: neither the setting's row nor the vehicle file has a value, or the value is outside the
            range.
    """
    if setting.compensation:
        return 0
    if setting.default is None and setting.name not in own:
        raise QuantisationError(
            f"hal/wire/settings.toml: {setting.name}: has no default, and [controller.{profile}] of "
            f"sim_host/models/rcx.toml has no value of that name"
        )
    value = own[setting.name] if setting.default is None else setting.default
    return integer(value * setting.format.per_unit, setting.low, setting.high, setting.name)


@cache
def defaults(profile: str) -> Mapping[str, int]:
    """Returns name -> raw integer of every setting at the beginning of a session with the packaged firmware."""
    own = constants(ROBOT, profile)
    return {name: default(setting, own, profile) for name, setting in settings().items()}
