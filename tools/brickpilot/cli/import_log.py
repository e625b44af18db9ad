"""`brickpilot import`: its kinds of log, its help and its options come from the table of importers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import as_json, import_kinds, progress_shown, show, wiring_lines, with_options
from brickpilot.errors import InputError
from brickpilot.importers import IMPORTERS, Importer, Option, all_options, importer_and_files, kinds_with

if TYPE_CHECKING:
    from brickpilot.importers.channels import Listed


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
        options |= {"nominal": parse_nominal(nominal), "name": name, "importers": importers}
        with progress_shown(as_json) if importer.reports_progress else nullcontext() as progress:
            made = import_log(files, out, kind=importer.kind, progress=progress, **options)
        figures = {"runs": made.runs, "wiring": made.wiring, "mend": made.mend, "notes": made.notes}
        lines = [*wiring_lines(made.wiring, made.mend), *(f"note: {note}" for note in made.notes)]
        lines.append(f"{made.folder}: {len(made.runs)} run{'s' if len(made.runs) != 1 else ''}")
        show({"dataset": str(made.folder), **figures}, lines, as_json=as_json)

    options = [
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
    rows = (f"\b\n{row.kind}: {row.help}\n    brickpilot import {row.example}" for row in importers)
    text = "\n\n".join(["Turns logs of other tools into a data set.", *rows])
    return click.command("import", help=text)(with_options(command, options))


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


def _show_list(importer: Importer, files: Sequence[Path], as_json: bool) -> None:
    """Prints the channels of each file."""
    contents = {file: importer.contents(file) for file in files}
    rows = [{"file": str(file), "kind": importer.kind, **asdict(listed)} for file, listed in contents.items()]
    lines = []
    for file, listed in contents.items():
        lines += [f"{file}: {importer.kind}, {len(listed.channels)} channels", *_table(listed.channels)]
        lines += [f"note: {note}" for note in listed.notes]
        lines += ["note: it ends inside a record; --cut imports what is before it"] if listed.cut else []
    show({"files": rows}, lines, as_json=as_json)


_HEADER = ("channel", "type", "unit", "samples", "rate Hz", "first s", "last s", "lowest", "highest")


def _table(channels: Sequence[Listed]) -> Iterator[str]:
    """Yields a table with a row for each channel: words to the left, numbers to the right."""
    rows: list[Sequence[str]] = [_HEADER]
    for row in channels:
        numbers = (row.rate, row.first, row.last, row.lowest, row.highest)
        texts = ("-" if number is None else f"{number:.6g}" for number in numbers)
        rows.append((row.name, row.type, row.unit or "-", str(row.samples), *texts))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells in rows:
        padded = zip(cells, widths, (str.ljust,) * 3 + (str.rjust,) * 6, strict=True)
        yield "  ".join(pad(cell, width) for cell, width, pad in padded)


import_log = import_command(IMPORTERS)
