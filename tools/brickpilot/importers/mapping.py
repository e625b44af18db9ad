"""Reads two options: the source of a signal in a log, `SIGNAL=FORMULA:UNIT`, and nominal values, `NAME=VALUE`.

A formula over the columns of a log, such as ``encL * 1/960`` or ``(left + right) / 2``, consists of names of columns,
numbers, ``+ - * /`` and parentheses; nothing else is evaluated. The name of an existing column may contain any
character: if the log has a column ``/drive/left``, this text is its name and not a division.
"""

from __future__ import annotations

import ast
import difflib
import math
import operator
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from brickpilot.data.audit.wiring_motion import Taken
from brickpilot.data.rows import NUMBER
from brickpilot.data.signals import SIGNALS
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector

_LONGEST = 300  # largest number of characters of a formula; Python's parser has a limited depth
_LONGEST_LIST = 200  # largest number of characters of the names that an error lists
_NUMBER = NUMBER.removeprefix("[+-]?")  # without a sign, because a sign is an operator here
_IDENTIFIER = r"[^\W\d]\w*(?:\.\w+)*"
_INDEX = r"(?:\[\d{1,5}\])?"
_SIGNS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_ALLOWED = (ast.BinOp, ast.UnaryOp, ast.Constant, ast.Name, ast.Load, *_SIGNS)
_ALIKE = 0.8  # least similarity by difflib of a text that counts as a misspelled name of the form /drive/left


class FormulaError(ValueError):
    """A text is no formula. The message is for the user and does not repeat the text."""


@dataclass(frozen=True)
class Scaling:
    """A linear conversion: value = scale * cell + offset."""

    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Formula:
    """A formula that has been read.

    Attributes:
        text: the formula as the user wrote it.
        places: the columns that the formula uses, without repeats, in the order of the text. A column of a matrix is
            ``name[index]``, from 0.
        scaling: the linear conversion of a column's cells, if the formula is linear in one column; else None.
    """

    text: str
    places: tuple[str, ...]
    scaling: Scaling | None
    _tree: ast.expr

    def values(self, columns: Mapping[str, Vector]) -> Vector:
        """Returns the formula's value in each row.

        Raises:
            FormulaError: the formula divides by 0, or a value is too large for a float.
        """
        named = {f"_{number}": columns[place] for number, place in enumerate(self.places)}
        with np.errstate(all="ignore"):
            result = np.asarray(_evaluated(self._tree, named), dtype=np.float64)
        blank = np.any([np.isnan(column) for column in named.values()], axis=0)
        if (wrong := ~np.isfinite(result) & ~blank).any():
            raise FormulaError(f"{self.text!r} is no number in {np.count_nonzero(wrong)} rows: it divides by 0 there")
        return result


def parse_formula(text: str, names: Sequence[str]) -> Formula:
    """Returns the formula of `text`.

    Args:
        text: a name, ``name[index]``, or a formula of such names.
        names: the columns of the log. A text that equals a column's name means this column. An unknown name raises
            no error here; `Formula.places` contains the name.

    Raises:
        FormulaError: the text is no formula. The message says what is wrong, and where possible at which character.
    """
    text = text.strip()
    if text in names:
        return Formula(text, (text,), Scaling(), ast.Name("_0"))
    try:
        places, tree = _parsed(text, names)
    except FormulaError:
        if not difflib.get_close_matches(text, [name for name in names if re.search(r"\W", name)], 1, _ALIKE):
            raise
        places, tree = [text], ast.Name("_0")
    if not places:
        raise FormulaError("names no column; a fixed value stands in --nominal")
    return Formula(text, tuple(places), _scaling(tree, len(places)), tree)


def unknown_name(kind: str, name: str, names: Iterable[str]) -> str:
    """Returns "no column 'encl' among ...; did you mean 'encL'?" for a name that a log does not have."""
    known = [text for text in names if text]
    listed = ", ".join(known)
    if len(listed) > _LONGEST_LIST:
        listed = f"{listed[:_LONGEST_LIST].rpartition(',')[0]}, ..."
    lower = {text.lower(): text for text in reversed(known)}
    alike = difflib.get_close_matches(name.lower(), list(lower), 1, 0.6)
    return f"no {kind} {name!r} among {listed}" + (f"; did you mean {lower[alike[0]]!r}?" if alike else "")


def _parsed(text: str, names: Sequence[str]) -> tuple[list[str], ast.expr]:
    """Returns the columns of a formula, and its syntax tree, in which column k has the name ``_k``."""
    if len(text) > _LONGEST:
        raise FormulaError(f"is longer than {_LONGEST} characters")
    places: list[str] = []
    parts: list[str] = []
    at: list[int] = []  # position in `text` of each character of the rewritten text
    token = _tokens(names)
    position = 0
    while position < len(text):
        matched = token.match(text, position)
        if not matched:
            raise FormulaError(f"{text[position]!r} at character {position + 1} is neither a column nor + - * / ( )")
        part = matched[0]
        if matched["name"]:
            if part not in places:
                places.append(part)
            part = f"_{places.index(part)}"
        elif matched["number"]:
            part = repr(_finite(float(part)))
        parts.append(f"{part} ")  # the blank separates a number from a name
        at.extend([position] * len(parts[-1]))
        position = matched.end()
    return places, _tree("".join(parts), text, at)


def _tokens(names: Sequence[str]) -> re.Pattern[str]:
    """Returns a pattern that matches a name, a number or a sign. Known names are tried first, the longest one first."""
    known = sorted((name for name in names if name and not re.fullmatch(_NUMBER, name)), key=len, reverse=True)
    edged = [
        ("(?<!\\w)" if name[0].isalnum() else "") + re.escape(name) + ("(?!\\w)" if name[-1].isalnum() else "")
        for name in known
    ]
    return re.compile(rf"(?P<name>(?:{'|'.join([*edged, _IDENTIFIER])}){_INDEX})|(?P<number>{_NUMBER})|[-+*/()]|\s+")


def _tree(rewritten: str, text: str, at: Sequence[int]) -> ast.expr:
    try:
        tree = ast.parse(rewritten.strip(), mode="eval").body
    except SyntaxError as error:
        start = len(rewritten) - len(rewritten.lstrip())
        offset = (error.offset or 1) - 1 + start
        if not error.offset or offset >= len(at) - 1:
            raise FormulaError("is no formula: it ends too early") from error
        raise FormulaError(f"is no formula: wrong near {text[at[offset] :][:10]!r}") from error
    for node in ast.walk(tree):
        if not isinstance(node, _ALLOWED):
            raise FormulaError("may have names of columns, numbers, + - * / and parentheses only")
    return tree


def _evaluated(node: ast.expr, named: Mapping[str, Any]) -> Any:
    """Returns the value of a tree of `_ALLOWED` nodes: a float, or a value of the same type as those of `named`.

    Raises:
        FormulaError: the tree divides by the constant 0, or a number is too large.
    """
    match node:
        case ast.Name():
            return named[node.id]
        case ast.Constant():
            return node.value
        case ast.UnaryOp():
            return _SIGNS[type(node.op)](_evaluated(node.operand, named))
    assert isinstance(node, ast.BinOp)
    left, right = _evaluated(node.left, named), _evaluated(node.right, named)
    if isinstance(node.op, ast.Div) and isinstance(right, float) and right == 0.0:
        raise FormulaError("divides by 0")
    value = _SIGNS[type(node.op)](left, right)
    return _finite(value) if isinstance(value, float) else value


def _scaling(tree: ast.expr, places: int) -> Scaling | None:
    """Returns the linear conversion of a formula; None: the formula has several columns, or is not linear.

    Raises:
        FormulaError: the formula divides by the constant 0, has too large a number, or does not depend on its column.
    """
    named = [f"_{number}" for number in range(places)]
    with np.errstate(all="ignore"):
        try:
            factors = _evaluated(tree, dict.fromkeys(named, Polynomial([0.0, 1.0]))).coef
        except TypeError:  # the formula divides by a polynomial
            _evaluated(tree, dict.fromkeys(named, np.ones(1)))  # refuses wrong constants
            return None
    for factor in factors:
        _finite(factor)
    if places == 1 and factors.size == 1:
        raise FormulaError("does not depend on any column")
    return Scaling(float(factors[1]), float(factors[0]) + 0.0) if places == 1 and factors.size == 2 else None


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise FormulaError("a number in it is too large")
    return value


@dataclass(frozen=True)
class Source:
    """The source of a signal in a log.

    Attributes:
        text: a column's name, ``name[index]``, or a formula.
        unit: the unit of the formula's value.
        states_unit: whether the user stated the unit; otherwise `unit` is the SI unit.
    """

    text: str
    unit: str
    states_unit: bool = True


@dataclass(frozen=True)
class Signals:
    """The signals of one log, in the order of time.

    Attributes:
        file: the log.
        columns: signal or time -> its cells, NaN where blank. For a formula that is linear in one column, these are the
            column's cells as logged.
        scalings: signal -> conversion of its cells to values in the signal's unit; signals with scale 1 and offset 0
            are left out.
        units: signal -> unit of the values.
        notes: sentences for the user on what was left out or changed.
        starts: indices of the rows at which a new run has to begin, because a clock or a counter starts again.
    """

    file: Path
    columns: dict[str, Vector]
    scalings: dict[str, Scaling]
    units: Mapping[str, str]
    notes: Sequence[str] = ()
    starts: Sequence[int] = ()


def parse_mapping(entries: Sequence[str], *, needs_time: bool = True) -> dict[str, Source]:
    """Returns signal -> source from entries like ``position=qm:mm`` or ``duty_left=pwmL*1/255``.

    The default unit is the SI unit. Formulas are read later, when the names of the log's columns are known.

    Args:
        entries: the entries as the user wrote them.
        needs_time: whether an entry has to name the time.

    Raises:
        InputError: an entry has another form or an unknown signal or unit, a signal is given twice, or time is missing.
    """
    sources: dict[str, Source] = {}
    for entry in entries:
        signal, equals, rest = (part.strip() for part in entry.partition("="))
        text, unit = _unit_apart(rest)
        if not (signal and equals and text) or unit == "":
            message = "is not SIGNAL=NAME, SIGNAL=NAME[INDEX], SIGNAL=FORMULA or one of these with :UNIT"
            raise InputError(message, field=f"--map {entry}")
        if signal not in SIGNALS:
            alike = difflib.get_close_matches(signal, list(SIGNALS), 1)
            raise InputError(f"unknown signal{f'; did you mean {alike[0]}?' if alike else ''}", field=f"--map {entry}")
        if signal in sources:
            raise InputError(f"{signal} is mapped already", field=f"--map {entry}")
        try:
            si_factor(unit or SIGNALS[signal].unit, SIGNALS[signal].unit)
        except ValueError as error:
            raise InputError(str(error), field=f"--map {entry}") from error
        sources[signal] = Source(text, unit or SIGNALS[signal].unit, unit is not None)
    if needs_time and "time" not in sources:
        raise InputError("time is not mapped", field="--map")
    return sources


def _unit_apart(text: str) -> tuple[str, str | None]:
    """Returns formula and unit, split at the last colon. No unit begins with /, so ``NT:/drive/left`` has no unit."""
    head, colon, unit = text.rpartition(":")
    if not colon or unit.startswith("/"):
        return text, None
    return head.strip(), unit.strip()


def read_formulas(sources: Mapping[str, Source], names: Sequence[str]) -> dict[str, Formula]:
    """Returns signal -> formula, for a log that has the columns `names`.

    A formula may name an unknown column; the reader of the log refuses it later (`unknown_name`).

    Raises:
        InputError: a text is no formula.
    """
    formulas = {}
    for signal, source in sources.items():
        try:
            formulas[signal] = parse_formula(source.text, names)
        except FormulaError as error:
            raise InputError(str(error), field=f"--map {signal}={source.text}") from error
    return formulas


def take(
    file: Path, formulas: Mapping[str, Formula], cells: Mapping[str, Vector]
) -> tuple[dict[str, Vector], dict[str, Scaling]]:
    """Returns `Signals.columns` and `Signals.scalings`.

    Args:
        file: the log, which errors name.
        formulas: the result of `read_formulas`.
        cells: column -> its cells, NaN where blank, for all columns of the formulas.

    Raises:
        InputError: a formula has no finite value in some rows.
    """
    columns = {}
    for signal, formula in formulas.items():
        try:
            columns[signal] = formula.values(cells) if formula.scaling is None else cells[formula.places[0]]
        except FormulaError as error:
            raise InputError(str(error), file=file, field=signal) from error
    return columns, scalings_of(formulas)


def scalings_of(formulas: Mapping[str, Formula]) -> dict[str, Scaling]:
    """Returns signal -> scaling; signals with scale 1 and offset 0 are left out."""
    linear = {signal: formula.scaling for signal, formula in formulas.items() if formula.scaling is not None}
    return {signal: scaling for signal, scaling in linear.items() if scaling != Scaling()}


def common_scalings(logs: Sequence[Signals]) -> dict[str, Scaling]:
    """Returns signal -> the scaling that all logs of a data set share.

    Raises:
        InputError: a formula has another meaning in one log, because the log's columns have other names.
    """
    for log in logs:
        if log.scalings != logs[0].scalings:
            raise InputError(f"its columns are named otherwise than those of {logs[0].file}", file=log.file)
    return logs[0].scalings


def parse_nominal(entries: Sequence[str]) -> dict[str, float]:
    """Returns parameter -> value in SI from entries like ``mass=0.6``.

    Names and ranges are checked later, when the data set is written.

    Raises:
        InputError: an entry has another form; the message names the entry.
    """
    nominal: dict[str, float] = {}
    for entry in entries:
        name, _, text = entry.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not name.strip() or not math.isfinite(value):
            raise InputError("is not NAME=NUMBER", field=f"--nominal {entry}")
        nominal[name.strip()] = value
    return nominal


def mending(sources: Mapping[str, Source], taken: Mapping[str, Taken]) -> str:
    """Returns the options `--map` of `import` that give each signal its right source; "": there are none."""
    options = []
    for signal, right in taken.items():
        if right.source not in sources or not math.isfinite(right.factor):
            continue
        was = sources[right.source]
        unit = f":{was.unit}" if was.states_unit and was.unit != SIGNALS[signal].unit else ""
        options.append(f"--map {shlex.quote(f'{signal}={_times(was.text, right.factor)}{unit}')}")
    return " ".join(options)


def _times(text: str, factor: float) -> str:
    """Returns a formula times a factor: "encL/960" times 2/3 is "encL/1440"."""
    column, slash, number = text.partition("/")
    try:
        counts = float(number) / factor if slash else math.nan
    except ValueError:
        counts = math.nan
    if math.isfinite(counts):
        return f"{column}/{round(counts) if abs(counts) >= 100 else float(f'{counts:.6g}'):g}"
    if factor == 1.0:
        return text
    plain = text if re.fullmatch(r"[\w./\[\]]+", text) else f"({text})"
    return f"-{plain}" if factor == -1.0 else f"{plain}*{factor:.6g}"


def units_of(sources: Mapping[str, Source]) -> dict[str, str]:
    """Returns signal -> the unit of its source."""
    return {signal: source.unit for signal, source in sources.items()}
