"""`brickpilot campaign`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.errors import WorkFailedError


@click.command()
@click.argument("file")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/campaign-NAME.")
@click.option(
    "--jobs", type=click.IntRange(1, 256), default=2, show_default=True, help="The processes of this machine that fly."
)
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Fly on the workers of this Dask scheduler instead.")
@click.option(
    "--runs",
    "count",
    type=click.IntRange(1),
    help="How many runs instead of the file's; of grid repeats, of saltelli samples, of morris trajectories.",
)
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), help="The seed of all draws, instead of the file's.")
@click.option(
    "--replay", "index", type=int, metavar="RUN", help="Fly this run alone again and write its run folder, as run does."
)
@as_json
def campaign(
    file: str, out: str | None, jobs: int, scheduler: str | None, count: int | None, seed: int | None,
    index: int | None, as_json: bool,
) -> None:  # fmt: skip
    """Flies many missions, Monte Carlo or a designed sweep, and shows how many succeed and which inputs matter.

    FILE names the inputs that differ between runs: parameters, effects, sensor noise, faults of the link, gains,
    routes. The folder holds runs.parquet with a row for each run, summary.json and report.html. The same command
    resumes a stopped campaign; the same seed gives the same bytes with any number of workers.
    """
    if index is not None:
        _replay(file, index, out, count, seed, as_json)
        return
    from brickpilot.public import making

    with progress_shown(as_json) as show:
        made = making.campaign(file, out, runs=count, seed=seed, jobs=jobs, scheduler=scheduler, progress=show)
    if as_json:
        click.echo(json.dumps(made.figures))
        return
    _print(made.figures)
    click.echo(f"report: {made.folder / 'report.html'}")


def _print(found: Mapping[str, Any]) -> None:
    from brickpilot.report import campaign_page

    click.echo(campaign_page.verdict(found))
    for cause, count in found["causes"].items():
        click.echo(f"{count:8} {cause}")
    sensitivity = found["sensitivity"]
    for figure, indices in ({} if sensitivity is None else sensitivity["figures"]).items():
        strongest = ", ".join(f"{one['input']} {one.get('total', one['index']):.2f}" for one in indices[:3])
        if strongest:
            click.echo(f"{campaign_page.WORDS[figure]} depends on: {strongest}")


def _replay(file: str, index: int, out: str | None, count: int | None, seed: int | None, as_json: bool) -> None:
    from brickpilot.campaign import conduct
    from brickpilot.campaign import file as campaign_file
    from brickpilot.discover.prepare import SD_SHARE
    from brickpilot.public.doors import command_line
    from brickpilot.report import run_folder, run_page

    given = campaign_file.load(Path(file), count=count, seed=seed, shares=SD_SHARE)
    found = conduct.replay(given, index)
    folder = Path(out) if out else Path("runs") / f"{given.name}-run-{index}"
    figures = found.figures | {"campaign": given.name, "run": index, "inputs": found.inputs}
    link = None if found.ticks is None else run_page.link_figures(found.ticks, realtime=False)
    command = command_line("campaign", file, runs=count, seed=seed, replay=index)
    page = run_page.page(found.flight, figures, command, link)
    run_folder.write(found.flight, figures, page, folder, found.ticks)
    if as_json:
        click.echo(json.dumps(figures))
    else:
        for name, value in found.inputs.items():
            if value is None:
                continue
            click.echo(f"{name:40} {value if isinstance(value, str | bool) else f'{value:.6g}'}")
        click.echo(f"motor stream {figures['motor_stream_sha256']}")
        click.echo(f"report: {folder / 'report.html'}")
    if figures["failure"] is not None:
        raise WorkFailedError(f"run {index} of {given.name}: {figures['failure']}")
