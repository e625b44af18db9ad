"""`brickpilot campaign`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import JOBS, SEEDS, as_json, progress_shown, show
from brickpilot.errors import WorkFailedError


@click.command()
@click.argument("file")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/campaign-NAME.")
@click.option("--jobs", type=JOBS, default=2, show_default=True, help="The processes of this machine that fly.")
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Fly on this Dask scheduler's workers, not here.")
@click.option(
    "--runs",
    type=click.IntRange(1),
    help="The number of runs, instead of the file's; for grid of repeats, saltelli of samples, morris of trajectories.",
)
@click.option("--seed", type=SEEDS, help="The seed of all draws, instead of the file's.")
@click.option(
    "--replay", type=int, metavar="RUN", help="Fly this run alone again and write its run folder, as run does."
)
@as_json
def campaign(
    file: str, out: str | None, runs: int | None, seed: int | None, replay: int | None, as_json: bool, **where: Any
) -> None:
    """Flies many missions, drawn at random or by a design, and shows how many succeed and which inputs matter.

    FILE names the inputs that differ between runs: parameters, effects, sensor noise, faults of the link, gains,
    routes. The folder holds runs.parquet with a row for each run, summary.json and report.html. The same command
    resumes a stopped campaign; the same seed gives the same bytes with any number of workers.
    """
    if replay is not None:
        _replay(file, replay, out, runs, seed, as_json)
        return
    from brickpilot.public import making

    with progress_shown(as_json) as progress:
        made = making.campaign(file, out, runs=runs, seed=seed, progress=progress, **where)
    show(made.figures, _lines(made.figures, made.folder), as_json=as_json)


def _lines(figures: Mapping[str, Any], folder: Path) -> Iterator[str]:
    from brickpilot.report import campaign_page

    yield campaign_page.verdict(figures)
    for cause, count in figures["causes"].items():
        yield f"{count:8} {cause}"
    sensitivity = figures["sensitivity"]
    for figure, indices in ({} if sensitivity is None else sensitivity["figures"]).items():
        strongest = ", ".join(f"{row['input']} {row.get('total', row['index']):.2f}" for row in indices[:3])
        if strongest:
            yield f"{campaign_page.WORDS[figure]} depends on: {strongest}"
    yield f"report: {folder / 'report.html'}"


def _replay(file: str, index: int, out: str | None, runs: int | None, seed: int | None, as_json: bool) -> None:
    from brickpilot.campaign import file as campaign_file
    from brickpilot.campaign.run_campaign import replay
    from brickpilot.discover.prepare import SD_SHARE
    from brickpilot.public.doors import command_line
    from brickpilot.report import run_folder, run_page

    given = campaign_file.load(Path(file), count=runs, seed=seed, shares=SD_SHARE)
    flown = replay(given, index)
    folder = Path(out) if out else Path("runs") / f"{given.name}-run-{index}"
    figures = flown.figures | {"campaign": given.name, "run": index, "inputs": flown.inputs}
    link = None if flown.ticks is None else run_page.link_figures(flown.ticks, realtime=False)
    command = command_line("campaign", file, runs=runs, seed=seed, replay=index)
    page = run_page.page(flown.flight, figures, command, link)
    run_folder.write(flown.flight, figures, page, folder, flown.ticks)
    inputs = {name: value for name, value in flown.inputs.items() if value is not None}
    lines = [f"{name:40} {x if isinstance(x, str | bool) else f'{x:.6g}'}" for name, x in inputs.items()]
    lines += [f"motor stream {figures['motor_stream_sha256']}", f"report: {folder / 'report.html'}"]
    show(figures, lines, as_json=as_json)
    if figures["failure"] is not None:
        raise WorkFailedError(f"run {index} of {given.name}: {figures['failure']}")
