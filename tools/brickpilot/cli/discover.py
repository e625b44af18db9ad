"""`brickpilot discover` and `brickpilot check`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import budget_option, interval, progress_shown, search_options, show, wiring_lines

if TYPE_CHECKING:
    from brickpilot.discover.finding import Finding


@click.command()
@click.argument("dataset")
@click.option(
    "--model", "model_file", metavar="MODEL.toml", help="Start from this model; default: the data set's nominal values."
)
@click.option("--out", metavar="DIR", help="The folder to write; default runs/discover-NAME.")
@budget_option("Give the best answer so far after this time, and list what was left out.")
@click.option(
    "--predictor", metavar="FILE",
    help="Also write the model that predicts best. Its parts are no claim; model.toml holds the verdict's effects.",
)  # fmt: skip
@search_options
def discover(
    dataset: str, model_file: str | None, out: str | None, budget: float | None, predictor: str | None, seed: int,
    jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Finds where the simulation differs from the measured DATASET, names the missing effect and adds it to the model.

    The verdict is "named", "none", "ambiguous" (no explanation is surely the best, and an experiment that separates
    the explanations is proposed) or "unknown" (no effect of the library fits, and a term is composed). Writes
    report.html, verdict.json and model.toml. If they exist, it also writes the C source of a composed term, the
    compensation.toml for the packaged firmware on this robot, and the experiment as next_experiment.toml, .csv and .h.
    """
    from brickpilot.data import reading
    from brickpilot.discover import conclude, pipeline
    from brickpilot.discover.finding import verdict_json
    from brickpilot.public.doors import command_line
    from brickpilot.report import discover_page, experiment_files, run_folder
    from brickpilot.vehicle import model

    data = reading.read(Path(dataset))
    given = dataclasses.replace(model.load(Path(model_file)), name=model_file) if model_file else None
    folder = Path(out) if out else Path("runs") / f"discover-{data.name}"
    command = command_line("discover", dataset, model=model_file, seed=seed, budget=budget)
    files = {"report.html", "verdict.json", "model.toml", "compensation.toml", conclude.composed_file(data)}
    with run_folder.fresh_folder(folder, files | set(experiment_files.FILES)) as beside:
        with progress_shown(as_json) as progress:
            found = pipeline.discover(
                data, given, seed=seed, jobs=jobs, budget_s=budget, predictor=predictor is not None, progress=progress
            )
        asked = found.next_experiment
        undone = discover_page.write(found, beside, command, None if asked is None else asked.manoeuvre)
    if predictor is not None and found.predictor is not None:
        model.save(found.predictor.model, Path(predictor))
    lines = [*_lines(found), *(f"not compensated: {remark}" for remark in (undone.remarks if undone else ()))]
    lines += [f"predictor: {predictor}"] if predictor is not None else []
    lines += [f"model: {folder / 'model.toml'}", f"report: {folder / 'report.html'}"]
    lines += [f"compensation: {folder / 'compensation.toml'}"] if undone is not None else []
    show(verdict_json(found), lines, as_json=as_json)


def _lines(found: Finding) -> Iterator[str]:
    from brickpilot.report import discover_fit, discover_text
    from brickpilot.report.user_terms import frames, shown_finding, told

    yield from (f"note: {note}" for note in told(found.dataset, found.notes))
    yield discover_text.verdict(found)
    for effect in shown_finding(found).effects:
        for name, value in effect.parameters.items():
            label, known = discover_text.known_size(name, value)
            yield f"{effect.name + '.' + label:40}{known.value:12.5g} {known.unit:12} {interval(known.ci95)}"
    yield from (*discover_text.explanation_lines(found), *discover_fit.lines(found))
    if sentence := frames(found.dataset):
        yield sentence


@click.command()
@click.argument("dataset")
@search_options
def check(dataset: str, seed: int, jobs: int, as_json: bool) -> None:
    """Shows within seconds what a measured DATASET can tell.

    It shows timing, noise and damage; what the runs tell about each nominal value; which effects the runs would show,
    from which size on; which manoeuvres would tell more; and how long discover will take. It writes nothing.
    """
    from brickpilot.data import reading
    from brickpilot.readiness import data_check
    from brickpilot.report import check_text

    measured = reading.read(Path(dataset))
    wiring = [fault.sentence for fault in measured.wiring]
    worth = data_check.check(measured, seed=seed, jobs=jobs)
    show({"wiring": wiring, **worth.to_json()}, (*wiring_lines(wiring), *check_text.lines(worth)), as_json=as_json)
