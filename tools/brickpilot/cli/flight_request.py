"""The options of a flight, which `run` and `hil` share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING

import click

from brickpilot.cli.completion import scenario_names

if TYPE_CHECKING:
    pass

_OPTIONS = (
    click.argument("scenario_name", metavar="[SCENARIO]", required=False, shell_complete=scenario_names),
    click.option(
        "--scenario",
        "scenario_file",
        metavar="FILE",
        shell_complete=scenario_names,
        help="A scenario file; the same as the argument.",
    ),
    click.option(
        "--profile",
        type=click.Choice(["coupled", "paper"]),
        help="The constants of plant and controller; default coupled.",
    ),
    click.option(
        "--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="The robot's sensors; default ideal."
    ),
    click.option("--model", "model_file", metavar="FILE", help="Fly this model.toml instead of the packaged robot."),
    click.option(
        "--compensation",
        "compensation_file",
        metavar="FILE",
        help="Send this compensation.toml of the robot to the firmware.",
    ),
    click.option(
        "--gains",
        "gains_file",
        metavar="FILE",
        help="Send this gains.toml of `brickpilot tune` to the firmware.",
    ),
    click.option("--seed", type=click.IntRange(0, 2**63 - 1), help="The seed of the sensors' noise; default 0."),
)


def flight_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the shared options to `command` and passes them to it as one `FlightRequest`, its first argument."""

    @functools.wraps(command)
    def with_request(**given: object) -> None:
        from brickpilot.public.doors import FlightRequest

        shared = {field.name: given.pop(field.name) for field in fields(FlightRequest)}
        command(FlightRequest(**shared), **given)  # type: ignore[arg-type]

    decorated: Callable[..., None] = with_request
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    return decorated
