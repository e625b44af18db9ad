"""The options of a flight, which `run` and `hil` share, and the plan that they ask for."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.completion import scenario_names
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.vehicle.flight import Plan

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


@dataclass(frozen=True)
class FlightRequest:
    """The shared options as the user gave them; None where an option is absent."""

    scenario_name: str | None
    scenario_file: str | None
    profile: str | None
    sensors: str | None
    model_file: str | None
    compensation_file: str | None
    gains_file: str | None
    seed: int | None

    @property
    def scenario(self) -> str:
        """The scenario's name or file; the packaged mission by default."""
        if self.scenario_name is not None:
            return self.scenario_name
        return "mission" if self.scenario_file is None else self.scenario_file

    def plan(self) -> Plan:
        """Reads the scenario, the model and the compensation.

        Raises:
            InputError: a file is bad, or the scenario is given twice.
        """
        from brickpilot.vehicle import fly

        return fly.prepare(self.scenario, **self.choices())

    def choices(self) -> dict[str, Any]:
        """Returns the arguments of `fly.fly` beside the scenario.

        Raises:
            InputError: a file is bad, or the scenario is given twice.
        """
        from brickpilot.vehicle import compensation, gains, model

        if self.scenario_name is not None and self.scenario_file is not None:
            raise InputError("the scenario is given twice: as an argument and as an option", field="--scenario")
        return {
            "model": model.load(Path(self.model_file)) if self.model_file else None,
            "profile": self.profile,
            "sensors": self.sensors,
            "seed": self.seed,
            "compensation": compensation.load(Path(self.compensation_file)) if self.compensation_file else None,
            "gains": gains.load(Path(self.gains_file)) if self.gains_file else None,
        }

    def options(self, plan: Plan) -> list[str]:
        """The options that repeat the flight of `plan`, for the command line on its page."""
        found = ["--profile", plan.controller, "--sensors", plan.sensors, "--seed", str(plan.seed)]
        found += ["--model", self.model_file] if self.model_file else []
        found += ["--compensation", self.compensation_file] if self.compensation_file else []
        found += ["--gains", self.gains_file] if self.gains_file else []
        return found


def flight_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the shared options to `command` and passes them to it as one `FlightRequest`, its first argument."""

    @functools.wraps(command)
    def with_request(**given: object) -> None:
        shared = {field.name: given.pop(field.name) for field in fields(FlightRequest)}
        command(FlightRequest(**shared), **given)  # type: ignore[arg-type]

    decorated: Callable[..., None] = with_request
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    return decorated
