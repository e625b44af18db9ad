"""The rows of the table of importers: a kind of log, the function that reads it, and its options."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from brickpilot.importers.listing import Contents
    from brickpilot.importers.writer import Imported


@dataclass(frozen=True)
class Option:
    """An option of `brickpilot import` that only some importers take.

    Attributes:
        keyword: the argument's name in the importers' functions.
        flag: how it is written on the command line, e.g. ``--map``.
        help: for the user, in one or two sentences. The command adds the kinds of log that take the option.
        metavar: what stands for its value in the help; empty for a choice or a switch.
        choices: the values allowed; empty: any text.
        default: the value where the user gives none. False makes the option a switch.
        repeatable: whether the importers get a tuple of all values given.
        required: whether every importer that takes it needs it.
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
        kind: its name on the command line.
        function: ``module:function``. It is called as ``function(files, out, nominal=..., name=..., **options)``, with
            one keyword for each of `options`, and returns `writer.Imported`.
        help: what it reads, in one sentence.
        reader: ``module:function`` that reads a file whole, as a `channels.Log`, for ``--list``; empty: it has no list.
        suffixes: the endings of its files, e.g. ``.csv``; the name of a file that lies in the folder of a log, e.g.
            ``metadata.yaml``.
        example: the arguments of one call, after ``brickpilot import``.
        options: those it takes beside ``--out``, ``--nominal`` and ``--name``.
        reports_progress: whether it also takes `progress`, which it calls with (done, total, text).
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
        from brickpilot.importers.listing import contents

        module, name = self.reader.split(":")
        return contents(getattr(importlib.import_module(module), name)(file))

    def load(self) -> Callable[..., Imported]:
        """Imports the function; only then are the readers of this kind of log loaded."""
        module, name = self.function.split(":")
        function: Callable[..., Imported] = getattr(importlib.import_module(module), name)
        return function


def kind_of(file: Path, importers: Iterable[Importer]) -> str | None:
    """Returns the kind of log that a file's ending shows, or what lies in a folder; None: none that is known."""
    for row in importers:
        if file.suffix.lower() in row.suffixes or (
            file.is_dir() and any((file / one).is_file() for one in row.suffixes)
        ):
            return row.kind
    return None
