"""The inputs of a campaign, which may differ between runs: their names, units, ranges and distributions.

A distribution is used as a quantile function: it maps a share, 0..1, to a value. A design draws the shares, so every
design can use every distribution. The distributions are those of `scipy.stats`. An unbounded distribution is truncated
at the physical limits.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.compiled import interface
from brickpilot.constants import RCX
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.vehicle import gains
from brickpilot.vehicle.flight import Plan
from brickpilot.vehicle.scenario import AVR_KINDS, FAULT_KINDS, Fault, farthest, parse_faults
from brickpilot.vehicle.settings import plain, settings

Array = NDArray[np.float64]

NUMBERS = {
    "uniform": ("low", "high"),
    "loguniform": ("low", "high"),
    "normal": ("mean", "sd"),
    "lognormal": ("median", "sd_of_log"),
}
"""Distribution -> the numbers that it needs. `normal` and `lognormal` may have `low` and `high`, too."""

DISTRIBUTIONS = (*NUMBERS, "choice", "fixed")

_LEAST_KEPT = 0.01  # least probability of a value within the limits; with less, the file is probably wrong


@dataclass(frozen=True)
class Range:
    """The physical range of a value, from low to high, in `unit`; `whole`: the value must be a whole number."""

    low: float
    high: float
    unit: str
    whole: bool = False


@dataclass(frozen=True)
class Distribution:
    """A distribution of numbers.

    Attributes:
        kind: one of DISTRIBUTIONS; `fixed` and `choice` use `values`, which are equally likely or have `weights`.
        first, second: the numbers that the distribution's kind needs, in the order of NUMBERS.
        low, high: the limits at which the distribution is truncated.
        listed: whether the file gives the values as a plain list; such a list is an axis of a grid.
    """

    kind: str
    first: float = 0.0
    second: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    values: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    whole: bool = False
    listed: bool = False

    @property
    def varies(self) -> bool:
        """Whether the value can differ between runs."""
        return self.kind != "fixed"

    def at(self, shares: Array) -> Array:
        """Returns the quantiles (n,) at these shares (n,)."""
        if self.kind == "fixed":
            return np.full(len(shares), self.values[0])
        if self.kind == "choice":
            ends = np.cumsum(self.weights or np.full(len(self.values), 1.0 / len(self.values)))
            index = np.searchsorted(ends / ends[-1], shares, side="right")
            return np.array(self.values)[np.minimum(index, len(self.values) - 1)]
        law = self.law()
        below, above = law.cdf(self.low), law.cdf(self.high)
        quantiles = np.clip(law.ppf(below + shares * (above - below)), self.low, self.high)
        return np.asarray(np.round(quantiles) if self.whole else quantiles, dtype=np.float64)

    def law(self) -> Any:
        """Returns the distribution of `scipy.stats` before it is truncated."""
        from scipy import stats

        first, second = self.first, self.second
        if self.kind == "uniform":
            return stats.uniform(first, second - first)
        if self.kind == "loguniform":
            return stats.loguniform(first, second)
        return stats.norm(first, second) if self.kind == "normal" else stats.lognorm(second, scale=first)


def parse_distribution(toml: TomlFile, key: Key, entry: object, physical: Range) -> Distribution:
    """Reads a distribution: a number, a list of numbers, or a table with the key `distribution`.

    Raises:
        InputError: for example, a range exceeds the physical limits. The message names file, line and key.
    """
    if isinstance(entry, list):
        return Distribution("choice", values=_values(toml, key, entry, physical), listed=True)
    if not isinstance(entry, dict):
        return Distribution("fixed", values=(_number(toml, key, entry, physical),))
    if "distribution" not in entry:
        toml.refuse((*key, "distribution"), f"is missing: {', '.join(DISTRIBUTIONS)}; or give a number, or a list")
    kind = toml.choice((*key, "distribution"), entry["distribution"], DISTRIBUTIONS)
    if kind == "fixed":
        toml.known_keys(key, entry, ("distribution", "value"))
        return Distribution("fixed", values=(_number(toml, (*key, "value"), entry.get("value"), physical),))
    if kind == "choice":
        toml.known_keys(key, entry, ("distribution", "values", "weights"))
        values = _values(toml, (*key, "values"), entry.get("values"), physical)
        return Distribution("choice", values=values, weights=_weights(toml, (*key, "weights"), entry, len(values)))
    return _continuous(toml, key, kind, entry, physical)


def _number(toml: TomlFile, key: Key, value: object, physical: Range) -> float:
    if value is None:
        toml.refuse(key, "is missing")
    number = toml.number(key, value, physical.low, physical.high, physical.unit)
    if physical.whole and number != round(number):
        toml.refuse(key, f"{value} is not a whole number")
    return number


def _values(toml: TomlFile, key: Key, values: object, physical: Range) -> tuple[float, ...]:
    if not isinstance(values, list) or not values:
        toml.refuse(key, "needs a list of one value or more")
    numbers = tuple(_number(toml, key, value, physical) for value in values)
    if len(set(numbers)) < len(numbers):
        toml.refuse(key, "has a value twice")
    return numbers


def _weights(toml: TomlFile, key: Key, entry: Mapping[str, Any], count: int) -> tuple[float, ...]:
    if "weights" not in entry:
        return ()
    if not isinstance(entry["weights"], list) or len(entry["weights"]) != count:
        toml.refuse(key, f"needs {count} numbers, one for each value")
    return tuple(toml.number(key, weight, 1e-6, 1e6) for weight in entry["weights"])


def _continuous(toml: TomlFile, key: Key, kind: str, entry: dict[str, Any], physical: Range) -> Distribution:
    toml.known_keys(key, entry, {"distribution", *NUMBERS[kind], "low", "high"})
    for name in NUMBERS[kind]:
        if name not in entry:
            toml.refuse((*key, name), f"is missing: {kind} needs {' and '.join(NUMBERS[kind])}")
    low = _number(toml, (*key, "low"), entry.get("low", physical.low), physical)
    high = _number(toml, (*key, "high"), entry.get("high", physical.high), physical)
    if low >= high:
        toml.refuse((*key, "high" if "high" in entry else "low"), f"low = {low:g} is not below high = {high:g}")
    if kind == "loguniform" and low <= 0:
        toml.refuse((*key, "low"), "loguniform needs a low above 0")
    if kind in ("uniform", "loguniform"):
        first, second = low, high
    else:
        centre, width = NUMBERS[kind]
        first = toml.number((*key, centre), entry[centre], 1e-12 if kind == "lognormal" else -1e9, 1e9, physical.unit)
        second = toml.number((*key, width), entry[width], 1e-12, 1e9)
    distribution = Distribution(kind, first, second, low, high, whole=physical.whole)
    law = distribution.law()
    if law.cdf(high) - law.cdf(low) < _LEAST_KEPT:
        toml.refuse(key, f"less than {_LEAST_KEPT:.0%} of it lies within {low:g}..{high:g} {physical.unit}".rstrip())
    return distribution


Value = float | bool | str
Drawn = Mapping[str, Value]
"""Input -> its value in one run. A number is in the input's unit; `None` does not occur."""

ON = "on"
"""The last word of a switch's name. A switch is an input that switches an effect or a fault on."""

_AXES = {"accel": "m/s^2", "gyro": "rad/s"}
_OF_AXES = {"noise_sd": (0.0, 1e3), "range": (0.1, 1e3), "bias": (-100.0, 100.0)}
_OTHER_DEVICES = {
    "bits": Range(0, 24, "", whole=True),
    "counts_per_turn": Range(1.0, 1e5, ""),
    "battery_resolution": Range(1e-6, 10.0, "V"),
}


def _sensor_ranges() -> dict[str, Range]:
    """Returns, for each field of `bp_devices`, its physical range."""
    possible = {}
    for name, _ in interface()[0].typeof("bp_devices").fields:
        axis, _, rest = name.partition("_")
        kind = next((kind for kind in _OF_AXES if rest.startswith(kind)), "")
        possible[name] = Range(*_OF_AXES[kind], _AXES[axis]) if kind else _OTHER_DEVICES[name]
    return possible


@cache
def devices() -> Mapping[str, float]:
    """Returns, for each field of `bp_devices`, its value for the packaged robot's sensors, in SI."""
    sensors = TomlFile(RCX).data["sensors"]
    return {
        **plain(sensors["imu"]),
        **plain(sensors["encoder"]),
        "battery_resolution": plain(sensors["battery"])["resolution"],
    }


@cache
def ranges() -> Mapping[str, Mapping[str, Range]]:
    """Returns kind -> name -> range, for all inputs of `[vary]`. The kinds are parameter, sensor, gain and start."""
    far = farthest()
    tuned = {
        name: Range(gain.value(gain.low), gain.value(gain.high), "" if gain.format.unit == "1" else gain.format.unit)
        for name, gain in gains.tunable().items()
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


CHANCE = "chance"
_FAULT_NUMBERS = ("from_s", "to_s", "rate")


@dataclass(frozen=True)
class Input:
    """One input.

    Attributes:
        name: KIND.NAME, such as "parameter.mass"; or "scenario" or "sensors".
        labels: the texts for the values 0, 1, ... of the distribution; empty: the input is a number.
        chance: for a switch, the probability that its effect or fault is on; None: the input is no switch.
    """

    name: str
    unit: str
    distribution: Distribution
    labels: tuple[str, ...] = ()
    chance: float | None = None

    @property
    def levels(self) -> int:
        """The number of values of an input that is drawn from a list."""
        return len(self.distribution.values)

    def values(self, shares: NDArray[np.float64]) -> list[Value]:
        """Returns the quantiles at `shares` (n,), as values of a flight: a gain is rounded as in the firmware."""
        quantiles: list[float] = self.distribution.at(shares).tolist()
        if self.labels:
            return [self.labels[int(quantile)] for quantile in quantiles]
        if self.chance is not None:
            return [bool(quantile) for quantile in quantiles]
        kind, _, name = self.name.partition(".")
        if kind == "gain":
            return [settings()[name].value(settings()[name].raw(quantile)) for quantile in quantiles]
        return list(quantiles)


def labelled(name: str, labels: Sequence[str]) -> Input | None:
    """Returns an input whose value is one of the texts `labels`; None: there is only one text."""
    if len(labels) < 2:
        return None
    numbers = Distribution("choice", values=tuple(float(number) for number in range(len(labels))), listed=True)
    return Input(name, "", numbers, tuple(labels))


def _switch(toml: TomlFile, key: Key, name: str, value: object) -> Input:
    """Returns the switch of an effect or a fault; fixed if its chance is 0 or 1."""
    chance = toml.number(key, value, 0.0, 1.0)
    distribution = Distribution("choice", values=(0.0, 1.0), weights=(1.0 - chance, chance))
    if chance in (0.0, 1.0):
        distribution = Distribution("fixed", values=(chance,))
    return Input(f"{name}.{ON}", "", distribution, chance=chance)


def parse(toml: TomlFile, sensors: Sequence[str]) -> list[Input]:
    """Reads `[vary]`.

    Raises:
        InputError: the message names file, line and key.
    """
    table = toml.table(("vary",), toml.data.get("vary", {}))
    toml.known_keys(("vary",), table, (*ranges(), "effect"))
    inputs: list[Input] = []
    for kind, entries in table.items():
        entries = toml.table(("vary", kind), entries)
        if kind == "effect":
            inputs += _effects(toml, entries)
            continue
        toml.known_keys(("vary", kind), entries, ranges()[kind])
        if kind == "sensor" and "ideal" in sensors:
            toml.refuse(("vary", kind), "ideal sensors have no noise; name others in campaign.sensors")
        for name, entry in entries.items():
            inputs.append(_input(toml, ("vary", kind, name), f"{kind}.{name}", entry, ranges()[kind][name]))
    return inputs


def _input(toml: TomlFile, key: Key, name: str, entry: object, physical: Range) -> Input:
    return Input(name, physical.unit, parse_distribution(toml, key, entry, physical))


def _effects(toml: TomlFile, entries: Mapping[str, Any]) -> list[Input]:
    toml.known_keys(("vary", "effect"), entries, effects())
    inputs: list[Input] = []
    for effect, entry in entries.items():
        key = ("vary", "effect", effect)
        given, known = toml.table(key, entry), effects()[effect]
        toml.known_keys(key, given, (*known, CHANCE))
        inputs.append(_switch(toml, (*key, CHANCE), f"effect.{effect}", given.get(CHANCE, 1.0)))
        inputs += [
            _input(toml, (*key, name), f"effect.{effect}.{name}", value, known[name])
            for name, value in given.items()
            if name != CHANCE
        ]
    return inputs


def faults(toml: TomlFile, duration: float) -> tuple[dict[str, Fault], list[Input]]:
    """Reads `[[faults]]`. Returns name -> the fault with its fixed values, and the inputs that belong to faults.

    A fault's name is its kind, with a number if the kind occurred before: drop, drop_2.

    Raises:
        InputError: the message names file, line and key.
    """
    given = toml.data.get("faults", [])
    if not isinstance(given, list):
        toml.refuse(("faults",), "needs to be a list of tables, [[faults]]")
    fixed: list[dict[str, Any]] = []
    inputs: list[Input] = []
    names: list[str] = []
    for index, entry in enumerate(given):
        key, table = ("faults", index), dict(toml.table(("faults", index), entry))
        kind = toml.choice((*key, "kind"), table.get("kind"), [kind for kind in FAULT_KINDS if kind not in AVR_KINDS])
        before = sum(earlier["kind"] == kind for earlier in fixed)
        names.append(f"{kind}_{before + 1}" if before else kind)
        name = f"fault.{names[-1]}"
        if CHANCE in table:
            inputs.append(_switch(toml, (*key, CHANCE), name, table.pop(CHANCE)))
        for number in _FAULT_NUMBERS:
            if isinstance(table.get(number), dict | list):
                physical = Range(0.0, 1.0, "") if number == "rate" else Range(0.0, duration, "s")
                inputs.append(_input(toml, (*key, number), f"{name}.{number}", table[number], physical))
                drawn = inputs[-1].distribution
                low, high = (min(drawn.values), max(drawn.values)) if drawn.values else (drawn.low, drawn.high)
                table[number] = high if number == "from_s" else low  # the latest start must precede the earliest end
        fixed.append(table)
    return dict(zip(names, parse_faults(toml, fixed, duration), strict=True)), inputs


def tuned(known: gains.Gains | None, drawn: Drawn) -> gains.Gains | None:
    """Returns the gain set of a run: the `known` set with the drawn gains; None: the firmware's own set."""
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
    """Returns the plan with the values of a run.

    Args:
        plan: the plan with the scenario, the sensors and the gains that were drawn for the run.
        drawn: the drawn inputs, of which only those named KIND.NAME are used.
        faults: name -> the values of a fault that the file gives as constants.
    """
    of = _by_kind(drawn)
    numbers = {kind: {name: float(value) for name, value in of.get(kind, {}).items()} for kind in ranges()}
    x, y, heading = plan.scenario.start
    start = numbers["start"]
    scenario = dataclasses.replace(
        plan.scenario,
        start=(start.get("x_m", x), start.get("y_m", y), math.radians(start.get("heading_deg", math.degrees(heading)))),
        faults=(*plan.scenario.faults, *_faults_of_run(of.get("fault", {}), faults)),
    )
    model = dataclasses.replace(
        plan.model,
        parameters={**plan.model.parameters, **numbers["parameter"]},
        effects=_effects_of_run(plan.model.effects, of.get("effect", {})),
    )
    return dataclasses.replace(
        plan,
        scenario=scenario,
        model=model,
        devices={**(plan.devices or devices()), **numbers["sensor"]} if numbers["sensor"] else plan.devices,
    )


def _effects_of_run(
    effects: Mapping[str, Mapping[str, float]], drawn: Mapping[str, Value]
) -> dict[str, Mapping[str, float]]:
    """Returns the effects of a run: the model's effects that are on, with the drawn parameters."""
    active: dict[str, Mapping[str, float]] = dict(effects)
    for name, value in drawn.items():
        effect, _, parameter = name.partition(".")
        if drawn.get(f"{effect}.{ON}", True) is False:
            active.pop(effect, None)
        elif parameter == ON:
            active.setdefault(effect, {})
        else:
            active[effect] = {**active.get(effect, {}), parameter: float(value)}
    return active


def _faults_of_run(drawn: Mapping[str, Value], faults: Mapping[str, Fault]) -> list[Fault]:
    """Returns the faults of a run, with the drawn numbers."""
    active = []
    for name, fault in faults.items():
        if drawn.get(f"{name}.{ON}", True) is False:
            continue
        own = {key: float(drawn[f"{name}.{key}"]) for key in _FAULT_NUMBERS if f"{name}.{key}" in drawn}
        active.append(dataclasses.replace(fault, **own))  # type: ignore[arg-type]
    return active
