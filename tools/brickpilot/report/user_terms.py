"""Converts results to the frame, signs and units of the user's data set; texts about a motor mention no wheels."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any, TypeVar

from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.dataset import FRAME_WORDS, Dataset, OwnUnit, frame_text, own_unit
from brickpilot.data.nominal import turns_with_frame
from brickpilot.discover.finding import Effect, Finding, Parameter, Rank, Visible
from brickpilot.report.quantities import in_words

Told = TypeVar("Told")

_NOT_WORDS = frozenset({"run", "runs"})
"""Keys whose values are names that the user gave."""

_OF_A_MOTOR = (
    (r"\bboth wheels or of a motor\b", "the motor"),
    (r"\bwheels or motor\b", "the motor"),
    (r"\bwheel (inertia|radius)\b", r"\1"),
    (r"\b(the |each |both )?wheels?'s\b", r"the {shaft}'s"),
    (r"\bwheels turn\b", r"the {shaft} turns"),
    (r"\b(the |each |both )wheels?\b", r"the {shaft}"),
    (r"\bwheels\b", r"the {shaft}"),
    (r"\bwheel\b", r"{shaft}"),
    (r"\b(the |The )?(robot|vehicle)\b", r"\1motor"),
    (r'\bDrive (")', r"Run \1"),
    (r"\bexplanations drive alike\b", "explanations run alike"),
    (r"\bDrive more\b", "Run more"),
    (r"\bdrive as well\b", "run as well"),
)


def told(dataset: Dataset, value: Told) -> Told:
    """Returns text, or a container of texts, in words that suit the data set's vehicle: a motor has no wheels.

    Names that the user gave and finished HTML stay as they are.
    """
    shaft = "carriage" if "force_per_volt" in dataset.nominal else "shaft"
    return value if dataset.vehicle != "motor" else _of_a_motor(value, shaft)


def _of_a_motor(value: Any, shaft: str) -> Any:
    if isinstance(value, Markup):
        return value
    if isinstance(value, str):
        for pattern, plain in _OF_A_MOTOR:
            value = re.sub(pattern, plain.format(shaft=shaft), value)
        return value
    if isinstance(value, Mapping):
        return {key: one if key in _NOT_WORDS else _of_a_motor(one, shaft) for key, one in value.items()}
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return type(value)(_of_a_motor(one, shaft) for one in value)
    return value


def frames(dataset: Dataset) -> str:
    """Returns a sentence on the frame and units of a page's values; empty for a motor, which has no frame."""
    if dataset.vehicle == "motor":
        return ""
    own = f"Signals, and the values of effects, have the frame and sign of the data set, {frame_text(dataset)}."
    if dataset.frame == "FRD":
        return f"{own} The files model.toml and verdict.json have the same frame, in SI."
    return f"{own} Equations, model.toml and verdict.json have the paper's frame, FRD: {FRAME_WORDS['FRD']}; in SI."


def shown_finding(finding: Finding) -> Finding:
    """Returns a finding whose effects, ranking and smallest visible sizes have the data set's sign and unit.

    The finding is only for texts and tables. Values of the ranking stay in SI and get only the data set's sign.
    """
    data = finding.dataset

    def of(name: str, values: Mapping[str, Parameter]) -> dict[str, Parameter]:
        return {key: _parameter(data, *_parts(name, key), one) for key, one in values.items()}

    def effect(one: Effect) -> Effect:
        rivals = tuple(
            dataclasses.replace(rival, parameters=of(rival.name, rival.parameters)) for rival in one.equivalents
        )
        return dataclasses.replace(one, parameters=of(one.name, one.parameters), equivalents=rivals)

    def rank(one: Rank) -> Rank:
        values = {
            key: own_parameter(data, *_parts("", key), unit="").value(value) for key, value in one.parameters.items()
        }
        return dataclasses.replace(one, parameters=values)

    def visible(name: str, one: Visible) -> Visible:
        own = own_parameter(data, name, one.parameter, one.unit)
        return dataclasses.replace(one, size=own.size(one.size), unit=own.unit)

    return dataclasses.replace(
        finding,
        effects=tuple(effect(one) for one in finding.effects),
        ranking=tuple(rank(one) for one in finding.ranking),
        power={name: visible(name, one) for name, one in finding.power.items()},
    )


def own_parameter(dataset: Dataset, effect: str, parameter: str, unit: str) -> OwnUnit:
    """Returns the unit and sign in which a data set would state an effect's parameter. `unit`: the SI unit."""
    sign = -1.0 if dataset.frame == "FLU" and turns_with_frame(effect, parameter) else 1.0
    gyro = own_unit(dataset, "yaw_rate") if dataset.vehicle != "motor" else OwnUnit("rad/s")
    if unit == "rad/s" and gyro.unit != "rad/s" and turns_with_frame(effect, parameter):
        return OwnUnit(gyro.unit, gyro.per_si, sign)
    return OwnUnit(unit, 1.0, sign)


def clauses(dataset: Dataset, effect: str, parameters: Mapping[str, Parameter]) -> list[str]:
    """Returns clauses on the meaning of an effect's values, each with size and interval in the data set's unit.

    For example, "the right motor is 12 % weaker than the left (12 to 13 %)". The list is empty if the table has no
    clause for the values.
    """
    over_mean = {info.name for one in catalogue.effects_of((effect,)) for info in one.parameters if info.over_mean}
    found = []
    for name, one in parameters.items():
        clause = catalogue.says(effect, name, one.value) if one.value != 0.0 and catalogue.effects_of((effect,)) else ""
        if not clause:
            continue
        own, sign = own_parameter(dataset, effect, name, one.unit), math.copysign(1.0, one.value)

        def size(value: float, own: OwnUnit = own, sign: float = sign, name: str = name) -> float:
            value *= sign
            return 2 * value / (2 + value) if name in over_mean else own.size(value)

        ends = one.ci95 and (min(map(size, one.ci95)), max(map(size, one.ci95)))
        text, interval = in_words(size(one.value), own.unit, ends or None)
        found.append(clause.format(text) + interval)
    return found


def _parts(name: str, key: str) -> tuple[str, str]:
    """Splits a key "effect.parameter" into effect and parameter. A key without a dot is a parameter of `name`."""
    effect, _, parameter = key.rpartition(".")
    return effect or name, parameter


def _parameter(dataset: Dataset, effect: str, name: str, one: Parameter) -> Parameter:
    own = own_parameter(dataset, effect, name, one.unit)
    if own.sign > 0 and own.per_si == 1.0:
        return one
    identified = one.identified
    if identified is not None and own.sign < 0:
        low, high = identified.ci95
        identified = dataclasses.replace(identified, value=-identified.value, ci95=(-high, -low))
    ends = None if one.ci95 is None else (min(map(own.value, one.ci95)), max(map(own.value, one.ci95)))
    return Parameter(own.value(one.value), own.unit, ends, identified)
