"""A gain set: settings that tune the controller, as the raw integers that the firmware holds.

`brickpilot tune` writes a gain set. `run` and `hil` write the gain set to the firmware as settings; `firmware` compiles
it into an image. Each entry has value, unit and raw integer; `hal/wire/settings.toml` has the names and ranges.

    name = "bench-7"

    [gains]
    heading_kp = { value = 10.0, unit = "V/rad", raw = 982 }
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from brickpilot.data.toml_file import TomlFile
from brickpilot.data.whole_files import write_whole
from brickpilot.errors import InputError
from brickpilot.vehicle.settings import Setting, read_raw, settings

AT_MOST = (("creep", "cruise"), ("align", "pivot"))
"""Pairs of settings: the first of a pair may not be above the second."""


def tunable() -> dict[str, Setting]:
    """Returns the settings that tune the controller, by name: all settings that do not describe the robot."""
    return {name: setting for name, setting in settings().items() if not setting.compensation}


@dataclass(frozen=True)
class Gains:
    """A gain set.

    Attributes:
        name: the name of the robot or file for which the gains were tuned.
        raw: setting -> integer as the firmware holds it; a setting that is left out keeps the firmware's value.
    """

    name: str
    raw: Mapping[str, int]

    def value(self, name: str) -> float:
        """Returns the value of a gain in the firmware, SI."""
        return settings()[name].value(self.raw[name])

    def save(self, path: Path | str) -> None:
        """Writes the file as a whole (`write_whole`)."""
        write_whole(path, render(self))


def render(gains: Gains) -> str:
    """Returns the file's text, which `load` reads back to an equal gain set."""
    document = tomlkit.document()
    document.add(tomlkit.comment("Gains of the controller. The firmware holds `raw`; `value` is the same in `unit`."))
    document["name"] = gains.name
    table = tomlkit.table()
    for name, raw in gains.raw.items():
        setting = settings()[name]
        entry = tomlkit.inline_table()
        entry.update({"value": setting.value(raw), "unit": setting.format.unit, "raw": raw})
        table[name] = entry
        table[name].comment(setting.meaning)
    document["gains"] = table
    return tomlkit.dumps(document)


def load(path: Path | str) -> Gains:
    """Reads a gain set.

    Raises:
        InputError: not TOML, an unknown name, a wrong unit, a number outside its format, a value that contradicts its
            raw number, or two gains that contradict each other. The message names file, line and field.
    """
    toml = TomlFile(Path(path))
    toml.known_keys((), toml.data, ("name", "gains"), ("name", "gains"))
    given = toml.table(("gains",), toml.data["gains"])
    if not given:
        toml.refuse(("gains",), "has no gain")
    raw = {name: _raw(toml, name, entry) for name, entry in given.items()}
    for less, more in AT_MOST:
        if {less, more} <= raw.keys() and settings()[less].value(raw[less]) > settings()[more].value(raw[more]):
            toml.refuse(("gains", less), f"may not be above {more}")
    return Gains(toml.file_name(("name",), toml.data["name"]), raw)


def check_pairs(chosen: Mapping[str, int], held: Callable[[str], int]) -> None:
    """Checks the pairs of `AT_MOST` before settings are written; a setting that is not chosen keeps its value.

    A host may lower the second setting of a pair alone. If it is then below the first, the firmware uses it for both.

    Args:
        chosen: setting to be written -> raw integer.
        held: returns the raw integer of a setting that is not chosen.

    Raises:
        InputError: the first of a pair of `AT_MOST` is above the second.
    """
    for less, more in AT_MOST:
        if less not in chosen:
            continue
        high = chosen[more] if more in chosen else held(more)
        if chosen[less] > high:
            takes = f"it takes {settings()[less].low}..{more} ({settings()[less].format.text})"
            raise InputError(f"{chosen[less]} is above {more}, which is {high}: {takes}", field=less)


def _raw(toml: TomlFile, name: str, entry: object) -> int:
    """Returns the raw integer of an entry; refuses a setting that does not tune the controller."""
    key = ("gains", name)
    if name in settings() and settings()[name].compensation:
        toml.refuse(key, "describes the robot, so it belongs in a compensation.toml")
    setting = tunable()[toml.choice(key, name, tunable())]
    table = toml.table(key, entry)
    toml.known_keys(key, table, ("value", "unit", "raw"))
    return read_raw(toml, key, table, setting)
