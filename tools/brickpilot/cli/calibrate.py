"""`brickpilot calibrate`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, effect_names, interval, progress_shown, seed_option, show


@click.command()
@click.argument("dataset")
@click.option(
    "--effects", multiple=True, metavar="NAME", shell_complete=effect_names,
    help="Switch this effect on and fit its parameters; repeatable.",
)  # fmt: skip
@click.option(
    "--free", multiple=True, metavar="NAME", help="Fit this parameter although the data set gives it; repeatable."
)
@seed_option
@click.option("--out", metavar="DIR", help="The folder to write; default runs/calibrate-NAME.")
@as_json
def calibrate(
    dataset: str, effects: tuple[str, ...], free: tuple[str, ...], seed: int, out: str | None, as_json: bool
) -> None:
    """Fits the free nominal parameters of DATASET by free runs: simulations from the inputs alone.

    Gives each parameter's confidence interval and lists the parameters that the data do not identify. Writes
    model.toml, calibrate.json and report.html.
    """
    from brickpilot.data import reading
    from brickpilot.fit import calibration
    from brickpilot.report import fit_pages, headline_text, run_folder
    from brickpilot.vehicle import model

    data = reading.read(Path(dataset))
    folder = Path(out) if out else Path("runs") / f"calibrate-{data.name}"
    with run_folder.fresh_folder(folder, {"calibrate.json", "report.html", "model.toml"}) as beside:
        with progress_shown(as_json) as progress:
            found = calibration.calibrate(data, effects=effects, free=free, seed=seed, progress=progress)
        figures = found.to_json()
        (beside / "calibrate.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(fit_pages.calibrate_page(found), encoding="utf-8")
        model.save(found.model, beside / "model.toml")
    lines = [f"note: {note}" for note in found.notes]
    for name, estimate in found.parameters.items():
        span = interval(estimate.ci95 if estimate.identifiable else None)
        lines.append(f"{name:32}{estimate.value:12.5g} {estimate.unit:12} {span}")
    lines += [f"identifiable only in combination: {', '.join(group)}" for group in found.cannot_tell_apart]
    lines += headline_text.lines(found.after, found.units)
    lines += [f"model: {folder / 'model.toml'}", f"report: {folder / 'report.html'}"]
    show(figures, lines, as_json=as_json)
