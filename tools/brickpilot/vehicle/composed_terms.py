"""The terms of a model's composed effect, read from the plant's table, and their equations as text.

In the table, the composed effect has a coefficient c for each term. The meaning of a coefficient reads, for example,
``X += -c * [fabs(u)] * u``. The expression in brackets is valid C and Python. This module parses it, so that no
second list of terms is needed.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

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
"""The place where a term may act -> its description."""

OF_A_MOTOR = frozenset({"drive", "wheel", "surge"})
"""The places where a term may also act on a model of one motor, if the term has the same sign on both sides."""

_MECHANISMS = {"drive": "drive", "wheel": "bearing", "surge": "body", "yaw": "body", "floor": "floor"}

_NAME = re.compile(rf"({'|'.join(sorted(PLACES, key=len, reverse=True))})_(gain|add|dry|loss|push)_(diff_)?(\w+)")
_MEANING = re.compile(r"(\w+) \+= (.*)\[(.*)\](.*)")

# Symbol in an expression -> the parameters on which the value of the symbol depends.
_SHAPED_BY = {"patch": ("patch_x", "patch_half_width"), "sprung": ("frequency", "damping"), "t": ("clock",)}


@dataclass(frozen=True)
class Basis:
    """One term that a composed law may contain.

    Attributes:
        info: the row of the term's coefficient in the table.
        place: key of `PLACES`.
        kind: how the term acts at its place: gain, add, dry, loss or push.
        sided: whether the term's sign differs between left and right.
        target, sign, expression, factor: parts of the coefficient's meaning, ``target += sign [expression] factor``, in
            the symbols that ``sim_host/effects`` lists. ``sign`` contains c.
    """

    info: ParameterInfo
    place: str
    kind: str
    sided: bool
    target: str
    sign: str
    expression: str
    factor: str

    @property
    def name(self) -> str:
        return self.info.name

    @cached_property
    def tuned(self) -> tuple[str, ...]:
        """The names of the other parameters of the effect that shape this term."""
        symbols = _symbols_in(self.expression)
        named = [info.name for info in parameters() if info.name in symbols]
        shaping = [name for symbol, names in _SHAPED_BY.items() if symbol in symbols for name in names]
        return tuple(dict.fromkeys([*named, *shaping]))

    @property
    def product(self) -> ast.expr:
        """The expression that is added to the target, with the coefficient as the name ``c``."""
        return ast.parse(f"{self.sign}({self.expression}){self.factor}", mode="eval").body

    @property
    def symbols(self) -> frozenset[str]:
        """The symbols of the term's product, without ``c``."""
        return _symbols_in(f"{self.sign}({self.expression}){self.factor}") - {"c"}

    @property
    def mechanism(self) -> str:
        """The mechanism of the term's place. A wheel torque that depends on the current has the mechanism "motor"."""
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
    rows = [(info, _NAME.fullmatch(info.name), _MEANING.fullmatch(info.meaning)) for info in parameters()]
    return tuple(
        Basis(info, name[1], name[2], name[3] is not None, *meaning.groups())
        for info, name, meaning in rows
        if name is not None and meaning is not None
    )


@cache
def parameters() -> tuple[ParameterInfo, ...]:
    """Returns the rows of the composed effect: coefficients first, then the parameters that shape terms."""
    return catalogue.effect(EFFECT).parameters


def terms_of(values: Mapping[str, float]) -> tuple[Term, ...]:
    """Returns the terms whose coefficients are not 0 in `values`, in the order of the table."""
    return tuple(Term(term, values[term.name]) for term in basis() if values.get(term.name, 0.0) != 0.0)


def settings_of(chosen: Iterable[Basis], values: Mapping[str, float]) -> dict[str, float]:
    """Returns the parameters that shape the chosen terms, from `values` or else from the presets."""
    needed = {name for term in chosen for name in term.tuned}
    return {p.name: values.get(p.name, p.preset) for p in parameters() if p.name in needed}


@cache
def _symbols_in(expression: str) -> frozenset[str]:
    """Returns the variables of a C expression."""
    nodes = list(ast.walk(ast.parse(expression.strip(), mode="eval")))
    called = {node.func.id for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    return frozenset(node.id for node in nodes if isinstance(node, ast.Name)) - called


MINUS = "\u2212"

_TARGETS = {
    "V": "voltage at each motor",
    "T": "torque of each wheel",
    "X": "force ahead",
    "N": "moment clockwise",
    "slope": "sine of the angle by which the floor falls along x",
    "wheel_speed": "speed of each wheel that is read",
    "yaw_rate": "yaw rate that is read",
    "accel_surge": "surge acceleration that is read",
    "accel_sway": "sway acceleration that is read",
}
_SYMBOLS = {
    "psi": "ψ",
    "theta": "θ",
    "PI": "π",
    "other": "V_o",
    "patch": "P(x)",
    "sprung": "q",
    "side": "s",
    "i_left": "i_l",
    "i_right": "i_r",
    "slope": "S_x",
    "wheel_speed": "w_read",
    "yaw_rate": "r_read",
    "accel_surge": "a_read",
    "accel_sway": "b_read",
}
_LEGEND = {
    "V": "V the motor's voltage",
    "other": "V_o the other motor's voltage",
    "i": "i the motor's current",
    "w": "w the wheel's speed",
    "theta": "θ its angle",
    "u": "u the surge",
    "r": "r the yaw rate",
    "psi": "ψ the heading",
    "x": "x, y the position",
    "a": "a the specific force ahead",
    "b": "b the specific force to the right",
    "i_left": "i_l, i_r the motors' currents",
    "side": "s is 1 at the left, -1 at the right",
}


def equation(terms: Sequence[Term], settings: Mapping[str, float]) -> str:
    """Returns the terms' equation as text: for each place, the sum that the terms add there, with four digits."""
    return "; ".join(f"Δ{symbol(target)} = {added}" for target, added in sums(terms, settings, Writer()))


def sums(terms: Sequence[Term], settings: Mapping[str, float], out: Writer) -> list[tuple[str, str]]:
    """Returns, for each place, the plant's symbol and the sum that the terms add there, as text from `out`."""
    written: dict[str, str] = {}
    for term in terms:
        negative, factors = _factors(term.basis.product)
        negative ^= term.coefficient < 0
        factors = [node for node in factors if not (isinstance(node, ast.Name) and node.id == "c")]
        added = out.product([out.number(abs(term.coefficient)), *_powers(factors, settings, out)])
        if (before := written.get(term.basis.target)) is None:
            written[term.basis.target] = (out.minus() if negative else "") + added
        else:
            written[term.basis.target] = before + out.operator(MINUS if negative else "+") + added
    return list(written.items())


def legend(terms: Sequence[Term], settings: Mapping[str, float]) -> str:
    """Returns one sentence that explains the symbols of the terms' equation."""
    symbols = frozenset().union(*(term.basis.symbols for term in terms))
    parts = [f"Δ{symbol(t)} is added to the {_TARGETS[t]}" for t in dict.fromkeys(term.basis.target for term in terms)]
    parts += [text for name, text in _LEGEND.items() if name in symbols]
    if "patch" in symbols:
        edge = f"{settings['patch_half_width']:.4g} m either side of x = {settings['patch_x']:.4g} m"
        parts.append(f"P(x) is 1 on the strip {edge} and 0 off it")
    if "sprung" in symbols:
        swings = f"{settings['frequency']:.4g} Hz with damping ratio {settings['damping']:.4g}"
        parts.append(f"q is the force, over its mass, of a mass that swings at {swings}")
    if "t" in symbols:
        parts.append("t is the time since " + ("power-on" if settings.get("clock", 0.0) > 0.5 else "the run's start"))
    return "; ".join(parts) + "; SI units."


def symbol(name: str) -> str:
    """Returns the text of a symbol of the plant's table."""
    return _SYMBOLS.get(name, name)


class Writer:
    """Writes the parts of an equation, here as plain text."""

    def number(self, value: float) -> str:
        return f"{value:.4g}"

    def symbol(self, name: str) -> str:
        return symbol(name)

    def power(self, base: str, exponent: int) -> str:
        return base + {2: "²", 3: "³", 4: "⁴"}[exponent]

    def product(self, factors: list[str]) -> str:
        """Joins factors. A number after a symbol gets a dot before it, so that it does not look like an index."""
        return "".join(
            text if k == 0 else f" · {text}" if text[0].isdigit() else f" {text}" for k, text in enumerate(factors)
        )

    def bracket(self, inner: str) -> str:
        return f"({inner})"

    def call(self, name: str, inner: str) -> str:
        return {"fabs": f"|{inner}|", "sqrt": f"√({inner})", "sign": f"sgn({inner})"}.get(name, f"{name}({inner})")

    def over(self, above: str, below: str) -> str:
        return f"{above}/{below}"

    def operator(self, sign: str) -> str:
        return f" {sign} "

    def minus(self) -> str:
        return MINUS


def _factors(node: ast.expr) -> tuple[bool, list[ast.expr]]:
    """Returns whether a product is negative, and its factors other than 1."""
    if isinstance(node, ast.UnaryOp):
        negative, factors = _factors(node.operand)
        return not negative, factors
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        (left, before), (right, behind) = _factors(node.left), _factors(node.right)
        return left != right, before + behind
    return False, [] if isinstance(node, ast.Constant) and node.value == 1 else [node]


def _powers(factors: Sequence[ast.expr], settings: Mapping[str, float], out: Writer) -> list[str]:
    """Returns the factors as text. Equal factors become a power; factors of 1 are left out."""
    written = [_write(node, settings, out) for node in factors]
    written = [
        out.bracket(text) if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)) else text
        for node, text in zip(factors, written, strict=True)
    ]
    return [
        text if written.count(text) == 1 else out.power(text, written.count(text))
        for text in dict.fromkeys(written)
        if text != out.number(1.0)
    ]


def _write(node: ast.expr, settings: Mapping[str, float], out: Writer) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return out.number(node.value)
    if isinstance(node, ast.Name):
        return out.number(settings[node.id]) if node.id in settings else out.symbol(node.id)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id == "copysign":  # `copysign(size, of)` is written as size times sign(of)
            size, of = node.args
            return out.product([_write(size, settings, out), out.call("sign", _write(of, settings, out))])
        return out.call(node.func.id, _write(node.args[0], settings, out))
    if isinstance(node, ast.BinOp):
        if isinstance(node.op, ast.Mult):
            negative, factors = _factors(node)
            return (out.minus() if negative else "") + out.product(_powers(factors, settings, out))
        left, right = _write(node.left, settings, out), _write(node.right, settings, out)
        if isinstance(node.op, ast.Div):
            return out.over(left, right)
        return left + out.operator("+" if isinstance(node.op, ast.Add) else MINUS) + right
    raise ValueError(f"no way to write {ast.dump(node)}")
