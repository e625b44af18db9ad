"""`brickpilot compare`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, progress_shown, seed_option


@click.command()
@click.argument("dataset")
@click.option(
    "--model", "model_file", metavar="MODEL.toml", help="Simulate this model; default: the data set's nominal values."
)
@click.option(
    "--window",
    "window_s",
    type=float,
    metavar="S",
    help="Length of a motor's open-loop windows in seconds, at least 10 samples; default 1; 0: no windows.",
)
@seed_option
@click.option("--out", metavar="DIR", help="The folder to write; default runs/compare-NAME.")
@as_json
def compare(
    dataset: str, model_file: str | None, window_s: float | None, seed: int, out: str | None, as_json: bool
) -> None:
    """Simulates every run of the measured DATASET from its own inputs and shows the error.

    Parameters that neither the data set nor MODEL.toml gives are fitted to the fit runs first, and are listed.
    """
    from brickpilot.data import dataset as dataset_module
    from brickpilot.fit import compare as compare_module
    from brickpilot.report import compare_page, run_folder
    from brickpilot.report.quantities import error_percent
    from brickpilot.vehicle import model

    data = dataset_module.read(Path(dataset))
    given = model.load(Path(model_file)) if model_file else None
    folder = Path(out) if out else Path("runs") / f"compare-{data.name}"
    with run_folder.fresh_folder(folder, {"compare.json", "report.html"}) as beside:
        with progress_shown(as_json) as progress:
            found = compare_module.compare(data, given, window_s=window_s, seed=seed, progress=progress)
        figures = found.to_json()
        (beside / "compare.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(compare_page.compare_page(found), encoding="utf-8")
    if as_json:
        click.echo(json.dumps(figures))
        return
    for note in found.notes:
        click.echo(f"note: {note}")
    click.echo(f"{'run':24}{'role':10}{'signal':34}{'rms error':>12}{'of signal':>12}")
    for run in found.runs:
        windows = {f"{name}, {found.window_s:g} s windows": error for name, error in run.windows.items()}
        for name, error in {**run.signals, **windows}.items():
            size = "-" if error.rms_error is None else f"{error.rms_error:.4g}"
            click.echo(f"{run.name:24}{run.role:10}{name:34}{size:>12}{error_percent(error.share):>12}")
    click.echo(f"report: {folder / 'report.html'}")
