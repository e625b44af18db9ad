"""Flies one run of a campaign again, with its whole log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from brickpilot.campaign import runs
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.file import runs as count_of
from brickpilot.campaign.variables import Value
from brickpilot.errors import InputError
from brickpilot.vehicle import flight, flight_checks, flight_figures

Ticks = dict[str, Any]


@dataclass(frozen=True)
class Replayed:
    """A run that was flown again.

    Attributes:
        inputs: the values that the campaign drew for the run; None: of an effect that its robot lacks.
        figures: the keys of `brickpilot run --json`, or of `hil --json` where the run has faults.
        ticks: the columns of ticks.csv; None: the run has no link.
    """

    inputs: dict[str, Value | None]
    flight: flight.Flight
    figures: dict[str, Any]
    ticks: Ticks | None


def replay(campaign: Campaign, index: int) -> Replayed:
    """Flies run `index` again: the same motor commands, to the last bit.

    Raises:
        InputError: the campaign has no such run.
        SimulationError: the plant diverges, as it did then.
    """
    if not 0 <= index < count_of(campaign):
        last = count_of(campaign) - 1
        raise InputError(f"the campaign has the runs 0 to {last}", field=f"--replay {index}")
    run = runs.one(campaign, index)
    given = dict(run.drawn) | runs.of_robot(campaign, run)
    if run.plan.scenario.faults:
        found = _over_a_link(run, given)
    else:
        flown = flight.fly(run.plan)
        found = Replayed(given, flown, flight_figures.summary(flown), None)
    found.figures["failure"] = flight_checks.failure(found.figures)
    return found


def _over_a_link(run: runs.Run, given: dict[str, Any]) -> Replayed:
    from brickpilot.hil import board, memory_link

    flown = memory_link.fly_alone(run.plan)
    figures = flight_figures.summary(flown.flight) | {
        "link": memory_link.SPEC,
        "pace": "lockstep",
        "late_ticks": flown.late_ticks,
        "lost_frames": flown.lost_frames,
        "safe_stops": flown.safe_stops,
        "broke_off": flown.broke_off,
        "board": board.told(flown.board),
    }
    return Replayed(given, flown.flight, figures, flown.ticks.columns())
