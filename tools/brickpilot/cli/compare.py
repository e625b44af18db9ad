"""`brickpilot compare`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import as_json, progress_shown, seed_option, show

if TYPE_CHECKING:
    from brickpilot.fit.comparison import Comparison


@click.command()
@click.argument("dataset")
@click.option(
    "--model", "model_file", metavar="MODEL.toml", help="Simulate this model; default: the data set's nominal values."
)
@click.option(
    "--window", "window_s", type=float, metavar="S",
    help="Length of a motor's open-loop windows in seconds, at least 10 samples; default 1; 0: no windows.",
)  # fmt: skip
@seed_option
@click.option("--out", metavar="DIR", help="The folder to write; default runs/compare-NAME.")
@as_json
def compare(
    dataset: str, model_file: str | None, window_s: float | None, seed: int, out: str | None, as_json: bool
) -> None:
    """Simulates every run of the measured DATASET from its own inputs and shows how much of it the model explains.

    Parameters that neither the data set nor MODEL.toml gives are fitted to the fit runs first, and are listed.
    """
    from brickpilot.data import reading
    from brickpilot.fit import comparison
    from brickpilot.report import fit_pages, run_folder
    from brickpilot.vehicle import model

    data = reading.read(Path(dataset))
    given = model.load(Path(model_file)) if model_file else None
    folder = Path(out) if out else Path("runs") / f"compare-{data.name}"
    with run_folder.fresh_folder(folder, {"compare.json", "report.html"}) as beside:
        with progress_shown(as_json) as progress:
            found = comparison.compare(data, given, window_s=window_s, seed=seed, progress=progress)
        figures = found.to_json()
        (beside / "compare.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(fit_pages.compare_page(found), encoding="utf-8")
    show(figures, [*_lines(found), f"report: {folder / 'report.html'}"], as_json=as_json)


def _lines(found: Comparison) -> Iterator[str]:
    from brickpilot.report import headline_text
    from brickpilot.report.quantities import ascii_text, fit_number

    yield from (f"note: {note}" for note in found.notes)
    yield from headline_text.lines(found.headline, found.units)
    yield f"{'run':25}{'role':10}{'signal':34}{'rms error':>18}{'fit %':>12}"
    for run in found.runs:
        spans = {name: ("free_run", name) for name in found.headline.signals}
        spans |= {f"{name}, {found.window_s:g} s windows": (found.horizon, name) for name in run.windows}
        for label, (horizon, name) in spans.items():
            numbers = found.headline.of_run(run.name, name, horizon)
            error, fit = headline_text.error_text(numbers, found.units[name]), fit_number(numbers.fit_percent)
            yield f"{run.name:24} {run.role:10}{label:34}{ascii_text(error):>18}{ascii_text(fit):>12}"
