"""`brickpilot changed`: what is different in later recordings of a machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import log_options, progress_shown, search_options, show


@click.command()
@click.argument("before")
@click.argument("after", nargs=-1, required=True, metavar="AFTER...")
@log_options
@click.option("--out", metavar="DIR", help="The folder to write; default runs/changed-NAME.")
@search_options
def changed(
    before: str, after: tuple[str, ...], out: str | None, seed: int, jobs: int, as_json: bool, **how: Any
) -> None:
    """Says what is different in later recordings of one machine, by how much, how sure that is and since when.

    BEFORE and AFTER are data sets, or logs that import reads; BEFORE may be a model.toml. The page changed.html shows
    how well the model of BEFORE follows each later recording, what changed, and what each recording alone shows.
    """
    from brickpilot.importers.mapping import parse_nominal
    from brickpilot.public import logs as public
    from brickpilot.public.doors import command_line
    from brickpilot.report import changed_page

    folder = Path(out) if out else Path("runs") / f"changed-{Path(after[-1]).stem}"
    command = command_line("changed", before, *after, **how, seed=seed)
    how["nominal"] = parse_nominal(how["nominal"])
    with progress_shown(as_json) as progress:
        found = public.changed(
            before, *after, **how, out=folder, seed=seed, jobs=jobs, progress=progress, command=command
        )
    show(found.to_dict(), [*changed_page.lines(found), f"page: {folder / 'changed.html'}"], as_json=as_json)
