"""`brickpilot tune`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import as_json, model_files, progress_shown, scenario_names, seed_option

if TYPE_CHECKING:
    from brickpilot.tune.tuner import Tuned


@click.command(short_help="Tunes gains for all robots that the data allow.")
@click.option(
    "--model",
    "model_file",
    metavar="FILE",
    shell_complete=model_files,
    help="The robot: a model.toml. calibrate.json or verdict.json beside it gives the spread of its values.",
)
@click.option("--dataset", metavar="DIR", help="Calibrate this data set first, and tune for the robots that it allows.")
@click.option(
    "--board",
    type=click.Choice(["rcx", "avr", "avr:2560", "packaged"]),
    default="rcx",
    show_default=True,
    help="The robot's own firmware on this board; packaged: the project's firmware with the model's compensation.",
)
@click.option(
    "--sensors", type=click.Choice(["imu", "imu+encoders"]), default="imu", show_default=True, help="The robot's."
)
@click.option(
    "--scenario",
    metavar="FILE",
    shell_complete=scenario_names,
    help="The mission; default the paper's eight waypoints, scaled to the robot.",
)
@click.option("--robots", type=click.IntRange(4, 1000), default=24, show_default=True, help="Robots for a gain set.")
@click.option(
    "--judges",
    type=click.IntRange(20, 100_000),
    default=1000,
    show_default=True,
    help="Fresh robots that fly before and after.",
)
@click.option(
    "--budget", default="200", show_default=True, metavar="N", help="Gain sets to try; with an s, as 90s, seconds."
)
@seed_option
@click.option("--jobs", type=click.IntRange(1, 256), default=2, show_default=True, help="Processes of this machine.")
@click.option("--scheduler", metavar="ADDRESS", help="Fly on the Dask cluster at tcp://HOST:PORT.")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/tune-NAME.")
@as_json
def tune(
    model_file: str | None, dataset: str | None, board: str, sensors: str, scenario: str | None, robots: int,
    judges: int, budget: str, seed: int, jobs: int, scheduler: str | None, out: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Tunes the gains of PIDs and guidance for a robot whose values are not known exactly.

    The start are the gains that `brickpilot firmware` gives the robot. CMA-ES flies drawn robots, each as the data
    allow it, and lowers the mean over robots of

    \b
      100 (waypoints missed, share) + cross-track rms / radius
        + time / (2 start's time) + wear / (10 start's wear)

    as the raw integers that fly. Fresh robots judge the result: if the new gains are not better beyond chance, those of
    the start are kept. Writes gains.toml for `run`, `hil` and `firmware --gains`, mission.toml, summary.json and
    report.html. Sources are those of a checkout in this folder or above it, else the package's.
    """
    from brickpilot.public import making

    with progress_shown(as_json) as progress:
        made, tuned = making.tune(
            model_file, dataset, out, board=board, sensors=sensors, scenario=scenario, robots=robots, judges=judges,
            budget=budget, seed=seed, jobs=jobs, scheduler=scheduler, progress=progress,
        )  # fmt: skip
    if as_json:
        click.echo(json.dumps(made.figures))
    else:
        _show(tuned, made.folder)


def _show(tuned: Tuned, folder: Path) -> None:
    from brickpilot.tune import page
    from brickpilot.vehicle.settings import settings

    judged = tuned.judged
    click.echo(page.sentence(tuned))
    click.echo(f"only after {judged.gained}, only before {judged.lost}, p {judged.p:.2g}")
    for one in judged.changes:
        before, after, difference, interval = page.change(one)
        click.echo(f"{one.name:16}{before:>10} -> {after:>8} {one.unit:12} {difference} ({interval})")
    for name in tuned.space.names:
        how, old, new = settings()[name], tuned.problem.start[name], tuned.found[name]
        click.echo(f"{name:16}{how.value(old):10.4g} -> {how.value(new):8.4g} {how.format.unit:12} raw {old} -> {new}")
    click.echo(f"gains: {folder / 'gains.toml'}\nmission: {folder / 'mission.toml'}\nreport: {folder / 'report.html'}")
