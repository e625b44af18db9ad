"""The basis of composed terms, read from the plant's table of effects.

The composed effect of the plant's table has one coefficient c for each term, whose meaning reads
``X += -c * [fabs(u)] * u``. The expression in brackets is C, and Python as well: it is parsed, not listed here again.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo

EFFECT = next(effect.name for effect in catalogue.effects() if effect.composed)
"""The name of the effect that holds the terms."""

PLACES = {
    "drive": "drive voltage",
    "wheel": "wheel torque",
    "surge": "surge force",
    "yaw": "yaw moment",
    "floor": "slope of the floor",
    "encoder": "rotation sensors' output",
    "gyro": "gyro output",
    "accel_surge": "surge accelerometer output",
    "accel_sway": "sway accelerometer output",
}
"""Place where a term may act -> words for it."""

OF_A_MOTOR = frozenset({"drive", "wheel", "surge"})
"""The places where a term acts on a motor too, if its sign does not differ between left and right."""

_MECHANISMS = {"drive": "drive", "wheel": "bearing", "surge": "body", "yaw": "body", "floor": "floor"}

_NAME = re.compile(rf"({'|'.join(sorted(PLACES, key=len, reverse=True))})_(gain|add|dry|loss|push)_(diff_)?(\w+)")
_MEANING = re.compile(r"(\w+) \+= (.*)\[(.*)\](.*)")

# Symbol of an expression -> the parameters that shape it.
_SHAPED_BY = {"patch": ("patch_x", "patch_half_width"), "sprung": ("frequency", "damping"), "t": ("clock",)}


@dataclass(frozen=True)
class Basis:
    """One term that a composed law may contain.

    Attributes:
        info: the row of its coefficient in the table.
        place: key of `PLACES`.
        kind: how it acts there: gain, add, dry, loss or push.
        sided: its sign differs between left and right.
        expression: C, in the symbols that ``sim_host/effects`` lists.
        target, sign, factor: parts of its meaning, ``target += sign [expression] factor``. The sign holds c.
        tuned: names of the other parameters of the effect that shape it.
    """

    info: ParameterInfo
    place: str
    kind: str
    sided: bool
    expression: str
    target: str
    sign: str
    factor: str
    tuned: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.info.name

    @property
    def symbols(self) -> frozenset[str]:
        """The symbols of its expression and of its factors."""
        return symbols_in(f"{self.sign}({self.expression}){self.factor}") - {"c"}

    @property
    def mechanism(self) -> str:
        """The kind of cause: that of its place, but a torque that goes with the current is the motor's."""
        if self.place == "wheel" and "i" in self.symbols:
            return "motor"
        return _MECHANISMS.get(self.place, "sensor")


@dataclass(frozen=True)
class Term:
    """A term with its coefficient, SI."""

    basis: Basis
    coefficient: float


@cache
def basis() -> tuple[Basis, ...]:
    """Returns every term, in the order of the table."""
    found = []
    for info in parameters():
        name, meaning = _NAME.fullmatch(info.name), _MEANING.fullmatch(info.meaning)
        if name is None or meaning is None:
            continue
        expression = meaning[3]
        symbols = symbols_in(expression)
        tuned = [p.name for p in parameters() if p.name in symbols]
        tuned += [tuner for symbol, tuners in _SHAPED_BY.items() if symbol in symbols for tuner in tuners]
        found.append(
            Basis(
                info,
                name[1],
                name[2],
                name[3] is not None,
                expression,
                meaning[1],
                meaning[2],
                meaning[4],
                tuple(dict.fromkeys(tuned)),
            )
        )
    return tuple(found)


@cache
def parameters() -> tuple[ParameterInfo, ...]:
    """Returns the rows of the effect: coefficients first, then the parameters that shape their terms."""
    return catalogue.effect(EFFECT).parameters


def terms_of(values: Mapping[str, float]) -> tuple[Term, ...]:
    """Returns the terms whose coefficients are not 0 in `values`, in the order of the table."""
    return tuple(Term(one, values[one.name]) for one in basis() if values.get(one.name, 0.0) != 0.0)


def settings_of(chosen: Iterable[Basis], values: Mapping[str, float]) -> dict[str, float]:
    """Returns the parameters that shape the chosen terms, from `values` or else from the presets."""
    needed = {name for one in chosen for name in one.tuned}
    return {p.name: values.get(p.name, p.preset) for p in parameters() if p.name in needed}


def symbols_in(expression: str) -> frozenset[str]:
    """Returns the variables of a C expression."""
    tree = ast.parse(expression.replace("[", "(").replace("]", ")").strip(), mode="eval")
    called = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name)) - called
