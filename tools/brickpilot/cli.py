"""The command line; some of its commands stand in cli_NAME.py, and these files alone print.

Exit status 0 done, 1 the work failed, 2 bad usage or bad input.
"""

from __future__ import annotations

import dataclasses
import json
import shlex
import sys
from pathlib import Path
from typing import Any

import click
from click.exceptions import NoArgsIsHelpError

from brickpilot import __version__, cli_bench, cli_benchmark, cli_flash, cli_hil, cli_upload
from brickpilot.errors import InputError, SimulationError
from brickpilot.signals import Frame, Vehicle
from brickpilot.terminal import as_json, flight_options, progress_shown


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="brickpilot")
def cli() -> None:
    """Fly, compare and calibrate a LEGO-RCX-class differential-drive robot."""


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"


@cli.command()
@flight_options
@click.option("--out", metavar="DIR", help="The run folder; default runs/SCENARIO-PROFILE-SENSORS.")
@as_json
def run(
    scenario_name: str | None,
    scenario_file: str | None,
    profile: str | None,
    sensors: str | None,
    model_file: str | None,
    compensation_file: str | None,
    seed: int | None,
    out: str | None,
    as_json: bool,
) -> None:
    """Flies SCENARIO (a file, or one of: mission, fig4, fig5, forward_1m, spin_one_motor) in software-in-the-loop.

    Without SCENARIO the paper's eight waypoints are flown. The run folder holds log.csv, summary.json and report.html.
    """
    from brickpilot import compensation, flight, model, run_folder, run_report, scenario

    if scenario_name is not None and scenario_file is not None:
        raise InputError("a scenario is given twice, as argument and as option", field="--scenario")
    asked = scenario_file if scenario_name is None else scenario_name
    asked = "mission" if asked is None else asked
    chosen = scenario.load(scenario.find(asked))
    vehicle = model.load(Path(model_file)) if model_file else model.rcx()
    told = compensation.load(Path(compensation_file)) if compensation_file else None
    plan = flight.plan(chosen, vehicle, profile=profile, sensors=sensors, seed=seed, compensation=told)
    command = [
        "brickpilot",
        "run",
        asked,
        "--profile",
        plan.controller,
        "--sensors",
        plan.sensors,
        "--seed",
        str(plan.seed),
    ]
    command += ["--model", model_file] if model_file else []
    command += ["--compensation", compensation_file] if compensation_file else []
    if chosen.faults:
        raise InputError("act on a link, and run has none: brickpilot hil flies them", file=asked, field="faults")
    folder = Path(out) if out else Path("runs") / f"{chosen.name}-{plan.controller}-{plan.sensors}"
    flown = flight.fly(plan)
    figures = flight.summary(flown)
    run_folder.write(flown, figures, run_report.page(flown, figures, shlex.join(command)), folder)
    if as_json:
        click.echo(json.dumps(figures))
    elif chosen.kind == "mission":
        for number, (moment, closest) in enumerate(
            zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True), 1
        ):
            when = "not reached" if moment is None else f"reached at {moment:6.3f} s"
            click.echo(f"waypoint {number}: {when}, closest approach {closest:.3f} m")
        click.echo(
            f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints in order, "
            f"{plan.controller}, {plan.sensors}, "
            f"cross-track error {_metres(figures['cross_track_rms_m'])} rms, "
            f"position known to {_metres(figures['position_estimate_error_m'])} rms, "
            f"{figures['times_real_time']:.0f} times real time"
        )
    else:
        click.echo(
            f"{chosen.title}: {figures['final_speed_m_s']:.3f} m/s, "
            f"{figures['final_yaw_rate_rad_s']:.3f} rad/s at the end"
        )
    if not as_json:
        click.echo(f"report: {folder / 'report.html'}")


@cli.command()
@click.argument("dataset")
@click.option(
    "--model", "model_file", metavar="MODEL.toml", help="Simulate this model; default the data set's nominal values."
)
@click.option(
    "--window",
    "window_s",
    type=float,
    metavar="S",
    help="A motor's open-loop windows: length, 10 samples or more; 0: none; default 1.",
)
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True, help="Of the fit's starts.")
@click.option("--out", metavar="DIR", help="Where the page goes; default runs/compare-NAME.")
@as_json
def compare(
    dataset: str, model_file: str | None, window_s: float | None, seed: int, out: str | None, as_json: bool
) -> None:
    """Simulates every run of the measured DATASET with its own inputs and shows the error.

    What neither the data set nor MODEL.toml gives is fitted on the fit runs first, and named.
    """
    from brickpilot import compare as compare_module
    from brickpilot import dataset as dataset_module
    from brickpilot import model, plot_compare, run_folder

    data = dataset_module.read(Path(dataset))
    given = model.load(Path(model_file)) if model_file else None
    folder = Path(out) if out else Path("runs") / f"compare-{data.name}"
    with run_folder.fresh_folder(folder, {"compare.json", "report.html"}) as beside:
        with progress_shown(as_json) as progress:
            found = compare_module.compare(data, given, window_s=window_s, seed=seed, progress=progress)
        figures = found.to_json()
        (beside / "compare.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(plot_compare.compare_page(found), encoding="utf-8")
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
            click.echo(f"{run.name:24}{run.role:10}{name:34}{size:>12}{plot_compare.per_cent(error.share):>12}")
    click.echo(f"report: {folder / 'report.html'}")


@cli.command()
@click.argument("dataset")
@click.option(
    "--effects",
    "effect_names",
    multiple=True,
    metavar="NAME",
    help="Switch this effect on and fit its size; repeatable.",
)
@click.option(
    "--free", multiple=True, metavar="NAME", help="Fit this parameter although the data set gives it; repeatable."
)
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True, help="Of the random starts.")
@click.option("--out", metavar="DIR", help="Where model.toml and the page go; default runs/calibrate-NAME.")
@as_json
def calibrate(
    dataset: str, effect_names: tuple[str, ...], free: tuple[str, ...], seed: int, out: str | None, as_json: bool
) -> None:
    """Fits the free nominal parameters of DATASET by simulation from the inputs alone.

    Says how sure each is, and which the data cannot tell apart. Writes model.toml, calibrate.json and report.html.
    """
    from brickpilot import calibrate as calibrate_module
    from brickpilot import dataset as dataset_module
    from brickpilot import model, plot_compare, run_folder

    data = dataset_module.read(Path(dataset))
    folder = Path(out) if out else Path("runs") / f"calibrate-{data.name}"
    with run_folder.fresh_folder(folder, {"calibrate.json", "report.html", "model.toml"}) as beside:
        with progress_shown(as_json) as progress:
            found = calibrate_module.calibrate(data, effects=effect_names, free=free, seed=seed, progress=progress)
        figures = found.to_json()
        (beside / "calibrate.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(plot_compare.calibrate_page(found), encoding="utf-8")
        model.save(found.model, beside / "model.toml")
    if as_json:
        click.echo(json.dumps(figures))
        return
    for note in found.notes:
        click.echo(f"note: {note}")
    for name, estimate in found.parameters.items():
        span = (
            "the data do not tell"
            if estimate.ci95 is None or not estimate.identifiable
            else "{:.4g}..{:.4g}".format(*estimate.ci95)
        )
        click.echo(f"{name:32}{estimate.value:12.5g} {estimate.unit:12} {span}")
    for group in found.cannot_tell_apart:
        click.echo(f"only together: {', '.join(group)}")
    click.echo(f"model: {folder / 'model.toml'}\nreport: {folder / 'report.html'}")


@cli.command()
@click.argument("dataset")
@click.option(
    "--model", "model_file", metavar="MODEL.toml", help="Start from this model; default the data set's nominal values."
)
@click.option("--out", metavar="DIR", help="Where everything goes; default runs/discover-NAME.")
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True, help="Of the random starts.")
@click.option("--jobs", type=click.IntRange(1, 256), default=2, show_default=True, help="Fits at the same time.")
@as_json
def discover(dataset: str, model_file: str | None, out: str | None, seed: int, jobs: int, as_json: bool) -> None:
    """Finds where simulation and the measured DATASET disagree, names the missing effect and adds it to the model.

    Says "none", "these, and here is the experiment that tells them apart" or "something with no name, this term" too.
    Writes report.html, verdict.json and model.toml, the C source of a composed term, and compensation.toml where the
    brick can undo what was found.
    """
    from brickpilot import compensation, model, run_folder
    from brickpilot import dataset as dataset_module
    from brickpilot.discover import report, report_text, workflow

    data = dataset_module.read(Path(dataset))
    given = dataclasses.replace(model.load(Path(model_file)), name=model_file) if model_file else None
    folder = Path(out) if out else Path("runs") / f"discover-{data.name}"
    command = ["brickpilot", "discover", dataset, *(["--model", model_file] if model_file else []), "--seed", str(seed)]
    with run_folder.fresh_folder(folder, workflow.files(data)) as beside:
        with progress_shown(as_json) as progress:
            found = workflow.discover(data, given, seed=seed, jobs=jobs, progress=progress)
        figures = found.to_json()
        (beside / "verdict.json").write_text(json.dumps(figures, indent=2) + "\n")
        (beside / "report.html").write_text(report.page(found, shlex.join(command)), encoding="utf-8")
        model.save(found.augmented, beside / "model.toml")
        if found.term is not None:
            (beside / found.term.file_name).write_text(found.term.source, encoding="utf-8")
        undone = compensation.from_model(found.augmented, found.nominal_model) if found.effects else None
        if undone is not None:
            undone.save(beside / "compensation.toml")
    if as_json:
        click.echo(json.dumps(figures))
        return
    for note in found.notes:
        click.echo(f"note: {note}")
    click.echo(report_text.verdict(found))
    for effect in found.effects:
        for name, value in effect.parameters.items():
            span = "the data do not tell" if value.ci95 is None else "{:.4g}..{:.4g}".format(*value.ci95)
            click.echo(f"{effect.name + '.' + name:40}{value.value:12.5g} {value.unit:12} {span}")
    click.echo(f"model: {folder / 'model.toml'}\nreport: {folder / 'report.html'}")


@cli.command("import")
@click.argument("kind", type=click.Choice(["wpilib", "matlab", "table", "rcx"]))
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--out", required=True, metavar="DATASET", help="The new folder.")
@click.option(
    "--map",
    "mapping",
    multiple=True,
    metavar="SIGNAL=NAME[:UNIT]",
    help="Where a signal stands: a MATLAB variable, NAME[INDEX] for a matrix's column, a column's name or its number "
    "from 0. SI unless UNIT says otherwise; repeatable.",
)
@click.option(
    "--vehicle", type=click.Choice(["diff_drive", "motor"]), help="What was measured; matlab and table need it."
)
@click.option(
    "--frame",
    type=click.Choice(["FRD", "FLU"]),
    default="FRD",
    show_default=True,
    help="Of sway and yaw; matlab, table.",
)
@click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable.")
@click.option("--name", help="Of the data set; default the name of the folder.")
@click.option("--delimiter", default=",", show_default=True, help="Between the columns of a table.")
@click.option("--header", is_flag=True, help="The table's first line names its columns.")
@as_json
def import_log(
    kind: str, files: tuple[str, ...], out: str, mapping: tuple[str, ...], vehicle: Vehicle | None, frame: Frame,
    nominal: tuple[str, ...], name: str | None, delimiter: str, header: bool, as_json: bool,
) -> None:  # fmt: skip
    """Turns logs of other tools into a data set: WPILib SysId JSON (old and new), MATLAB files, plain tables.

    brickpilot import wpilib linear.json angular.json --out drivetrain

    brickpilot import matlab DATA.mat --vehicle motor --map time=t --map voltage=vir --map position=qm --out axis

    brickpilot import table log.txt --vehicle motor --map time=0:ms --map duty=1 --map speed=2:rpm --out bench

    And what the program record kept on an RCX, over the tower at a serial port:

    brickpilot import rcx /dev/ttyUSB0 --out bench
    """
    from brickpilot.importers.mapping import parse_nominal
    from brickpilot.importers.matlab import import_matlab
    from brickpilot.importers.rcx import import_rcx
    from brickpilot.importers.table import import_table
    from brickpilot.importers.wpilib import import_wpilib

    paths, known = [Path(file) for file in files], parse_nominal(nominal)
    if kind in ("wpilib", "rcx") and (mapping or vehicle):
        raise InputError(
            "belongs to matlab and table; a WPILib file and a brick say themselves what they hold",
            field="--map or --vehicle",
        )
    if kind == "rcx":
        if len(paths) > 1:
            raise InputError("one serial port, that of the tower", field="FILE")
        with progress_shown(as_json) as progress:
            made = import_rcx(paths[0], Path(out), nominal=known, name=name, progress=progress)
    elif kind == "wpilib":
        made = import_wpilib(paths, Path(out), nominal=known, name=name)
    elif vehicle is None:
        raise InputError(f"is needed to import {kind}", field="--vehicle")
    elif kind == "matlab":
        made = import_matlab(paths, Path(out), mapping, vehicle=vehicle, frame=frame, nominal=known, name=name)
    else:
        made = import_table(
            paths,
            Path(out),
            mapping,
            vehicle=vehicle,
            frame=frame,
            delimiter=delimiter,
            header=header,
            nominal=known,
            name=name,
        )
    if as_json:
        click.echo(json.dumps({"dataset": str(made.folder), "runs": list(made.runs), "notes": list(made.notes)}))
        return
    for note in made.notes:
        click.echo(f"note: {note}")
    click.echo(f"{made.folder}: {len(made.runs)} runs")


@cli.command()
@click.argument("name", required=False)
@as_json
def effects(name: str | None, as_json: bool) -> None:
    """Lists the effects that can be switched on; with NAME, one of them."""
    from brickpilot import plant

    known = {effect.name: effect for effect in plant.effects()}
    if name is not None and name not in known:
        raise InputError(f"no such effect; known: {', '.join(known)}", field=name)
    chosen = list(known.values()) if name is None else [known[name]]
    if as_json:
        click.echo(json.dumps({effect.name: dataclasses.asdict(effect) for effect in chosen}))
        return
    for effect in chosen:
        click.echo(f"{effect.name}  (acts on: {effect.acts_on})\n  {effect.equation}\n  source: {effect.source}")
        for parameter in effect.parameters:
            span = f"{parameter.minimum:g}..{parameter.maximum:g} {parameter.unit}"
            click.echo(f"  {parameter.name}: {parameter.meaning}; {span}, preset {parameter.preset:g}")


cli.add_command(cli_bench.bench)
cli.add_command(cli_benchmark.benchmark)
cli.add_command(cli_flash.flash)
cli.add_command(cli_hil.hil)
cli.add_command(cli_hil.brick)
cli.add_command(cli_upload.upload)


def main(arguments: list[str] | None = None) -> Any:
    """Entry point; turns every user's error into one line on stderr and status 2."""
    try:
        cli.main(arguments, prog_name="brickpilot", standalone_mode=False)
    except InputError as error:
        click.echo(f"brickpilot: {error}", err=True)
        sys.exit(2)
    except NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "brickpilot"
        click.echo(f"{command}: {' '.join(error.format_message().split())} (see {command} --help)", err=True)
        sys.exit(2)
    except (click.Abort, KeyboardInterrupt):
        click.echo("brickpilot: interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # whoever read stdout has gone; nothing is left to say
        sys.exit(1)
    except (SimulationError, OSError) as error:
        click.echo(f"brickpilot: {' '.join(str(error).split())}", err=True)
        sys.exit(1)
