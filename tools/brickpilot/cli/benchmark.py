"""`brickpilot benchmark`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import as_json, progress_shown


@click.group()
def benchmark() -> None:
    """Measures how well discovery does, on data of known truth, beside its peer."""


@benchmark.command("discover")
@click.option(
    "--suite",
    type=click.Choice(["single", "pairs", "triples", "none", "odd", "ci", "all"]),
    default="all",
    show_default=True,
    help="Which sets of tests/hidden; all: without ci.",
)
@click.option(
    "--engine",
    type=click.Choice(["mujoco", "planar", "both"]),
    default="mujoco",
    show_default=True,
    help="Whose physics.",
)
@click.option("--only", multiple=True, metavar="PATTERN", help="These names alone (shell pattern); repeatable.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="The first N sets of each suite and engine.")
@click.option(
    "--seed-offset",
    type=click.IntRange(0),
    default=1_000_000,
    show_default=True,
    help="0 is for setting thresholds, the default for what is reported.",
)
@click.option("--data", metavar="DIR", help="Judge the sets that stand here, their truths beside them; make none.")
@click.option("--jobs", type=click.IntRange(1, 256), default=2, show_default=True, help="Fits at the same time.")
@click.option(
    "--out",
    metavar="DIR",
    default="runs/benchmark-discover",
    show_default=True,
    help="Where results.jsonl is, or goes.",
)
@click.option(
    "--peer",
    type=click.Choice(["sindy", "sindy-grid"]),
    help="PySINDy on the same sets; -grid: at all settings, for tune-peer.",
)
@click.option("--table", "table_alone", is_flag=True, help="Judge nothing; print the table of what is there.")
@as_json
def benchmark_discover(
    suite: str, engine: str, only: tuple[str, ...], limit: int | None, seed_offset: int, data: str | None, jobs: int,
    out: str, peer: Any, table_alone: bool, as_json: bool,
) -> None:  # fmt: skip
    """Runs discovery on sets with hidden effects, with several, with none and with what no library names.

    tests/hidden makes the sets; they are judged one by one and thrown away. Each leaves a line in results.jsonl: a
    rerun goes on where the last one stopped. The table is computed from those lines.
    """
    from brickpilot.benchmark import blind_test, sets, table, table_text

    folder = Path(out)
    if table_alone:
        results = blind_test.load(folder / blind_test.RESULTS)
    else:
        if data is not None:
            maker = sets.Maker.near(Path.cwd())
            tasks = sets.standing(Path(data), only, limit)
        else:
            maker = sets.Maker.find(Path.cwd())
            tasks = sets.planned(maker, suite, engine, seed_offset, only, limit)
        with progress_shown(as_json) as progress:
            results = blind_test.run(tasks, folder, maker=maker, jobs=jobs, peer=peer, progress=progress)
    found = table.table(results)
    if as_json:
        click.echo(json.dumps(found))
        return
    for line in table_text.lines(found):
        click.echo(line)


@benchmark.command("tune-peer")
@click.argument("results", metavar="RESULTS.jsonl")
@as_json
def benchmark_tune_peer(results: str, as_json: bool) -> None:
    """Tunes PySINDy's window and gates on a benchmark of calibration seeds that was run with --peer sindy-grid."""
    from brickpilot.benchmark import blind_test, sindy_tune

    found = sindy_tune.tune(blind_test.load(Path(results)))
    if as_json:
        click.echo(json.dumps(sindy_tune.to_json(found)))
        return
    for line in sindy_tune.lines(found):
        click.echo(line)
