"""Flies a scenario in one call, as `brickpilot run` does, but without its folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brickpilot.data.shown import Result
from brickpilot.errors import InputError
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle import scenario as scenarios
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model, rcx

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Flown(Result):
    """A flight with its figures.

    Attributes:
        flight: the plan, and every signal of every step.
        figures: the keys of `brickpilot run --json`; lengths in m, times in s, angles in rad.
    """

    flight: flight.Flight
    figures: dict[str, Any]

    @property
    def failure(self) -> str | None:
        """Why the mission failed; None: it did not."""
        reason: str | None = self.figures["failure"]
        return reason

    def to_frame(self) -> pandas.DataFrame:
        """Returns the track: a row for each control step, with the columns of log.csv."""
        import pandas

        return pandas.DataFrame(self.flight.log)


def prepare(
    scenario: str | Path = "mission",
    *,
    model: Model | None = None,
    profile: str | None = None,
    sensors: str | None = None,
    seed: int | None = None,
    compensation: Compensation | None = None,
    gains: Gains | None = None,
) -> flight.Plan:
    """Reads the scenario and returns the plan of the flight; the arguments are those of `fly`.

    Raises:
        InputError: as `fly`.
    """
    for name, value, known in (("profile", profile, scenarios.PROFILES), ("sensors", sensors, scenarios.SENSORS)):
        if value is not None and value not in known:
            raise InputError(f"{value!r} is not one of {', '.join(known)}", field=name)
    chosen = scenarios.load(scenarios.find(str(scenario)))
    vehicle = model if model is not None else rcx()
    return flight.plan(
        chosen, vehicle, profile=profile, sensors=sensors, seed=seed, compensation=compensation, gains=gains
    )


def fly(
    scenario: str | Path = "mission",
    *,
    model: Model | None = None,
    profile: str | None = None,
    sensors: str | None = None,
    seed: int | None = None,
    compensation: Compensation | None = None,
    gains: Gains | None = None,
) -> Flown:
    """Flies a mission or a manoeuvre in simulation.

    Args:
        scenario: the name of a packaged scenario, or a file.
        model: the model of the robot; None: the packaged robot.
        profile: "coupled" or "paper"; None: the scenario's, else the model's.
        sensors: "ideal", "imu" or "imu+encoders"; None: the scenario's, else ideal.
        seed: the seed of the sensors' noise; None: the scenario's, else 0.
        compensation: the compensation of this robot in the firmware.
        gains: settings of the controller from `brickpilot tune`.

    Raises:
        InputError: a file is bad, an argument is not one of those above, or the scenario needs a link.
        SimulationError: the plant diverges.

    >>> import brickpilot as bp
    >>> flown = bp.fly("forward_1m")
    >>> round(flown.figures["final_speed_m_s"], 3)
    0.0
    >>> float(flown.to_frame()["true_x_m"].iloc[-1].round(1))
    1.2
    """
    plan = prepare(
        scenario, model=model, profile=profile, sensors=sensors, seed=seed, compensation=compensation, gains=gains
    )
    if plan.scenario.faults:
        raise InputError("needs a link, and run has none; fly it with brickpilot hil", file=scenario, field="faults")
    flown = flight.fly(plan)
    figures = flight_figures.summary(flown)
    figures["failure"] = flight_figures.failure(figures)
    return Flown(flown, figures)
