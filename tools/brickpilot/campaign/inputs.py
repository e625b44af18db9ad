"""The inputs of a campaign, which may differ between runs: each has a name, unit and distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign import variables
from brickpilot.campaign.variables import ON, Distribution, Range, Value
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.vehicle.scenario import Fault, parse_faults
from brickpilot.vehicle.settings import settings

CHANCE = "chance"
_FAULT_NUMBERS = ("from_s", "to_s", "rate")


@dataclass(frozen=True)
class Input:
    """One input.

    Attributes:
        name: KIND.NAME, as "parameter.mass"; or "scenario" or "sensors".
        labels: the texts for the values 0, 1, ... of the distribution; empty: the input is a number.
        chance: for a switch, the probability that its effect or fault is on; None: the input is no switch.
    """

    name: str
    unit: str
    distribution: Distribution
    labels: tuple[str, ...] = ()
    chance: float | None = None

    @property
    def varies(self) -> bool:
        """Whether runs can differ in this input."""
        return self.distribution.varies

    @property
    def listed(self) -> bool:
        """Whether the input is an axis of a grid."""
        return self.distribution.listed

    @property
    def levels(self) -> int:
        """The number of values of an input that is drawn from a list."""
        return len(self.distribution.values)

    def values(self, shares: NDArray[np.float64]) -> list[Value]:
        """Returns the quantiles at these shares (n,), as a flight needs them: gains in the firmware's resolution."""
        found = self.distribution.at(shares).tolist()
        if self.labels:
            return [self.labels[int(one)] for one in found]
        if self.chance is not None:
            return [bool(one) for one in found]
        kind, _, name = self.name.partition(".")
        if kind == "gain":
            return [settings()[name].value(settings()[name].raw(one)) for one in found]
        return list(found)


def labelled(name: str, labels: Sequence[str]) -> Input | None:
    """Returns the input that chooses among texts; None: there is only one text."""
    if len(labels) < 2:
        return None
    chosen = Distribution("choice", values=tuple(float(k) for k in range(len(labels))), listed=True)
    return Input(name, "", chosen, tuple(labels))


def _switch(toml: TomlFile, key: Key, name: str, value: object) -> list[Input]:
    """Returns the switch of an effect or a fault; fixed if its chance is 0 or 1."""
    chance = toml.number(key, value, 0.0, 1.0)
    if chance in (0.0, 1.0):
        return [Input(f"{name}.{ON}", "", Distribution("fixed", values=(chance,)), chance=chance)]
    law = Distribution("choice", values=(0.0, 1.0), weights=(1.0 - chance, chance))
    return [Input(f"{name}.{ON}", "", law, chance=chance)]


def parse(toml: TomlFile, sensors: Sequence[str]) -> list[Input]:
    """Reads `[vary]`.

    Raises:
        InputError: naming file, line and key.
    """
    table = toml.table(("vary",), toml.data.get("vary", {}))
    toml.known_keys(("vary",), table, (*variables.ranges(), "effect"))
    found: list[Input] = []
    for kind, entries in table.items():
        entries = toml.table(("vary", kind), entries)
        if kind == "effect":
            found += _effects(toml, entries)
            continue
        toml.known_keys(("vary", kind), entries, variables.ranges()[kind])
        if kind == "sensor" and "ideal" in sensors:
            toml.refuse(("vary", kind), "ideal sensors have no noise; name others in campaign.sensors")
        for name, entry in entries.items():
            found.append(_number(toml, ("vary", kind, name), f"{kind}.{name}", entry, variables.ranges()[kind][name]))
    return found


def _number(toml: TomlFile, key: Key, name: str, entry: object, physical: Range) -> Input:
    return Input(name, physical.unit, variables.parse_distribution(toml, key, entry, physical))


def _effects(toml: TomlFile, entries: Mapping[str, Any]) -> list[Input]:
    toml.known_keys(("vary", "effect"), entries, variables.effects())
    found: list[Input] = []
    for effect, entry in entries.items():
        key = ("vary", "effect", effect)
        given, known = toml.table(key, entry), variables.effects()[effect]
        toml.known_keys(key, given, (*known, CHANCE))
        found += _switch(toml, (*key, CHANCE), f"effect.{effect}", given.get(CHANCE, 1.0))
        found += [
            _number(toml, (*key, name), f"effect.{effect}.{name}", one, known[name])
            for name, one in given.items()
            if name != CHANCE
        ]
    return found


def faults(toml: TomlFile, duration: float) -> tuple[dict[str, Fault], list[Input]]:
    """Reads `[[faults]]`: name -> the fixed part of a fault, and the inputs of the faults.

    A fault's name is its kind, with a number if the kind occurred before: drop, drop_2.

    Raises:
        InputError: naming file, line and key.
    """
    given = toml.data.get("faults", [])
    if not isinstance(given, list):
        toml.refuse(("faults",), "needs to be a list of tables, [[faults]]")
    fixed: list[dict[str, Any]] = []
    found: list[Input] = []
    names: list[str] = []
    for index, entry in enumerate(given):
        key, table = ("faults", index), dict(toml.table(("faults", index), entry))
        kind = toml.choice((*key, "kind"), table.get("kind"), variables.LINK_KINDS)
        before = sum(name.partition("_#")[0] == kind for name in names)
        names.append(f"{kind}_#{before + 1}")
        name = f"fault.{_name(names[-1])}"
        if CHANCE in table:
            found += _switch(toml, (*key, CHANCE), name, table.pop(CHANCE))
        for number in _FAULT_NUMBERS:
            if isinstance(table.get(number), dict | list):
                physical = Range(0.0, 1.0, "") if number == "rate" else Range(0.0, duration, "s")
                found.append(_number(toml, (*key, number), f"{name}.{number}", table[number], physical))
                law = found[-1].distribution
                table[number] = _latest(law) if number == "from_s" else _earliest(law)
        fixed.append(table)
    made = parse_faults(toml, fixed, duration)
    return {_name(name): fault for name, fault in zip(names, made, strict=True)}, found


def _name(counted: str) -> str:
    kind, _, number = counted.partition("_#")
    return kind if number == "1" else f"{kind}_{number}"


def _latest(law: Distribution) -> float:
    """Returns the largest value of a distribution: a fault has to end after its latest start."""
    return max(law.values) if law.values else law.high


def _earliest(law: Distribution) -> float:
    return min(law.values) if law.values else law.low
