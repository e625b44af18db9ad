"""`brickpilot firmware`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.completion import model_files, scenario_names
from brickpilot.cli.mission_lines import figure_lines, waypoint_lines
from brickpilot.cli.terminal import as_json
from brickpilot.errors import WorkFailedError

if TYPE_CHECKING:
    from brickpilot.firmware.package import Made, Order


@click.command()
@click.option(
    "--model",
    "model_file",
    metavar="FILE",
    required=True,
    shell_complete=model_files,
    help="The robot: a model.toml of discover or calibrate, or your own.",
)
@click.option(
    "--board",
    "board_name",
    type=click.Choice(["rcx", "avr", "avr:2560", "template"]),
    required=True,
    help="rcx: LEGO RCX. avr: ATmega328P (Arduino Uno, Nano). avr:2560: ATmega2560 (Arduino Mega). template: sources "
    "for a board of your own.",
)
@click.option("--out", metavar="DIR", help="The folder to write; default firmware-NAME-BOARD.")
@click.option("--sensors", type=click.Choice(["imu", "imu+encoders"]), help="The robot's sensors; default imu.")
@click.option(
    "--scenario",
    metavar="FILE",
    shell_complete=scenario_names,
    help="The mission in the image; default the paper's eight waypoints, scaled to the robot.",
)
@click.option("--gains", "gains_file", metavar="FILE", help="Compile this gains.toml of `brickpilot tune` in.")
@click.option(
    "--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True, help="The seed of the sensors' noise."
)
@as_json
def firmware(
    model_file: str,
    board_name: str,
    out: str | None,
    sensors: str | None,
    scenario: str | None,
    gains_file: str | None,
    seed: int,
    as_json: bool,
) -> None:  # fmt: skip
    """Makes the firmware of your own robot, and flies the robot with it in simulation.

    The constants follow from the robot: its model, gains with the packaged robot's closed-loop poles, and what undoes
    the effects of the model file. A value that a fixed-point format cannot hold is an error that names it and its
    range. DIR gets the image, robot.toml with every value and where it is from, the generated headers, build.sh to
    build it again, and the flight; avr an Arduino library, too. A mission that was not flown gives one line and exit
    status 1. It needs a checkout of the project in this folder or above it.
    """
    from brickpilot.firmware import boards, package, robot
    from brickpilot.report import run_folder
    from brickpilot.vehicle import gains

    board = boards.BOARDS[board_name]
    own = robot.load(Path(model_file))
    if gains_file is not None:
        own = robot.with_gains(own, gains.load(Path(gains_file)))
    order = package.Order(own, board, sensors or "imu", scenario, seed)
    folder = Path(out) if out else Path(f"firmware-{order.robot.model.name}-{board_name.replace(':', '-')}")
    with run_folder.fresh_folder(folder, package.files_of(board)) as beside:
        made = package.make(order, beside)
        figures = _figures(order, made) | {"fly": _fly_image(model_file, order, folder)}
        command = _command(model_file, gains_file, order, folder)
        _write(order, made, figures, command, beside)
    if as_json:
        click.echo(json.dumps(figures))
    else:
        _show(figures, folder)
    if figures["flight"]["failure"] is not None:
        raise WorkFailedError(f"{order.robot.model.name}: {figures['flight']['failure']}")


def _command(model_file: str, gains_file: str | None, order: Order, folder: Path) -> str:
    words = ["brickpilot", "firmware", "--model", model_file, "--board", order.board.name, "--out", str(folder)]
    words += ["--sensors", order.sensors, "--seed", str(order.seed)]
    words += ["--gains", gains_file] if gains_file else []
    return shlex.join(words + (["--scenario", order.mission] if order.mission else []))


def _fly_image(model_file: str, order: Order, folder: Path) -> str | None:
    """Returns the command that flies the image itself, where a simulator of its board can."""
    if not order.board.library:
        return None
    words = ["brickpilot", "hil", "--image", str(folder / "brickpilot.elf"), "--model", model_file]
    return shlex.join(words + (["--scenario", order.mission] if order.mission else []))


def _figures(order: Order, made: Made) -> dict[str, Any]:
    from brickpilot.firmware import simulate
    from brickpilot.vehicle import flight_checks, flight_figures

    flight = flight_figures.summary(made.flown.flight)
    flight["cruise_m_s"] = order.robot.value("controller", "coupled", "cruise")
    flight["failure"] = flight_checks.failure(flight)
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


def _write(order: Order, made: Made, figures: dict[str, Any], command: str, folder: Path) -> None:
    """Writes the flight, the figures and the page that explains the folder."""
    from brickpilot.firmware import package
    from brickpilot.report import run_folder, run_page
    from brickpilot.report.template import render_plain

    flown = made.flown.flight
    run_folder.write(flown, figures["flight"], run_page.page(flown, figures["flight"], command), folder / "flight")
    package.write_figures(figures, folder)
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


def _show(figures: dict[str, Any], folder: Path) -> None:
    for line in (*waypoint_lines(figures["flight"]), *figure_lines(figures["flight"])):
        click.echo(line)
    click.echo(f"mission             {figures['mission']}")
    sizes = ", ".join(f"{name.replace('_', ' ')} {size:,}" for name, size in figures["bytes"].items())
    click.echo(f"image               {sizes} bytes")
    for remark in figures["remarks"]:
        click.echo(f"not undone          {remark}")
    if figures["fly"] is not None:
        click.echo(f"fly this image      {figures['fly']}")
    click.echo(f"report: {folder / 'README.md'}")
