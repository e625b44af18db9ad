"""Reads TOML files and stores the line of each value, so that an error can name the line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from brickpilot.data.whole_files import read_text
from brickpilot.errors import InputError

Key = tuple[str | int, ...]

SIZE_LIMIT = 2**20
"""Bytes; a larger file is refused."""

_LARGE = 1e12  # larger numbers are refused unless the caller of `number` sets another limit

_NAME = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
_DOTTED = rf"{_NAME}(?:\s*\.\s*{_NAME})*"
_HEADER = re.compile(rf"^\s*(\[\[?)\s*({_DOTTED})\s*\]\]?")
_ASSIGN = re.compile(rf"^\s*({_DOTTED})\s*=")
_IN_TABLE = re.compile(rf"[{{,]\s*({_NAME})\s*=")


def _names(dotted: str) -> Key:
    return tuple(name.strip("\"'") for name in re.findall(_NAME, dotted))


class TomlFile:
    """A parsed file: ``data``, and the 1-based line of any key path in it.

    Key paths are tuples of table names and array positions: ``("runs", 2, "file")``.

    Raises:
        InputError: the file is missing, not UTF-8 or not TOML.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        text = read_text(path, SIZE_LIMIT)
        self._lines = dict(self._index(text))
        try:
            self.data: dict[str, Any] = tomllib.loads(text)
            self._check_integers((), self.data)
        except RecursionError as error:
            raise InputError("is not TOML: nested too deep", file=path) from error
        except ValueError as error:  # a TOMLDecodeError, or a number of thousands of digits
            place = re.search(r"\(at line (\d+), column \d+\)", str(error))
            line = int(place[1]) if place else text.count("\n") + 1
            message = re.sub(r"\s*\(at .*\)", "", str(error))
            raise InputError(f"is not TOML: {message}", file=path, line=line) from error

    @staticmethod
    def _index(text: str) -> Iterable[tuple[Key, int]]:
        table: Key = ()
        counts: dict[Key, int] = {}
        for number, line in enumerate(text.split("\n"), start=1):
            if header := _HEADER.match(line):
                table = _names(header[2])
                if header[1] == "[[":
                    counts[table] = counts.get(table, -1) + 1
                # A table below an array of tables belongs to the entry of this array that was read last.
                for depth in range(len(table), 0, -1):
                    if table[:depth] in counts:
                        table = (*table[:depth], counts[table[:depth]], *table[depth:])
                        break
                yield table, number
            elif assign := _ASSIGN.match(line):
                key = (*table, *_names(assign[1]))
                yield key, number
                for inner in _IN_TABLE.findall(line[assign.end() :]):
                    yield (*key, inner.strip("\"'")), number

    def _check_integers(self, key: Key, value: object) -> None:
        """Refuses integers of more than 64 bits: TOML forbids them, and Python reads them but may not print them."""
        if isinstance(value, int) and abs(value) >= 2**63:
            self.refuse(key, "is an integer of more than 64 bits")
        if isinstance(value, dict | list):
            for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
                self._check_integers((*key, name), inner)

    def line(self, key: Key) -> int | None:
        """Returns the line of the key, else of the first key inside it, else of the nearest table around it."""
        for depth in range(len(key), 0, -1):
            if key[:depth] in self._lines:
                return self._lines[key[:depth]]
            if inside := [line for other, line in self._lines.items() if other[:depth] == key[:depth]]:
                return min(inside)
        return None

    def refuse(self, key: Key, message: str) -> NoReturn:
        """Raises the InputError that names this file, the key's line, and the key."""
        field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
        raise InputError(message, file=self.path, line=self.line(key), field=field or None)

    def known_keys(self, key: Key, table: Mapping[str, Any], known: Iterable[str], needed: Iterable[str] = ()) -> None:
        """Refuses the first key of `table` that is not in `known`, or else the first missing key of `needed`.

        `key`: the place of `table` in the file.
        """
        names = sorted(known)
        for name in table:
            if name not in names:
                self.refuse((*key, name), f"unknown key; known: {', '.join(names)}")
        for name in needed:
            if name not in table:
                self.refuse((*key, name), "is missing")

    def number(self, key: Key, value: object, low: float = -_LARGE, high: float = _LARGE, unit: str = "") -> float:
        """Returns `value` as a finite number in low..high, ends included, or refuses it."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(key, f"{value!r} is not a number")
        if not low <= value <= high:
            self.refuse(key, f"{value} is outside {low:g}..{high:g} {unit}".rstrip())
        return float(value)

    def positive(self, key: Key, value: object, unit: str = "") -> float:
        """Returns `value` as a finite number above zero, or refuses it."""
        number = self.number(key, value, unit=unit)
        if number <= 0.0:
            self.refuse(key, f"{number:g} is not above zero")
        return number

    def switch(self, key: Key, value: object) -> bool:
        """Returns `value` if it is true or false, or refuses it."""
        if not isinstance(value, bool):
            self.refuse(key, f"{value!r} is neither true nor false")
        return value

    def text(self, key: Key, value: object) -> str:
        """Returns `value` as a text of 1 to 200 printable characters, not all blank, or refuses it."""
        if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > 200:
            self.refuse(key, "needs a text of 1 to 200 printable characters")
        return value

    def file_name(self, key: Key, value: object) -> str:
        """Returns `value` as a text that may become a part of a file's name, or refuses it."""
        name = self.text(key, value)
        if name.startswith(".") or set(name) & set("/\\"):
            self.refuse(key, f"{name!r} cannot be a part of a file's name")
        return name

    def file_beside(self, key: Key, value: object) -> Path:
        """Returns the file that `value` names in this file's folder or below it, or refuses it.

        Every path that a file states is checked here before it is opened. A symbolic link counts as its target.
        """
        name = self.text(key, value)
        folder = self.path.parent
        try:
            outside = not (folder / name).resolve().is_relative_to(folder.resolve())
            if outside or Path(name).is_absolute() or "\\" in name:
                self.refuse(key, f"{name!r} is outside this file's folder")
            if not (folder / name).is_file():
                self.refuse(key, f"no such file: {name!r}")
        except (OSError, RuntimeError) as error:
            self.refuse(key, f"{name!r} cannot be read: {error.__class__.__name__}")
        return folder / name

    def choice(self, key: Key, value: object, known: Iterable[str]) -> str:
        """Returns `value` if it is one of `known`, or refuses it and lists them."""
        names = tuple(known)
        if not isinstance(value, str) or value not in names:
            self.refuse(key, f"{value!r} is not one of {', '.join(names)}")
        return value

    def table(self, key: Key, value: object) -> dict[str, Any]:
        """Returns `value` if it is a table, or refuses it."""
        if not isinstance(value, dict):
            self.refuse(key, f"{value!r} is not a table")
        return value
