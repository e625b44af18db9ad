"""`brickpilot benchmark`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from brickpilot.benchmark.sets import QUICK, SUITES
from brickpilot.cli.terminal import as_json, jobs_option, progress_shown


@click.group()
def benchmark() -> None:
    """Measures how often discovery is right, on data whose truth is known, beside a peer."""


@benchmark.command("discover")
@click.option(
    "--suite",
    type=click.Choice([*SUITES, "ci", "all", *QUICK, "quick"]),
    default="all",
    show_default=True,
    help="The sets of tests/hidden to run. all: the first five; quick: those from same to scales, of short runs.",
)
@click.option(
    "--engine",
    type=click.Choice(["mujoco", "planar", "both"]),
    default="mujoco",
    show_default=True,
    help="The physics engine that simulates the sets.",
)
@click.option(
    "--only", multiple=True, metavar="PATTERN", help="Run only sets whose name matches this shell pattern; repeatable."
)
@click.option(
    "--limit", type=click.IntRange(1), metavar="N", help="Run only the first N sets of each suite and engine."
)
@click.option(
    "--seed-offset",
    type=click.IntRange(0),
    default=1_000_000,
    show_default=True,
    help="Added to each set's seed. Thresholds were set with 0; results are reported with the default.",
)
@click.option("--data", metavar="DIR", help="Run the sets in this folder, which holds their truths too; make none.")
@jobs_option
@click.option(
    "--out",
    metavar="DIR",
    default="runs/benchmark-discover",
    show_default=True,
    help="The folder of results.jsonl.",
)
@click.option(
    "--peer",
    type=click.Choice(["sindy", "sindy-grid"]),
    help="Run PySINDy on the same sets; sindy-grid runs it at all settings, for tune-peer.",
)
@click.option(
    "--table", "table_alone", is_flag=True, help="Run nothing; print the table of the results that are there."
)
@as_json
def benchmark_discover(
    suite: str, engine: str, only: tuple[str, ...], limit: int | None, seed_offset: int, data: str | None, jobs: int,
    out: str, peer: Any, table_alone: bool, as_json: bool,
) -> None:  # fmt: skip
    """Runs discovery on data sets with one hidden effect, with several, with none, and with an effect of no library.

    The quick suites hide laws that are not the library's, wrong nominal values and robots of other scales. tests/hidden
    makes the sets. Each set is deleted after its run and leaves a line in results.jsonl. A rerun continues where the
    last one stopped. The table is computed from these lines and written beside them, as table.json and table.md.
    """
    from brickpilot.benchmark import blind_test, result, sets, table, table_text

    folder = Path(out)
    if table_alone:
        results = result.load(folder / result.RESULTS)
    else:
        if data is not None:
            maker = sets.Maker.near(Path.cwd())
            tasks = sets.existing(Path(data), only, limit)
        else:
            maker = sets.Maker.find(Path.cwd())
            tasks = sets.planned(maker, suite, engine, seed_offset, only, limit)
        with progress_shown(as_json) as progress:
            results = blind_test.run(tasks, folder, maker=maker, jobs=jobs, peer=peer, progress=progress)
    found = table.table(results)
    table_text.write(found, folder)
    if as_json:
        click.echo(json.dumps(found))
        return
    for line in table_text.lines(found):
        click.echo(line)


@benchmark.command("tune-peer")
@click.argument("results", metavar="RESULTS.jsonl")
@as_json
def benchmark_tune_peer(results: str, as_json: bool) -> None:
    """Tunes PySINDy's window and gates on the results of calibration seeds that were run with --peer sindy-grid."""
    from brickpilot.benchmark import result, sindy_tune

    found = sindy_tune.tune(result.load(Path(results)))
    if as_json:
        click.echo(json.dumps(sindy_tune.to_json(found)))
        return
    for line in sindy_tune.lines(found):
        click.echo(line)
