"""The object of verdict.json, from a finding."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from brickpilot import __version__
from brickpilot.discover.finding import Effect, Experiment, Finding


def verdict_json(found: Finding) -> dict[str, Any]:
    """Returns the object of verdict.json: see report/verdict.schema.json. What is no finite number is None."""
    figures: dict[str, Any] = valid(_figures(found))
    return figures


def _figures(found: Finding) -> dict[str, Any]:
    return {
        "verdict": found.verdict,
        "mechanism": found.mechanism,
        "law_differs": found.law_differs,
        "evidence": None if found.evidence is None else found.evidence.kind,
        "proof": None if found.evidence is None else dataclasses.asdict(found.evidence),
        "fit_percent": found.yardstick.fit_json(),
        "predictable": found.yardstick.predictable_json(),
        "effects": [_effect_json(effect) for effect in found.effects],
        "where": [dataclasses.asdict(place) for place in found.where],
        "gap": {
            **{role: dataclasses.asdict(gap) for role, gap in found.gap.items()},
            "unit": "residual rms / noise sd",
            "by_signal": {name: dataclasses.asdict(gap) for name, gap in found.by_signal.items()},
        },
        "nominal": {name: dataclasses.asdict(change) for name, change in found.nominal.items()},
        "spread": None if found.spread is None else found.spread.to_json(),
        "nominal_findings": [dataclasses.asdict(one) for one in found.nominal_findings],
        "run_values": [one.to_json() for one in found.run_values],
        "data_faults": [fault.to_json() for fault in found.faults],
        "next_experiment": _plain(found.next_experiment),
        "term": None
        if found.term is None
        else {
            "acts_on": found.term.place,
            "equation": found.term.equation,
            "source": found.term.file_name,
            "removed_held_out": found.term.removed_held_out,
            "matches": [dataclasses.asdict(one) for one in found.term.matches],
        },
        "power": {name: dataclasses.asdict(one) for name, one in found.power.items()},
        "ranking": [dataclasses.asdict(rank) for rank in found.ranking],
        "roles": dict(found.roles),
        "frame": {"values": "FRD", "dataset": found.dataset.frame},
        "input_timing": found.dataset.input_timing,
        "held_out_stretches": {name: list(span) for name, span in found.held_out_stretches.items()},
        "notes": list(found.notes),
        "elapsed_s": found.elapsed_s,
        "budget": None if found.budget is None else dataclasses.asdict(found.budget),
        "seed": found.seed,
        "version": __version__,
    }


def valid(value: Any) -> Any:
    """Returns `value` as JSON can hold it: sequences as lists, and None for NaN and Infinity."""
    if isinstance(value, Mapping):
        return {key: valid(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [valid(one) for one in value]
    if isinstance(value, float):  # numpy's float64 is one too
        return float(value) if math.isfinite(value) else None
    return value


def _effect_json(effect: Effect) -> dict[str, Any]:
    entry: dict[str, Any] = dataclasses.asdict(effect)
    entry.pop("equation")
    return entry


def _plain(experiment: Experiment | None) -> dict[str, Any] | None:
    """Returns the experiment with the manoeuvre's name and break points at its top level, ready for a script."""
    if experiment is None:
        return None
    entry = dataclasses.asdict(experiment)
    manoeuvre = entry.pop("manoeuvre")
    return entry | (manoeuvre or {"name": None})
