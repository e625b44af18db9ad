"""`brickpilot import`: its kinds of log, its help and its options come from the table of importers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import as_json, import_kinds, progress_shown, wiring_lines
from brickpilot.errors import InputError
from brickpilot.importers import IMPORTERS, Importer, Option, all_options, importer_and_files, kinds_with

if TYPE_CHECKING:
    from brickpilot.importers.channels import Listed
    from brickpilot.importers.writer import Imported


def import_command(importers: Sequence[Importer]) -> click.Command:
    """Returns the command that turns a log into a data set by one of `importers`."""

    def command(
        words: tuple[str, ...], kind: str | None, show_list: bool, out: str | None, nominal: tuple[str, ...],
        name: str | None, as_json: bool, **options: Any,
    ) -> None:  # fmt: skip
        from brickpilot.importers.mapping import parse_nominal
        from brickpilot.public.logs import import_log

        importer, files = importer_and_files(words, kind, importers)
        if show_list:
            _show_list(importer, files, as_json)
            return
        if out is None:
            raise InputError("is needed: the folder to write", field="--out")
        known = parse_nominal(nominal)
        with progress_shown(as_json) if importer.reports_progress else nullcontext() as progress:
            made = import_log(
                files,
                out,
                kind=importer.kind,
                nominal=known,
                name=name,
                progress=progress,
                importers=importers,
                **options,
            )
        _show(made, as_json)

    return _with_options(command, importers)


def _with_options(function: Any, importers: Sequence[Importer]) -> click.Command:
    """Returns the click command of `function`, with the options that all importers share and those of the rows."""
    decorators = [
        click.argument("words", nargs=-1, required=True, metavar="[KIND] FILE...", shell_complete=import_kinds),
        click.option(
            "--kind",
            type=click.Choice([row.kind for row in importers]),
            help="The kind of log; default: the first word, or what the ending of FILE shows.",
        ),
        click.option("--list", "show_list", is_flag=True, help="Say what FILE holds, and write nothing."),
        click.option("--out", metavar="DATASET", help="The folder to write."),
        *(_click_option(option, importers) for option in all_options(importers)),
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


def _click_option(option: Option, importers: Sequence[Importer]) -> Any:
    kinds = kinds_with(option, importers)
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


def _show(made: Imported, as_json: bool) -> None:
    if as_json:
        told = {"runs": made.runs, "wiring": made.wiring, "mend": made.mend, "notes": made.notes}
        click.echo(json.dumps({"dataset": str(made.folder), **told}))
        return
    for line in wiring_lines(made.wiring, made.mend):
        click.echo(line)
    for note in made.notes:
        click.echo(f"note: {note}")
    click.echo(f"{made.folder}: {len(made.runs)} run{'s' if len(made.runs) != 1 else ''}")


def _show_list(importer: Importer, files: Sequence[Path], as_json: bool) -> None:
    """Prints the channels of each file."""
    found = {file: importer.contents(file) for file in files}
    if as_json:
        rows = [{"file": str(file), "kind": importer.kind, **asdict(one)} for file, one in found.items()]
        click.echo(json.dumps({"files": rows}))
        return
    for file, one in found.items():
        click.echo(f"{file}: {importer.kind}, {len(one.channels)} channels")
        click.echo(_table([_HEADER, *map(_cells, one.channels)]))
        for note in (*one.notes, *(["it ends inside a record; --cut imports what is before it"] if one.cut else [])):
            click.echo(f"note: {note}")


_HEADER = ("channel", "type", "unit", "samples", "rate Hz", "first s", "last s", "lowest", "highest")


def _cells(one: Listed) -> tuple[str, ...]:
    numbers = (one.rate, one.first, one.last, one.lowest, one.highest)
    return one.name, one.type, one.unit or "-", str(one.samples), *("-" if x is None else f"{x:.6g}" for x in numbers)


def _table(rows: Sequence[Sequence[str]]) -> str:
    """Returns rows of words in columns: words to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(wide) if place < 3 else cell.rjust(wide)
            for place, (cell, wide) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )


import_log = import_command(IMPORTERS)
