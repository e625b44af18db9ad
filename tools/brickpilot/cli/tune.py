"""`brickpilot tune`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import JOBS, as_json, model_option, progress_shown, scenario_option, seed_option, show

if TYPE_CHECKING:
    from brickpilot.tune.tuner import Tuned


@click.command(short_help="Tunes gains for all robots that the data allow.")
@model_option("The robot: a model.toml. calibrate.json or verdict.json beside it gives the spread of its values.")
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
@scenario_option("The mission; default the paper's eight waypoints, scaled to the robot.")
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
@click.option("--jobs", type=JOBS, default=2, show_default=True, help="Processes of this machine.")
@click.option("--scheduler", metavar="ADDRESS", help="Fly on the Dask cluster at tcp://HOST:PORT.")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/tune-NAME.")
@as_json
def tune(as_json: bool, **options: Any) -> None:
    """Tunes the gains of PIDs and guidance for a robot whose values are not known exactly.

    The search starts from the gains that `brickpilot firmware` gives the robot. CMA-ES flies robots whose values are
    drawn from what the data allow, and minimises the mean over these robots of

    \b
      100 (waypoints missed, share) + cross-track rms / radius
        + time / (2 start's time) + wear / (10 start's wear)

    with gains that are rounded to the firmware's integers. Fresh robots judge the result: if the new gains are not
    better beyond chance, the old gains are kept. Writes gains.toml for `run`, `hil` and `firmware --gains`,
    mission.toml, summary.json and report.html. The firmware's sources are those of a checkout in this folder or above
    it, or else the package's.
    """
    from brickpilot.public import making

    with progress_shown(as_json) as progress:
        made, tuned = making.tune(**options, progress=progress)
    show(made.figures, _lines(tuned, made.folder), as_json=as_json)


def _lines(tuned: Tuned, folder: Path) -> Iterator[str]:
    from brickpilot.tune import page
    from brickpilot.vehicle.settings import settings

    judged = tuned.judged
    yield page.sentence(tuned)
    yield f"only after {judged.gained}, only before {judged.lost}, p {judged.p:.2g}"
    for change in judged.changes:
        before, after, difference, interval = page.change(change)
        yield f"{change.name:16}{before:>10} -> {after:>8} {change.unit:12} {difference} ({interval})"
    for name in tuned.space.names:
        row, old, new = settings()[name], tuned.problem.start[name], tuned.found[name]
        yield f"{name:16}{row.value(old):10.4g} -> {row.value(new):8.4g} {row.format.unit:12} raw {old} -> {new}"
    yield f"gains: {folder / 'gains.toml'}\nmission: {folder / 'mission.toml'}\nreport: {folder / 'report.html'}"
