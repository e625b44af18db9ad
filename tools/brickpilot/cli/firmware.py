"""`brickpilot firmware`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import SEEDS, as_json, model_option, scenario_option, show
from brickpilot.errors import WorkFailedError
from brickpilot.report.flight_text import figure_lines, waypoint_lines


@click.command()
@model_option("The robot: a model.toml of discover or calibrate, or your own.", required=True)
@click.option(
    "--board",
    type=click.Choice(["rcx", "avr", "avr:2560", "template"]),
    required=True,
    help="rcx: LEGO RCX. avr: ATmega328P (Arduino Uno, Nano). avr:2560: ATmega2560 (Arduino Mega). template: sources "
    "for a board of your own.",
)
@click.option("--out", metavar="DIR", help="The folder to write; default firmware-NAME-BOARD.")
@click.option(
    "--sensors", type=click.Choice(["imu", "imu+encoders"]), default="imu", help="The robot's sensors; default imu."
)
@click.option(
    "--imu", type=click.Choice(["analogue", "mpu6050", "lsm6ds"]), default="analogue", show_default=True,
    help="The Arduino's IMU: voltages at A0 to A2, or a chip on I2C, MPU-6050 or LSM6DS.",
)  # fmt: skip
@scenario_option("The mission in the image; default the paper's eight waypoints, scaled to the robot.")
@click.option("--gains", metavar="FILE", help="Compile this gains.toml of `brickpilot tune` into the image.")
@click.option("--seed", type=SEEDS, default=0, show_default=True, help="The seed of the sensors' noise.")
@as_json
def firmware(as_json: bool, **options: Any) -> None:
    """Makes the firmware of your own robot, and flies the robot with it in simulation.

    The constants are made for the robot: its model, gains that give it the packaged robot's closed-loop poles, and a
    compensation for the effects of the model file. If a fixed-point format cannot hold a value, an error names the
    value and its range. DIR gets the image, robot.toml with every value and its source, the generated headers, build.sh
    to build the image again, and the flight. For avr, DIR also gets an Arduino library; for rcx, brickpilot.h8sim:
    the same firmware without brickOS and drivers, for `hil --image`. If the mission was not flown, one line says so
    and the exit status is 1. The sources are those of a checkout in this folder or above it, or else the package's.
    """
    from brickpilot.public import making

    made = making.firmware(**options)
    show(made.figures, _lines(made.figures, made.folder), as_json=as_json)
    if made.figures["flight"]["failure"] is not None:
        raise WorkFailedError(made.sentence)


def _lines(figures: Mapping[str, Any], folder: Path) -> Iterator[str]:
    yield from waypoint_lines(figures["flight"])
    yield from figure_lines(figures["flight"])
    yield f"mission             {figures['mission']}"
    sizes = ", ".join(f"{name.replace('_', ' ')} {size:,}" for name, size in figures["bytes"].items())
    yield f"image               {sizes} bytes"
    for remark in figures["remarks"]:
        yield f"not undone          {remark}"
    if figures["fly"] is not None:
        yield f"fly this image      {figures['fly']}"
    yield f"report: {folder / 'README.md'}"
