"""Writes the headline numbers as sentences and tables: how much of the measured signals a model explains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from brickpilot.data.agreement import Agreement
from brickpilot.data.dataset import OwnUnit
from brickpilot.report.quantities import DASH, RUNS, ascii_text, fit_number, fit_text, quantity, say
from brickpilot.vehicle.headline import FREE_RUN, Headline

HORIZONS = {FREE_RUN: "free run", "1_s": "1 s", "0.2_s": "0.2 s"}
"""Horizon -> its name in tables."""

DEFINITION = (
    "The share of the measured signal that the model explains: 100 (1 \N{MINUS SIGN} norm of measured less simulated / "
    "norm of measured), over all samples of all runs; no mean is removed. R² is about the mean. The error beside it is "
    "an rms. A free run is simulated from the inputs alone; 1 s ahead, each window starts from what was measured. "
    "Angles, positions and travel count from the start of a run or window. A dash: the signal is zero, or no more than "
    "its noise."
)


def horizon_text(name: str) -> str:
    """Returns a horizon as text: "free run", "1 s"."""
    return HORIZONS.get(name, say(name))


def sentence(numbers: Headline) -> str:
    """Returns a sentence with the mean fit on the runs with the role `numbers.role`; empty: no fit is known."""
    role = numbers.role
    whole, ahead = numbers.mean(role), numbers.mean(role, "1_s")
    if whole is None:
        return ""
    text = f"The model explains {fit_text(whole)} of the measured signals on the {RUNS[role]}, over whole runs"
    text += "" if ahead is None else f", and {fit_text(ahead)} 1 s ahead"
    return f"{text}." if role == "held_out" else f"{text}; no run is held out to confirm it."


def error_text(one: Agreement, unit: OwnUnit) -> str:
    """Returns the rms error of a signal in the data set's own unit."""
    return DASH if one.rms_error is None else str(quantity(unit.size(one.rms_error), unit.unit))


def r2_text(one: Agreement) -> str:
    """Returns R2 with three decimals, or five near 1; a dash if R2 is not known."""
    if one.r2 is None:
        return DASH
    return f"{one.r2:.5f}" if one.r2 >= 0.995 else f"{one.r2:.3f}".replace("-", "\N{MINUS SIGN}")


def cells(one: Agreement, unit: OwnUnit) -> tuple[str, str, str]:
    """Returns fit in percent, R2 and rms error, as a table shows them."""
    return fit_number(one.fit_percent), r2_text(one), error_text(one, unit)


def shown(numbers: Headline, units: Mapping[str, OwnUnit]) -> dict[str, Any]:
    """Returns the headline for a page: `summary` has a table for each role that has runs."""
    summary = []
    for role in RUNS:
        signals = [name for name in numbers.signals if numbers.of(name, role).samples]
        if not signals:
            continue
        rows = [
            (say(name), [cells(numbers.of(name, role, horizon), units[name]) for horizon in numbers.horizons])
            for name in signals
        ]
        means = [fit_number(numbers.mean(role, horizon)) for horizon in numbers.horizons]
        summary.append({"label": RUNS[role], "means": means, "rows": rows})
    horizons = [horizon_text(name) for name in numbers.horizons]
    return {"sentence": sentence(numbers), "definition": DEFINITION, "horizons": horizons, "summary": summary}


def lines(numbers: Headline, units: Mapping[str, OwnUnit]) -> Iterator[str]:
    """Yields the headline for a terminal: a sentence, then for each signal a line with three columns per horizon."""
    role = numbers.role
    if not (said := sentence(numbers)):
        return
    yield said
    horizons = "".join(f"{f'{horizon_text(one)}: fit %, R2, rms error':>42}" for one in numbers.horizons)
    yield f"{RUNS[role]:26}{horizons}"
    for name in numbers.signals:
        columns = [map(ascii_text, cells(numbers.of(name, role, horizon), units[name])) for horizon in numbers.horizons]
        yield f"{name:26}" + "".join(f"{fit:>14}{r2:>10}{error:>18}" for fit, r2, error in columns)
