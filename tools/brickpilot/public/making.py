"""The commands `campaign`, `tune`, `firmware` and `export` as functions."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brickpilot.campaign import file as campaign_file
from brickpilot.campaign import workers
from brickpilot.campaign.run_campaign import run_campaign
from brickpilot.data import whole_files
from brickpilot.data.reading import read
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.errors import InputError, disk_named
from brickpilot.export import fmu as fmus
from brickpilot.export import mcap_file, run_read
from brickpilot.export import mjcf as mjcfs
from brickpilot.export import urdf as urdfs
from brickpilot.firmware import boards, package, robot, simulate
from brickpilot.firmware.package import Made as Built
from brickpilot.firmware.package import Order
from brickpilot.fit import calibration
from brickpilot.fit.descent import Progress
from brickpilot.public.doors import Made, command_line, jobs_of, model_of, seed_of, silent, whole
from brickpilot.report import campaign_page, run_folder, run_page
from brickpilot.report.flight_text import waypoint_lines
from brickpilot.report.template import render_plain
from brickpilot.tune import page as tune_page
from brickpilot.tune import tuner
from brickpilot.tune.tuner import Budget, Tuned
from brickpilot.vehicle import flight_figures, scenario
from brickpilot.vehicle import gains as gains_file
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model, rcx

_TUNE_FILES = ("gains.toml", "mission.toml", "report.html", "summary.json", "model.toml", "calibrate.json")


def campaign(
    file: str | Path, out: str | Path | None = None, *, runs: int | None = None, seed: int | None = None,
    jobs: int = 2, scheduler: str | None = None, progress: Progress | None = None,
) -> Made:  # fmt: skip
    """Flies many missions that vary as `file` defines, and writes runs.parquet, summary.json and report.html.

    A second call with the same arguments resumes the campaign where the first call stopped.

    Args:
        file: the campaign file.
        out: the folder; None: runs/campaign-NAME.
        runs: number of runs, above 0; None: the number in the file.
        seed: the seed of all random draws, 0 or more; None: the seed in the file.
        jobs: number of processes on this machine, 1..256.
        scheduler: tcp://HOST:PORT of a Dask cluster, which then does the work instead of the processes.
        progress: called with (parts done, all parts, text).

    Raises:
        InputError: the file or an argument is wrong, or the folder holds another campaign.
        WorkFailedError: the disk is full, or no worker runs any more.
    """
    count = None if runs is None else whole("runs", runs, 1)
    given = campaign_file.load(Path(file), count=count, seed=None if seed is None else seed_of(seed), shares=SD_SHARE)
    folder = Path(out) if out else Path("runs") / f"campaign-{given.name}"
    command = command_line("campaign", str(file), runs=count, seed=seed)
    figures = run_campaign(given, folder, workers.chosen(jobs_of(jobs), scheduler), progress or silent, command)
    return Made(folder, campaign_page.verdict(figures), figures)


def tune(
    model: str | Path | None = None, dataset: str | Path | None = None, out: str | Path | None = None, *,
    board: str = "rcx", sensors: str = "imu", scenario: str | Path | None = None, robots: int = 24,
    judges: int = 1000, budget: str | int = 200, seed: int = 0, jobs: int = 2, scheduler: str | None = None,
    progress: Progress | None = None,
) -> tuple[Made, Tuned]:  # fmt: skip
    """Tunes gains for a robot with uncertain values, and writes gains.toml, mission.toml and report.html.

    Args:
        model: the robot's model.toml; calibrate.json or verdict.json in its folder states the uncertainty of its
            values.
        dataset: the folder of a data set, which is calibrated first; it is given instead of `model`.
        out: the folder; None: runs/tune-NAME.
        board: "rcx", "avr", "avr:2560", or "packaged": the project's firmware with the model's compensation.
        sensors: "imu" or "imu+encoders".
        scenario: the mission; None: the paper's eight waypoints, scaled to the robot.
        robots: number of robots that fly each gain set, 4..1000.
        judges: number of new robots that fly with the old and with the new gains, 20..100000.
        budget: the number of gain sets to try, or a time such as "90s".
        seed, jobs, scheduler, progress: as in `campaign`.

    Returns:
        The folder with its figures, and the result of the tuning.

    Raises:
        InputError: an argument is wrong, or no robot drawn from the model's uncertainty is physically possible.
        SimulationError: a flight cannot begin.
    """
    if (model is None) == (dataset is None):
        raise InputError("needs a robot: --model FILE or --dataset DIR, one of them", field="tune")
    whole("robots", robots, 4, 1000), whole("judges", judges, 20, 100_000), seed_of(seed)
    spent, where = _budget(str(budget)), workers.chosen(jobs_of(jobs), scheduler)
    command = command_line(
        "tune", model=model, dataset=dataset, board=board, sensors=sensors, scenario=scenario, robots=robots,
        judges=judges, budget=str(budget), seed=seed,
    )  # fmt: skip
    folder = Path(out) if out else Path("runs") / f"tune-{Path(model or dataset or '').stem}"
    show = progress or silent
    with run_folder.fresh_folder(folder, _TUNE_FILES) as beside:
        file = Path(model) if model is not None else _calibrated(Path(str(dataset)), beside, seed, show)
        problem = tuner.problem(file, board, sensors, None if scenario is None else str(scenario), SD_SHARE, seed)
        total = tuner.SCALE_ROBOTS + 2 * judges + (spent.sets or 0) * robots
        texts = {"scale": "flying the start", "search": "searching", "judge": "judging"}
        tuned = tuner.tune(
            problem, where, robots=robots, judges=judges, budget=spent,
            show=lambda stage, count: show(min(count, total), total, texts[stage]),
        )  # fmt: skip
        figures = _write_tuned(tuned, command, beside)
    return Made(folder, tune_page.sentence(tuned), figures), tuned


def _budget(text: str) -> Budget:
    """Returns the budget of `--budget`: a number of gain sets, or of seconds."""
    try:
        amount = float(text.removesuffix("s"))
    except ValueError:
        amount = -1.0
    if not 1 <= amount <= 1e6 or (not text.endswith("s") and amount != int(amount)):
        raise InputError("needs a number of gain sets, as 200, or of seconds, as 90s", field=f"--budget {text}")
    return Budget(None, amount) if text.endswith("s") else Budget(int(amount), None)


def _calibrated(folder: Path, beside: Path, seed: int, progress: Progress) -> Path:
    """Calibrates a data set, writes the result into the folder `beside`, and returns the model file."""
    calibrated = calibration.calibrate(read(folder), seed=seed, progress=progress)
    (beside / "calibrate.json").write_text(json.dumps(calibrated.to_json(), indent=2) + "\n", encoding="utf-8")
    model_file.save(calibrated.model, beside / "model.toml")
    return beside / "model.toml"


def _write_tuned(tuned: Tuned, command: str, folder: Path) -> dict[str, Any]:
    """Writes the gain set, the mission, the figures and the page, and returns the figures."""
    plan = tuned.problem.plan
    Gains(plan.model.name, dict(tuned.gains)).save(folder / "gains.toml")
    (folder / "mission.toml").write_text(scenario.render_mission(plan.scenario), encoding="utf-8")
    figures = tuner.to_json(tuned)
    (folder / "summary.json").write_text(json.dumps(figures, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    (folder / "report.html").write_text(tune_page.page(tuned, command), encoding="utf-8")
    return figures


def firmware(
    model: str | Path, board: str, out: str | Path | None = None, *, sensors: str = "imu",
    imu: str = "analogue", scenario: str | Path | None = None, gains: str | Path | None = None, seed: int = 0,
) -> Made:  # fmt: skip
    """Makes the firmware of a robot, and flies the robot with it in simulation.

    Args:
        model: the robot's model.toml.
        board: "rcx", "avr", "avr:2560" or "template".
        out: the folder; None: firmware-NAME-BOARD.
        sensors: "imu" or "imu+encoders".
        imu: the IMU of an Arduino: "analogue", or "mpu6050" or "lsm6ds" on I2C.
        scenario: the mission in the image; None: the paper's eight waypoints, scaled to the robot.
        gains: a gains.toml of `tune` that is compiled in.
        seed: the seed of the sensors' noise, 0 or more.

    Returns:
        The folder; `figures["flight"]["failure"]` says why the flight failed, or is None.

    Raises:
        InputError: an argument is wrong, or a value fits no fixed-point format; the message names value and range.
        WorkFailedError: the image cannot be built.
    """
    if board not in boards.BOARDS:
        raise InputError(f"{board!r} is not one of {', '.join(boards.BOARDS)}", field="board")
    own = robot.load(Path(model))
    if gains is not None:
        own = robot.with_gains(own, gains_file.load(Path(gains)))
    mission = None if scenario is None else str(scenario)
    order = Order(own, boards.BOARDS[board], sensors, mission, seed_of(seed), imu)
    folder = Path(out) if out else Path(f"firmware-{order.robot.model.name}-{board.replace(':', '-')}")
    with run_folder.fresh_folder(folder, package.files_of(order.board)) as beside:
        made = package.make(order, beside)
        figures = _firmware_figures(order, made) | {"fly": _fly_image(str(model), order, folder)}
        command = command_line(
            "firmware", model=model, board=order.board.name, out=folder, sensors=sensors, seed=seed,
            imu=None if imu == boards.ANALOGUE else imu, gains=gains, scenario=mission,
        )  # fmt: skip
        _write_firmware(order, made, figures, command, beside)
    failure = figures["flight"]["failure"]
    return Made(folder, f"{order.robot.model.name}: {failure or 'the mission is flown'}", figures)


def _fly_image(model_file: str, order: Order, folder: Path) -> str | None:
    """Returns the command that flies the robot with the image; None: the board has no simulator."""
    if not order.board.flown:
        return None
    return command_line("hil", image=folder / order.board.flown, model=model_file, scenario=order.mission)


def _firmware_figures(order: Order, made: Built) -> dict[str, Any]:
    flight = flight_figures.summary(made.flown.flight)
    flight["cruise_m_s"] = order.robot.value("controller", "coupled", "cruise")
    flight["failure"] = flight_figures.failure(flight)
    return {
        "robot": order.robot.model.name,
        "board": order.board.name,
        "step_s": made.step,
        "bytes": made.sizes,
        "compensation": simulate.undone(order.robot),
        "remarks": list(order.robot.remarks),
        "mission": made.plan.scenario.title,
        "acceptance_m": made.plan.acceptance,
        "waypoints_m": [list(point) for point in made.plan.scenario.waypoints],
        "flight": flight,
    }


def _write_firmware(order: Order, made: Built, figures: dict[str, Any], command: str, folder: Path) -> None:
    """Writes the flight, the figures and the page that explains the folder."""
    flown = made.flown.flight
    run_folder.write(flown, figures["flight"], run_page.page(flown, figures["flight"], command), folder / "flight")
    (folder / simulate.FIGURES).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    page = render_plain(
        "firmware.md",
        figures=figures,
        board=order.board,
        constants=order.robot.vehicle["controller"]["coupled"],
        waypoints=list(waypoint_lines(figures["flight"])),
        command=command,
        library=order.board.library,
        standalone=not order.board.flags,
    )
    (folder / "README.md").write_text(page, encoding="utf-8")


@dataclass(frozen=True)
class Exported:
    """Files for another program.

    Attributes:
        files: the files that were written.
        left_out: a sentence for each part of the model that the files do not contain.
    """

    files: tuple[Path, ...]
    left_out: tuple[str, ...] = ()


def export(
    what: Model | str | Path | None, kind: str, out: str | Path | None = None, *, fmi: str = "3.0",
    binary: bool = True,
) -> Exported:  # fmt: skip
    """Writes a model or a run for other programs.

    Args:
        what: for "fmu", "mjcf" and "urdf": a model, its file, or None for the packaged robot. For "mcap" and "parquet":
            a run folder. For "mcap" also: a recording of a link's traffic.
        kind: "fmu", "mjcf", "urdf", "mcap" or "parquet".
        out: the file; None: a file beside the run, or NAME with the extension of the kind.
        fmi: the version of an FMU: "3.0", "2.0" or "both".
        binary: whether an FMU holds a binary for this machine, which needs a C compiler.

    Raises:
        InputError: an argument is wrong, or a file cannot be read or written.
        WorkFailedError: the disk is full, or an FMU cannot be compiled.
    """
    if kind in ("mcap", "parquet") and isinstance(what, str | Path):
        return (_mcap if kind == "mcap" else _parquet)(Path(what), out)
    if kind not in ("fmu", "mjcf", "urdf"):
        known = "of a run folder mcap or parquet" if kind in ("mcap", "parquet") else "fmu, mjcf, urdf, mcap or parquet"
        raise InputError(f"{kind!r} does not fit: {known}", field="kind")
    chosen = model_file.load(Path(what)) if isinstance(what, str | Path) else model_of(what) or rcx()
    if kind == "fmu":
        return _fmu(chosen, out, fmi, binary)
    ending, written = ("xml", mjcfs.write(chosen)) if kind == "mjcf" else ("urdf", urdfs.write(chosen))
    path = _file(out, Path(f"{whole_files.plain_name(chosen.name)}.{ending}"))
    whole_files.write_files({path: written.text.encode()})
    return Exported((path,), tuple(written.left_out))


def _fmu(chosen: Model, out: str | Path | None, fmi: str, binary: bool) -> Exported:
    path = _file(out, Path(f"{fmus.identifier(chosen)}.fmu"))
    if fmi not in (*fmus.VERSIONS, "both"):
        raise InputError(f"{fmi!r} is not one of {', '.join(fmus.VERSIONS)} and both", field="fmi")
    versions = fmus.VERSIONS if fmi == "both" else (fmi,)
    ends = {version: f"-fmi{version[0]}" if fmi == "both" else "" for version in versions}
    with disk_named(path):
        made = {
            path.with_name(f"{path.stem}{ends[version]}{path.suffix}"): fmus.archive(chosen, version, binary=binary)
            for version in versions
        }
    whole_files.write_files(made)
    return Exported(tuple(made))


def _mcap(given: Path, out: str | Path | None) -> Exported:
    if given.is_dir() or not given.exists():
        run = run_read.read(given)
        topics = mcap_file.run_topics(run)
        content = mcap_file.write(topics, mcap_file.run_samples(run), {"summary.json": run.summary})
        layout = mcap_file.run_layout(topics)
    else:
        topics, samples = mcap_file.read_traffic(given)
        content = mcap_file.write(topics, samples, {})
        layout = mcap_file.traffic_layout(topics)
    path = _file(out, given.with_suffix(".mcap") if given.is_file() else _beside(given, ".mcap"))
    made = {path: content, path.with_suffix(".foxglove.json"): layout.encode()}
    whole_files.write_files(made)
    return Exported(tuple(made))


def _parquet(given: Path, out: str | Path | None) -> Exported:
    path = _file(out, _beside(given, ".parquet"))
    tables = run_read.parquet_tables(run_read.read(given))
    made = {path.with_name(f"{path.stem}{ending}{path.suffix}"): content for ending, content in tables.items()}
    whole_files.write_files(made)
    return Exported(tuple(made))


def _file(out: str | Path | None, default: Path) -> Path:
    """Returns the file to write. Raises InputError if `out` can only be a folder."""
    path = Path(out) if out else default
    if path.name in ("", ".."):
        raise InputError("is a folder; name a file", file=out)
    return path


def _beside(folder: Path, ending: str) -> Path:
    whole = folder.resolve()
    return (
        folder.parent / (whole.name + ending) if folder.name not in ("", "..") else whole.with_name(whole.name + ending)
    )
