"""The rows of the table of importers: a kind of log, the function that reads it, and its options."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
    """

    keyword: str
    flag: str
    help: str
    metavar: str = ""
    choices: tuple[str, ...] = ()
    default: str | bool | None = None
    repeatable: bool = False
    required: bool = False


@dataclass(frozen=True)
class Importer:
    """One kind of log.

    Attributes:
        kind: its name on the command line.
        function: ``module:function``. It is called as ``function(files, out, nominal=..., name=..., **options)``, with
            one keyword for each of `options`, and returns `writer.Imported`.
        help: what it reads, in one sentence.
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

    def load(self) -> Callable[..., Imported]:
        """Imports the function; only then are the readers of this kind of log loaded."""
        module, name = self.function.split(":")
        function: Callable[..., Imported] = getattr(importlib.import_module(module), name)
        return function
