"""`brickpilot import`: its kinds of log, its help and its options come from the table of importers."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.errors import InputError
from brickpilot.importers import IMPORTERS
from brickpilot.importers.registry import Importer, Option

if TYPE_CHECKING:
    from brickpilot.importers.writer import Imported


def import_command(importers: Sequence[Importer]) -> click.Command:
    """Returns the command that turns a log into a data set by one of `importers`."""

    def import_log(
        kind: str, files: tuple[str, ...], out: str, nominal: tuple[str, ...], name: str | None, as_json: bool,
        **options: Any,
    ) -> None:  # fmt: skip
        from brickpilot.importers.mapping import parse_nominal

        known = parse_nominal(nominal)
        importer = next(row for row in importers if row.kind == kind)
        taken = _taken(importer, importers, options)
        with progress_shown(as_json) if importer.reports_progress else nullcontext() as progress:
            if importer.reports_progress:
                taken["progress"] = progress
            made = importer.load()([Path(file) for file in files], Path(out), nominal=known, name=name, **taken)
        _show(made, as_json)

    return _with_options(import_log, importers)


def _with_options(function: Any, importers: Sequence[Importer]) -> click.Command:
    """Returns the click command of `function`, with the options that all importers share and those of the rows."""
    decorators = [
        click.argument("kind", type=click.Choice([row.kind for row in importers])),
        click.argument("files", nargs=-1, required=True, metavar="FILE..."),
        click.option("--out", required=True, metavar="DATASET", help="The folder to write."),
        *(_click_option(option, importers) for option in _options(importers)),
        click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable."),
        click.option("--name", help="The name of the data set; default: the name of the folder."),
        as_json,
    ]
    for decorate in reversed(decorators):
        function = decorate(function)
    return click.command("import", help=_help(importers))(function)


def _help(importers: Sequence[Importer]) -> str:
    rows = (f"\b\n{row.kind}: {row.help}\n    brickpilot import {row.example}" for row in importers)
    return "\n\n".join(["Turns logs of other tools into a data set.", *rows])


def _options(importers: Sequence[Importer]) -> list[Option]:
    return list(dict.fromkeys(option for row in importers for option in row.options))


def _click_option(option: Option, importers: Sequence[Importer]) -> Any:
    kinds = _kinds(option, importers)
    note = f"{kinds} {'needs' if ' and ' not in kinds else 'need'} it." if option.required else f"For {kinds}."
    return click.option(
        option.flag,
        option.keyword,
        type=click.Choice(option.choices) if option.choices else None,
        is_flag=option.default is False,
        default=option.default,
        show_default=isinstance(option.default, str),
        multiple=option.repeatable,
        metavar=option.metavar or None,
        help=f"{option.help} {note}",
    )


def _kinds(option: Option, importers: Iterable[Importer]) -> str:
    """Returns the kinds of log that take `option`, as words: "matlab and table"."""
    *most, last = [row.kind for row in importers if option in row.options]
    return f"{', '.join(most)} and {last}" if most else last


def _taken(importer: Importer, importers: Sequence[Importer], given: dict[str, Any]) -> dict[str, Any]:
    """Returns the options that `importer` takes, by keyword.

    An option without a default has to be one that the importer takes; others are left at their default or ignored.

    Raises:
        InputError: an option of other kinds of log is given, or one that is needed is not.
    """
    for option in _options(importers):
        value = given[option.keyword]
        if option not in importer.options and option.default is None and value:
            message = f"works only with {_kinds(option, importers)}; a log of kind {importer.kind} describes itself"
            raise InputError(message, field=option.flag)
        if option in importer.options and option.required and not value:
            raise InputError(f"is needed to import {importer.kind}", field=option.flag)
    return {option.keyword: given[option.keyword] for option in importer.options}


def _show(made: Imported, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps({"dataset": str(made.folder), "runs": list(made.runs), "notes": list(made.notes)}))
        return
    for note in made.notes:
        click.echo(f"note: {note}")
    click.echo(f"{made.folder}: {len(made.runs)} run{'s' if len(made.runs) != 1 else ''}")


import_log = import_command(IMPORTERS)
