"""`brickpilot changed`: what is different in later recordings of a machine."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, jobs_option, progress_shown, seed_option


@click.command()
@click.argument("before")
@click.argument("after", nargs=-1, required=True, metavar="AFTER...")
@click.option(
    "--vehicle", type=click.Choice(["diff_drive", "motor", "skid_steer"]),
    help="Of logs; default: guessed from a table.",
)  # fmt: skip
@click.option("--frame", type=click.Choice(["FLU", "FRD"]), help="Of logs; default: guessed from a table, else FRD.")
@click.option("--map", "mapping", multiple=True, metavar="SIGNAL=FORMULA[:UNIT]", help="As in import; repeatable.")
@click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable.")
@click.option("--as-wired", is_flag=True, help="Keep channels that look wired wrongly: notes name them.")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/changed-NAME.")
@seed_option
@jobs_option
@as_json
def changed(
    before: str, after: tuple[str, ...], vehicle: str | None, frame: str | None, mapping: tuple[str, ...],
    nominal: tuple[str, ...], as_wired: bool, out: str | None, seed: int, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Says what is different in later recordings of one machine, by how much, how sure that is and since when.

    BEFORE and AFTER are data sets, or logs that import reads; BEFORE may be a model.toml. The page changed.html shows
    how well the model of BEFORE follows each later recording, what changed and what each recording tells alone.
    """
    from brickpilot.importers.mapping import parse_nominal
    from brickpilot.public import logs as public
    from brickpilot.report import changed_page

    folder = Path(out) if out else Path("runs") / f"changed-{Path(after[-1]).stem}"
    words = [*(["--vehicle", vehicle] if vehicle else []), *(["--frame", frame] if frame else [])]
    for flag, values in (("--map", mapping), ("--nominal", nominal)):
        words += [word for value in values for word in (flag, value)]
    words += [*(["--as-wired"] if as_wired else []), "--seed", str(seed)]
    with progress_shown(as_json) as progress:
        found = public.changed(
            before, *after, vehicle=vehicle, frame=frame, mapping=mapping, nominal=parse_nominal(nominal),
            as_wired=as_wired, out=folder, seed=seed, jobs=jobs, progress=progress,
            command=shlex.join(["brickpilot", "changed", before, *after, *words]),
        )  # fmt: skip
    if as_json:
        click.echo(json.dumps(found.to_dict(), allow_nan=False))
        return
    for line in changed_page.lines(found):
        click.echo(line)
    click.echo(f"page: {folder / 'changed.html'}")
