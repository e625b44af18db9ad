"""`sh tests/lab/run`: measures how often discovery is right, from a checkout."""

from __future__ import annotations

import json
import os
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import click
from brickpilot.campaign import workers
from brickpilot.campaign.run_parts import Workers
from brickpilot.cli.main import run_to_exit, whole_lines
from brickpilot.cli.terminal import (
    as_json,
    jobs_option,
    progress_shown,
    seed_option,
)
from brickpilot.errors import InputError
from brickpilot.report import run_folder

from lab import blind_test, changed_sets, page, real_logs, real_results, real_run, real_table, result, sets, table
from lab.sets import QUICK, SUITES

scheduler_option = click.option(
    "--scheduler", metavar="tcp://HOST:PORT", help="Run on the workers of this Dask scheduler, not on this machine."
)

at_a_time_option = click.option(
    "--workers",
    "at_a_time",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    help="The number of data sets at the same time, each with --jobs fits.",
)


@click.group()
def lab() -> None:
    """Measures how often discovery is right: on data whose truth is known, and on real logs, beside peers."""


@lab.command("discover")
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
@at_a_time_option
@scheduler_option
@click.option(
    "--out",
    metavar="DIR",
    default="runs/lab-discover",
    show_default=True,
    help="The folder of results.jsonl.",
)
@click.option(
    "--table", "table_alone", is_flag=True, help="Run nothing; print the table of the results that are there."
)
@click.option("--write", "readme", metavar="FILE.md", help="Write the quick suites' table between its marks.")
@as_json
def lab_discover(
    suite: str, engine: str, only: tuple[str, ...], limit: int | None, seed_offset: int, data: str | None, jobs: int,
    at_a_time: int, scheduler: str | None, out: str, table_alone: bool, readme: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Runs discovery on data sets with one hidden effect, with several, with none, or one that the library lacks.

    The quick suites hide laws that are not the library's, wrong nominal values and robots of other scales. tests/hidden
    makes the sets. Each set is deleted after its run and leaves a line in results.jsonl. A rerun continues where the
    last one stopped. The table is computed from these lines and written beside them, as table.json and table.md, and
    as a page with figures, report.html.
    """
    folder = Path(out)
    if table_alone:
        results = result.load(folder / result.RESULTS)
    else:
        workers = _workers(at_a_time, scheduler)
        maker = sets.Maker()
        if data is not None:
            tasks = sets.existing(Path(data), only, limit)
        else:
            tasks = sets.planned(maker, suite, engine, seed_offset, only, limit)
        with progress_shown(as_json) as progress:
            work = blind_test.Work(maker, jobs)
            results = blind_test.run(tasks, folder, work=work, workers=workers, progress=progress)
    found = table.table(results)
    table.write(found, folder)
    run_folder.write_file(page.hidden_page(page.hidden(results, found)), folder / "report.html")
    if readme is not None:
        real_table.write_between_marks(Path(readme), list(table.markdown(found)), table.MARKS)
    if as_json:
        click.echo(json.dumps(found))
        return
    for line in table.lines(found):
        click.echo(line)


@lab.command("real")
@click.argument("folders", metavar="[FOLDER]...", nargs=-1)
@click.option(
    "--fetched", metavar="DIR", help="Make data sets of the public logs whose repositories are cloned in this folder."
)
@click.option("--out", metavar="DIR", default="runs/lab-real", show_default=True, help="The folder of these data sets.")
@click.option(
    "--only",
    multiple=True,
    metavar="PATTERN",
    help="Run only data sets whose name matches this shell pattern; repeatable.",
)
@click.option(
    "--part",
    type=click.Choice(["all", "discover", "peers", "none"]),
    default="all",
    show_default=True,
    help="What runs; the other results stay as they are.",
)
@click.option("--peer", "peers", multiple=True, metavar="NAME", help="Run only this peer; repeatable.")
@click.option(
    "--budget",
    type=click.FloatRange(0, min_open=True),
    metavar="SECONDS",
    help="Discovery gives its best so far after this time.",
)
@seed_option
@jobs_option
@at_a_time_option
@scheduler_option
@click.option(
    "--results",
    metavar="FILE.json",
    default="runs/lab-real/results.json",
    show_default=True,
    help="The results, read before and written after each data set.",
)
@click.option("--write", "readme", metavar="FILE.md", help="Write the table between its marks in this file.")
@as_json
def lab_real(
    folders: tuple[str, ...], fetched: str | None, out: str, only: tuple[str, ...], part: Any, peers: tuple[str, ...],
    budget: float | None, seed: int, jobs: int, at_a_time: int, scheduler: str | None, results: str, readme: str | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Runs discovery on measured data sets, and beside it well-known libraries on the same runs and inputs.

    FOLDERs hold data sets, at any depth; without one, and without --fetched, BRICKPILOT_DATA names the folder.
    Discovery and the libraries are fitted on the fit runs. The free run gives the score: 100 (1 - rms error / rms of
    the signal). A peer that is not installed is left out: pip install 'brickpilot[peers]'. The table is also written
    as a page with figures, report.html beside the results.
    """
    known = real_logs.by_name()
    kept = real_results.load(Path(results))
    if part != "none":
        work = real_run.Work(
            discover=part in ("all", "discover"),
            peers=real_run.peers_named(peers) if part in ("all", "peers") else (),
            seed=seed,
            jobs=jobs,
            budget_s=budget,
        )
        workers = _workers(at_a_time, scheduler)
        asked = _real_data_sets(folders, fetched, Path(out), only)
        for peer in work.peers:
            if missing := peer.missing():
                click.echo(missing, err=True)
        with progress_shown(as_json) as progress:
            real_run.run(asked, known, work, kept, Path(results), workers=workers, progress=progress)
    if kept:
        html = page.real_page(page.real(kept, known))
        run_folder.write_file(html, Path(results).with_name("report.html"))
    if readme:
        real_table.write_between_marks(Path(readme), list(real_table.lines(kept, known)))
    if as_json:
        click.echo(json.dumps({"logs": list(kept.values())}))
        return
    for line in real_table.lines(kept, known):
        click.echo(line)


@lab.command("changed")
@click.option(
    "--engine", type=click.Choice(["mujoco", "planar"]), default="planar", show_default=True, help="As in discover."
)
@click.option("--size", type=float, default=2.0, show_default=True, help="Of each effect: at 1 it shows clearly.")
@click.option("--nulls", type=click.IntRange(0), default=100, show_default=True, help="Pairs in which nothing differs.")
@click.option("--only", multiple=True, metavar="PATTERN", help="Run only pairs whose name matches; repeatable.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Run only the first N pairs of each kind.")
@click.option("--seed-offset", type=click.IntRange(0), default=1_000_000, show_default=True, help="As in discover.")
@click.option("--data", metavar="DIR", help="Measured data: labelled pairs, and halves of each log.")
@click.option("--out", metavar="DIR", default="runs/lab-changed", show_default=True, help="Recordings and results.")
@click.option("--write", "readme", metavar="FILE.md", help="Write the table between its marks in this file.")
@jobs_option
@as_json
def lab_changed(
    engine: Any, size: float, nulls: int, only: tuple[str, ...], limit: int | None, seed_offset: int, data: str | None,
    out: str, readme: str | None, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Measures how often `changed` is right on two simulated recordings: one effect is new or gone, or nothing differs.

    An interrupted call goes on where it stopped.
    """
    path = Path(out) / "results.jsonl"
    known = {one["name"]: one for one in result.load(path)} if path.exists() else {}
    asked = [one for one in changed_sets.pairs(engine, size, nulls, seed_offset) if _matches(one.name, only)]
    for pair in changed_sets.chosen(asked, limit):
        if pair.name not in known:
            known[pair.name] = changed_sets.ask(pair, Path(out) / "data", jobs)
            result.append(path, known[pair.name])
            click.echo(f"{pair.name}: {known[pair.name]['score']}", err=True)
    if data is not None:
        for one in (*changed_sets.labelled(Path(data), jobs), *changed_sets.halves(Path(data), jobs)):
            known[one["name"]] = one
    found = changed_sets.lines(list(known.values()))
    if readme is not None:
        real_table.write_between_marks(Path(readme), found, (changed_sets.BEGIN, changed_sets.END))
    if as_json:
        click.echo(json.dumps({"pairs": list(known.values())}))
        return
    for line in found:
        click.echo(line)


def _real_data_sets(folders: tuple[str, ...], fetched: str | None, out: Path, only: tuple[str, ...]) -> list[Path]:
    """Returns the folders of the chosen data sets; data sets of public logs are made first.

    Raises:
        InputError: no folder is named, or a named folder holds no data set.
    """
    places = [Path(folder) for folder in folders]
    if fetched:
        logs = [log for log in real_logs.read() if log.repository and _matches(log.name, only)]
        for line in real_logs.describe_missing(logs, Path(fetched)):
            click.echo(line, err=True)
        made = [real_logs.build_once(log, Path(fetched), out / log.name) for log in logs]
        places += [one for one in made if one is not None]
    elif not places:
        if not os.environ.get("BRICKPILOT_DATA"):
            raise InputError("no data: name a folder of data sets, or set BRICKPILOT_DATA to one", field="FOLDER")
        places.append(Path(os.environ["BRICKPILOT_DATA"]))
    return [one for one in real_run.data_sets(places) if _matches(one.name, only)] if places else []


def _workers(at_a_time: int, scheduler: str | None) -> Workers:
    """Returns the workers for the data sets; by default this process, which shows the progress of each set."""
    return workers.Here() if scheduler is None and at_a_time == 1 else workers.chosen(at_a_time, scheduler)


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return not patterns or any(fnmatch(name, pattern) for pattern in patterns)


if __name__ == "__main__":
    run_to_exit(whole_lines(lab), None, "lab")
