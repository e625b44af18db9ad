"""`brickpilot tune`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.completion import model_files, scenario_names
from brickpilot.cli.terminal import as_json, progress_shown, seed_option
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.tune.robot import Ready
    from brickpilot.tune.search import Budget
    from brickpilot.tune.tune import Tuned

FILES = ("gains.toml", "mission.toml", "report.html", "summary.json", "model.toml", "calibrate.json")


@click.command(short_help="Tunes gains for all robots that the data allow.")
@click.option(
    "--model",
    "model_file",
    metavar="FILE",
    shell_complete=model_files,
    help="The robot: a model.toml. calibrate.json or verdict.json beside it says how far its values are known.",
)
@click.option("--dataset", metavar="DIR", help="Calibrate this data set first, and tune what it allows.")
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
    """Tunes the gains of PIDs and guidance for a robot whose values are known only so far.

    The start is what `brickpilot firmware` gives the robot today. CMA-ES flies drawn robots, each as the data allow
    it, and lowers the mean over robots of

    \b
      100 (waypoints missed, share) + cross-track rms / radius
        + time / (2 start's time) + wear / (10 start's wear)

    as the raw integers that fly. Fresh robots judge it: if the gains found are not better beyond chance, those of the
    start are kept. Writes gains.toml for `run`, `hil` and `firmware --gains`, mission.toml, summary.json and
    report.html. A board needs a checkout of the project in this folder or above it.
    """
    from brickpilot.campaign import workers
    from brickpilot.report import run_folder
    from brickpilot.tune import tune as tuning

    if (model_file is None) == (dataset is None):
        raise InputError("needs a robot: --model FILE or --dataset DIR, one of them", field="tune")
    spent, where = _budget(budget), workers.chosen(jobs, scheduler)
    asked = _words(model_file, dataset, board, sensors, scenario)
    asked += ["--robots", str(robots), "--judges", str(judges), "--budget", budget, "--seed", str(seed)]
    folder = Path(out) if out else Path("runs") / f"tune-{Path(model_file or dataset or '').stem}"
    with run_folder.fresh_folder(folder, FILES) as beside, progress_shown(as_json) as progress:
        file = Path(model_file) if model_file is not None else _calibrated(Path(str(dataset)), beside, seed, progress)
        ready = _ready(file, board, sensors, scenario, seed)
        total = tuning.SCALE_ROBOTS + 2 * judges + (spent.sets or 0) * robots
        said = {"scale": "flying the start", "search": "searching", "judge": "judging"}
        tuned = tuning.tune(
            ready.problem, ready.firmware, where, robots=robots, judges=judges, budget=spent,
            show=lambda stage, count: progress(min(count, total), total, said[stage]),
        )  # fmt: skip
        figures = _write(tuned, shlex.join(asked), beside)
    if as_json:
        click.echo(json.dumps(figures))
    else:
        _show(tuned, folder)


def _ready(file: Path, board: str, sensors: str, scenario: str | None, seed: int) -> Ready:
    from brickpilot.discover.prepare import SD_SHARE
    from brickpilot.tune import robot

    return robot.problem(file, board, sensors, scenario, SD_SHARE, seed)


def _budget(text: str) -> Budget:
    """Reads `--budget`."""
    from brickpilot.tune.search import Budget

    try:
        amount = float(text.removesuffix("s"))
    except ValueError:
        amount = -1.0
    if not 1 <= amount <= 1e6 or (not text.endswith("s") and amount != int(amount)):
        raise InputError("needs a number of gain sets, as 200, or of seconds, as 90s", field=f"--budget {text}")
    return Budget(None, amount) if text.endswith("s") else Budget(int(amount), None)


def _words(model: str | None, dataset: str | None, board: str, sensors: str, scenario: str | None) -> list[str]:
    words = ["brickpilot", "tune"] + (["--model", model] if model else ["--dataset", str(dataset)])
    words += ["--board", board, "--sensors", sensors]
    return words + (["--scenario", scenario] if scenario else [])


def _calibrated(folder: Path, beside: Path, seed: int, progress: Any) -> Path:
    """Calibrates a data set into `beside`, and returns its model file."""
    from brickpilot.data import dataset
    from brickpilot.fit import calibrate
    from brickpilot.vehicle import model

    found = calibrate.calibrate(dataset.read(folder), seed=seed, progress=progress)
    (beside / "calibrate.json").write_text(json.dumps(found.to_json(), indent=2) + "\n", encoding="utf-8")
    model.save(found.model, beside / "model.toml")
    return beside / "model.toml"


def _write(tuned: Tuned, command: str, folder: Path) -> dict[str, Any]:
    """Writes the gain set, the mission, the figures and the page; returns the figures."""
    from brickpilot.tune import page
    from brickpilot.tune import tune as tuning
    from brickpilot.vehicle import scenario
    from brickpilot.vehicle.gains import Gains

    plan = tuned.problem.plan
    Gains(plan.model.name, dict(tuned.gains)).save(folder / "gains.toml")
    (folder / "mission.toml").write_text(scenario.render_mission(plan.scenario), encoding="utf-8")
    figures = tuning.to_json(tuned)
    (folder / "summary.json").write_text(json.dumps(figures, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    (folder / "report.html").write_text(page.page(tuned, command), encoding="utf-8")
    return figures


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
