"""Draws robots with values that the data allow. A file of `calibrate` or `discover` beside model.toml has the fit.

- Fitted parameters are drawn jointly about their estimates, with the fit's covariance. The covariance is that of a
  linearised fit, so along a direction that the data do not determine, the sd is limited to `VAGUE_SD`.
- Unmeasured values have the relative sd that is usual for their kind: `shares` for a nominal parameter, `EFFECT_SHARE`
  for an effect's size, `BATTERY_SHARE` for the battery. The sd of a sensor's bias is its stated size.
- If a verdict is ambiguous, all explanations that the data cannot separate from the best one are equally likely.

A robot does not depend on the number of drawn robots: its random numbers depend only on seed, stream and place.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model, with_values
from brickpilot.vehicle.spread import Spread
from brickpilot.vehicle.spread import from_json as spread_of

Array = NDArray[np.float64]

VAGUE_SD = 0.2
"""Largest sd of a fitted coordinate: of `log(value)`, or of `value / change` if `change` moves signals by their rms."""

EFFECT_SHARE = 0.1
"""Relative sd of an effect's size that has no interval; discovery uses the same sd for the effects of a given model."""

BATTERY_SHARE = 0.05
"""Relative sd of the battery's voltage: from full to half empty, six cells lose about a tenth."""

SOURCES = ("calibrate.json", "verdict.json")
"""The result files beside model.toml; the first one that exists is read."""

_TRIES = 1000  # largest number of draws until a robot is within the physical ranges
_SAME = 1e-6  # relative tolerance between a value in model.toml and its estimate in the result file


@dataclass(frozen=True)
class Explanation:
    """A model that the data allow; robots are drawn about the values of this model."""

    name: str
    model: Model


@dataclass(frozen=True)
class Allowed:
    """The robots that the data allow, because their values agree with the data.

    Attributes:
        explanations: the explanations of the data, the best one first; only an ambiguous verdict has several.
        spread: the spread of the fitted parameters; None: no parameter was fitted.
        shares: nominal parameter -> relative sd, used if this parameter was not fitted.
        devices: the robot's sensors, as in `flight.Plan.devices`; None: those of the packaged robot.
        source: the source of the spread, in words.
    """

    explanations: tuple[Explanation, ...]
    spread: Spread | None
    shares: Mapping[str, float]
    devices: Mapping[str, float] | None = None
    source: str = "no fit: what is usual for each kind of value"

    @property
    def open(self) -> tuple[str, ...]:
        """Names ("mass" or "effect.parameter") of the values in which robots differ; an explanation may lack some."""
        best = self.model.parameters
        rivals = [rival.model.parameters for rival in self.explanations[1:]]
        names = dict.fromkeys(name for name in best if any(rival.get(name) != best[name] for rival in rivals))
        fitted = () if self.spread is None else self.spread.names
        for explanation in self.explanations:
            own = values(explanation.model)
            names |= dict.fromkeys(name for name in (*fitted, *_usual(self, explanation.model)) if own.get(name))
        return tuple(names)

    def identity(self) -> str:
        """Returns a text that differs if the drawn robots differ."""
        spread = None if self.spread is None else self.spread.to_json()
        devices = None if self.devices is None else dict(self.devices)
        return json.dumps([spread, dict(self.shares), devices, repr(self.explanations)])

    @property
    def model(self) -> Model:
        """The best explanation."""
        return self.explanations[0].model


@dataclass(frozen=True)
class Robot:
    """A drawn robot.

    Attributes:
        place: the robot's place in its stream of draws.
        explanation: name of the explanation from which the robot was drawn.
        seed: seed of the noise of the robot's sensors.
    """

    place: int
    model: Model
    devices: Mapping[str, float] | None
    seed: int
    explanation: str = ""


def read(model: Model, path: Path, shares: Mapping[str, float]) -> Allowed:
    """Returns the robots that the files beside model.toml allow.

    Args:
        model: the model in `path`, a model.toml.
        shares: see `Allowed`.

    Raises:
        InputError: a file beside model.toml is no result of calibrate or discover, or belongs to another model.
    """
    file = next((path.with_name(name) for name in SOURCES if path.with_name(name).is_file()), None)
    if file is None:
        return Allowed((Explanation(model.name, model),), None, shares)
    try:
        given = json.loads(file.read_text(encoding="utf-8"))
        spread = spread_of(given["spread"]) if given.get("spread") is not None else None
        explanations = (Explanation(model.name, model), *_rivals(model, given))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"is no result of calibrate or discover: {error}", file=file, field="spread") from error
    if spread is not None:
        for name, value in zip(spread.names, spread.values, strict=True):
            if "@" in name:  # a value of one run does not belong to the robot
                continue
            own = values(model).get(name)
            if own is None or not math.isclose(own, value, rel_tol=_SAME, abs_tol=1e-12):
                raise InputError(f"{value:g} is not the value of model.toml beside it", file=file, field=name)
    return Allowed(explanations, spread, shares, source=file.name)


def _rivals(model: Model, given: Mapping[str, Any]) -> list[Explanation]:
    """Returns the rivals that an ambiguous verdict lists beside the best explanation; empty for any other verdict."""
    if given.get("verdict") != "ambiguous":
        return []
    explanations = []
    for rival in (rival for effect in given["effects"] for rival in effect["equivalents"]):
        if rival.get("nominal"):
            parameters = {**model.parameters, **_numbers(rival["nominal"])}
            effects = {name: _numbers(table) for name, table in rival["effects"].items()}
            other = dataclasses.replace(model, parameters=parameters, effects=effects, basis={})
            explanations.append(Explanation(str(rival["name"]), other))
    return explanations


def _numbers(table: Mapping[str, Any]) -> dict[str, float]:
    """Returns a table's values as numbers; ValueError, TypeError or OverflowError: a value is not valid."""
    return {name: float(value) for name, value in table.items()}


def draw(allowed: Allowed, seed: int, stream: int, places: Sequence[int]) -> list[Robot]:
    """Returns the robots at `places` of a stream; robots of two streams are independent.

    Raises:
        InputError: no drawn robot has all its values within the physical ranges.
    """
    return [_draw(allowed, np.random.SeedSequence(seed, spawn_key=(stream, place)), place) for place in places]


def _draw(allowed: Allowed, seeds: np.random.SeedSequence, place: int) -> Robot:
    random = np.random.default_rng(seeds)
    noise = int(random.integers(2**32))
    chosen = allowed.explanations[int(random.integers(len(allowed.explanations)))]
    devices = None if allowed.devices is None else _powered_on(allowed.devices, random)
    for _ in range(_TRIES):
        drawn = _unmeasured(allowed, chosen.model, random) | _fitted(allowed, chosen.model, random)
        if all(_possible(name, value) for name, value in drawn.items()):
            return Robot(
                place, dataclasses.replace(with_values(chosen.model, drawn), basis={}), devices, noise, chosen.name
            )
    raise InputError(f"the data allow no robot within the physical ranges, in {_TRIES} draws", field=chosen.name)


def _powered_on(devices: Mapping[str, float], random: np.random.Generator) -> dict[str, float]:
    """Returns the sensors with newly drawn biases, because a bias changes with each power-on."""
    biases = [name for name in devices if "_bias" in name]
    return {**devices, **{name: float(random.normal(0.0, abs(devices[name]))) for name in biases}}


def _fitted(allowed: Allowed, model: Model, random: np.random.Generator) -> dict[str, float]:
    """Returns fitted parameters, drawn about the values of `model`, which is an explanation's model."""
    if allowed.spread is None:
        return {}
    own = values(model)
    moved = allowed.spread.at(_root(allowed.spread) @ random.normal(size=len(allowed.spread.names)))
    drawn = {}
    for name, at, unit in zip(allowed.spread.names, allowed.spread.values, allowed.spread.units, strict=True):
        if name in own:
            drawn[name] = own[name] * (moved[name] / at) if unit is None else own[name] + (moved[name] - at)
    return drawn


def _root(spread: Spread) -> Array:
    """Returns a square root of the covariance, with an sd of at most `VAGUE_SD` in each direction."""
    values, axes = np.linalg.eigh(spread.covariance)
    return np.asarray(axes * np.sqrt(np.clip(values, 0.0, VAGUE_SD**2)))


def _unmeasured(allowed: Allowed, model: Model, random: np.random.Generator) -> dict[str, float]:
    """Returns values drawn with their usual relative sd; the caller replaces those of fitted parameters."""
    shares, own = _usual(allowed, model), values(model)
    draws = random.normal(size=len(shares))
    return {name: own[name] * math.exp(share * x) for (name, share), x in zip(shares.items(), draws, strict=True)}


def _usual(allowed: Allowed, model: Model) -> dict[str, float]:
    """Returns name -> usual relative sd, of the values that have such an sd."""
    shares = {name: share for name, share in allowed.shares.items() if name in model.parameters}
    shares |= {"battery_voltage": BATTERY_SHARE}
    for name, table in model.effects.items():
        sizes = [info.name for info in catalogue.effect(name).parameters if info.role == "size"]
        shares |= {f"{name}.{size}": EFFECT_SHARE for size in sizes if table.get(size)}
    return shares


def values(model: Model) -> dict[str, float]:
    """Returns all values of a model; the keys are "mass" or "effect.parameter"."""
    presets = model.nominal
    return presets | {f"{effect}.{name}": v for effect, table in model.effects.items() for name, v in table.items()}


@cache
def infos() -> Mapping[str, catalogue.ParameterInfo]:
    """Returns name ("mass" or "effect.parameter") -> the parameter's entry in the catalogue, with range and unit."""
    table = {info.name: info for info in catalogue.parameters()}
    for effect in catalogue.effects():
        table |= {f"{effect.name}.{info.name}": info for info in effect.parameters}
    return table


def _possible(name: str, value: float) -> bool:
    """Returns whether a value is in its physical range, or is 0, which means that the vehicle lacks the part."""
    return value == 0 or infos()[name].minimum <= value <= infos()[name].maximum
