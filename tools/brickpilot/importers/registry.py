"""The type of a row of `IMPORTERS`: a kind of log, the function that reads it, and its options."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.importers.channels import Contents
    from brickpilot.importers.writer import Imported


@dataclass(frozen=True)
class Option:
    """An option of `brickpilot import` that only some importers take.

    Attributes:
        keyword: the argument's name in the importers' functions.
        flag: the option on the command line, e.g. ``--map``.
        help: for the user, in one or two sentences. The command adds the kinds of log that take the option.
        metavar: the name of its value in the help; empty for a choice or a switch.
        choices: the values allowed; empty: any text.
        default: the value if the user does not give the option. False: the option is a switch.
        repeatable: whether the importers get a tuple of all values given.
        required: whether each importer with this option needs it.
        unless: the keyword of an option that makes this one unnecessary.
    """

    keyword: str
    flag: str
    help: str
    metavar: str = ""
    choices: tuple[str, ...] = ()
    default: str | bool | None = None
    repeatable: bool = False
    required: bool = False
    unless: str = ""


@dataclass(frozen=True)
class Importer:
    """One kind of log.

    Attributes:
        kind: name of the kind of log on the command line.
        function: ``module:function``. It is called as ``function(files, out, nominal=..., name=..., **options)``, with
            one keyword for each of `options`, and returns `writer.Imported`.
        help: the files that the importer reads, in one sentence.
        reader: ``module:function`` that reads a whole file as a `channels.Log`, for ``--list``; empty: no list.
        suffixes: the endings of its files, e.g. ``.csv``, or the name of a file in the folder of a log, e.g.
            ``metadata.yaml``.
        example: the arguments of one call, after ``brickpilot import``.
        options: the options that it takes besides ``--out``, ``--nominal`` and ``--name``.
        reports_progress: whether `function` also takes `progress`, which it calls with (done, total, text).
    """

    kind: str
    function: str
    help: str
    example: str
    options: tuple[Option, ...] = ()
    reports_progress: bool = False
    reader: str = ""
    suffixes: tuple[str, ...] = ()

    def contents(self, file: Path) -> Contents:
        """Reads a whole file, and returns what it holds."""
        from brickpilot.importers.channels import contents

        module, name = self.reader.split(":")
        return contents(getattr(importlib.import_module(module), name)(file))

    def load(self) -> Callable[..., Imported]:
        """Imports the function; the readers of this kind of log are loaded only then."""
        module, name = self.function.split(":")
        function: Callable[..., Imported] = getattr(importlib.import_module(module), name)
        return function


def kind_of(file: Path, importers: Iterable[Importer]) -> str | None:
    """Returns the kind of log, from a file's ending or from the files in a folder; None: an unknown kind."""
    for row in importers:
        if file.suffix.lower() in row.suffixes or (
            file.is_dir() and any((file / one).is_file() for one in row.suffixes)
        ):
            return row.kind
    return None


def importer_and_files(
    words: Sequence[str], kind: str | None, importers: Sequence[Importer]
) -> tuple[Importer, list[Path]]:
    """Returns the importer of the kind that the user names, or else of the first file's ending; and the files.

    Raises:
        InputError: the kind is neither named nor known by the ending, or no file is given.
    """
    rows = {row.kind: row for row in importers}
    files = [Path(word) for word in words]
    if kind is None and words[0] in rows:
        kind, files = words[0], files[1:]
    if not files:
        raise InputError("no file to import", field="FILE")
    kind = kind or kind_of(files[0], importers)
    if kind is None:
        raise InputError(f"no kind of log is known by this ending; name one: {', '.join(rows)}", file=files[0])
    return rows[kind], files


def all_options(importers: Sequence[Importer]) -> list[Option]:
    return list(dict.fromkeys(option for row in importers for option in row.options))


def kinds_with(option: Option, importers: Iterable[Importer]) -> str:
    """Returns the kinds of log that take `option`, as words: "matlab and table"."""
    *most, last = [row.kind for row in importers if option in row.options]
    return f"{', '.join(most)} and {last}" if most else last


def options_taken(importer: Importer, importers: Sequence[Importer], given: Mapping[str, Any]) -> dict[str, Any]:
    """Returns keyword -> value of the options that `importer` takes; options that are not given have their defaults.

    A given option without a default, or a given switch, must be one of the importer's; other given options may be
    ignored.

    Raises:
        InputError: a given option belongs to other kinds of log, a needed option is missing, or there is no such
            option.
    """
    known = {option.keyword for option in all_options(importers)}
    for keyword in given:
        if keyword not in known:
            raise InputError(f"is no option of an importer: {', '.join(sorted(known))}", field=keyword)
    asked: dict[str, Any] = {one.keyword: () if one.repeatable else one.default for one in all_options(importers)}
    asked.update(given)
    for option in all_options(importers):
        value = asked[option.keyword]
        if option not in importer.options and option.default in (None, False) and value:
            message = f"works only with {kinds_with(option, importers)}; a log of kind {importer.kind} describes itself"
            raise InputError(message, field=option.flag)
        spared = any(one.keyword == option.unless and asked[one.keyword] for one in importer.options)
        if option in importer.options and option.required and not value and not spared:
            raise InputError(f"is needed to import {importer.kind}", field=option.flag)
    return {option.keyword: asked[option.keyword] for option in importer.options}
