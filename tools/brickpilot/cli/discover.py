"""`brickpilot discover` and `brickpilot check`."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import click

from brickpilot.cli.terminal import budget_option, interval, progress_shown, search_options, show, wiring_lines


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

    The verdict is "named", "none", "ambiguous" (no explanation is surely the best, and an experiment is proposed that
    separates them) or "unknown" (no effect of the library fits, and a term is composed). Writes report.html,
    verdict.json and model.toml; also the C source of a composed term, and compensation.toml, with which the packaged
    firmware flies this robot, and next_experiment.toml, .csv and .h where one separates the effects.
    """
    from brickpilot.data import reading
    from brickpilot.discover import conclude, pipeline
    from brickpilot.discover.finding import verdict_json
    from brickpilot.public.doors import command_line
    from brickpilot.report import composed_law, discover_fit, discover_page, discover_text, experiment_files, run_folder
    from brickpilot.report.user_terms import frames, shown_finding, told
    from brickpilot.vehicle import compensation, model

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
        figures = verdict_json(found)
        (beside / "verdict.json").write_text(json.dumps(figures, indent=2, allow_nan=False) + "\n")
        (beside / "report.html").write_text(discover_page.page(found, command), encoding="utf-8")
        model.save(found.augmented, beside / "model.toml")
        for name, text in (composed_law.of_finding(found) | experiment_files.of_finding(found)).items():
            (beside / name).write_text(text, encoding="utf-8")
        undone = compensation.from_model(found.augmented)
        if undone is not None:
            undone.save(beside / "compensation.toml")
    if predictor is not None and found.predictor is not None:
        model.save(found.predictor.model, Path(predictor))
    if as_json:
        click.echo(json.dumps(figures, allow_nan=False))
        return
    for note in told(data, found.notes):
        click.echo(f"note: {note}")
    click.echo(discover_text.verdict(found))
    for effect in shown_finding(found).effects:
        for name, value in effect.parameters.items():
            label, known = discover_text.known_size(name, value)
            click.echo(f"{effect.name + '.' + label:40}{known.value:12.5g} {known.unit:12} {interval(known.ci95)}")
    for line in (*discover_text.explanation_lines(found), *discover_fit.lines(found)):
        click.echo(line)
    if sentence := frames(data):
        click.echo(sentence)
    for remark in undone.remarks if undone is not None else ():
        click.echo(f"not compensated: {remark}")
    if predictor is not None:
        click.echo(f"predictor: {predictor}")
    click.echo(f"model: {folder / 'model.toml'}\nreport: {folder / 'report.html'}")
    if undone is not None:
        click.echo(f"compensation: {folder / 'compensation.toml'}")


@click.command()
@click.argument("dataset")
@search_options
def check(dataset: str, seed: int, jobs: int, as_json: bool) -> None:
    """Shows within seconds what a measured DATASET can tell.

    It shows timing, noise and damage, what the runs tell about each nominal value, which effects they would show and
    from which size, which manoeuvres would tell more, and how long discover will take. It writes nothing.
    """
    from brickpilot.data import reading
    from brickpilot.readiness import data_check
    from brickpilot.report import check_text

    measured = reading.read(Path(dataset))
    wiring = [fault.sentence for fault in measured.wiring]
    worth = data_check.check(measured, seed=seed, jobs=jobs)
    show({"wiring": wiring, **worth.to_json()}, (*wiring_lines(wiring), *check_text.lines(worth)), as_json=as_json)
