"""The rows of the tables on discovery's page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from brickpilot import catalogue
from brickpilot.data.audit.fault import Fault
from brickpilot.data.gap import Place
from brickpilot.discover.finding import Effect, Finding, Parameter, Rank, RunValues, Share
from brickpilot.report import discover_plots
from brickpilot.report.discover_text import alternatives, explanation, known_size, say, shown_size, words
from brickpilot.report.quantities import DASH, ROLES, Shown, gap_text, percent, plain, quantity, signed, trusted
from brickpilot.vehicle.model import Model, unit_on
from brickpilot.vehicle.replay import RUN_KINDS


def place(one: Place, finding: Finding) -> dict[str, str]:
    """Returns the row of a place with a large part of the gap."""
    return {
        "run": one.run,
        "role": ROLES[finding.roles[one.run]],
        "signal": say(one.signal),
        "from_s": f"{one.from_s - start_s(finding, one.run):.2f}",
        "to_s": f"{one.to_s - start_s(finding, one.run):.2f}",
        "when": one.when,
        "share": percent(one.share_of_gap),
        "width": f"{100 * one.share_of_gap / max(other.share_of_gap for other in finding.where):.1f}",
    }


def effect(one: Effect) -> dict[str, Any]:
    """Returns an effect with a row for each of its parameters."""
    known = catalogue.effects_of((one.name,))
    return {
        "name": one.name,
        "words": words(one.name),
        "acts_on": one.acts_on,
        "equation": known[0].equation if known else "",
        "source": known[0].source if known else "",
        "confidence": percent(one.confidence),
        "rows": [_parameter(name, parameter) for name, parameter in one.parameters.items()],
    }


def _parameter(name: str, one: Parameter) -> dict[str, Any]:
    shown_name, known = known_size(say(name), one)
    ends, whisker = known.ci95, None
    if ends is not None and all(np.isfinite(ends)):
        far = 1.05 * max(abs(ends[0]), abs(ends[1])) or 1.0
        inside = (-far if ends[0] < 0 else 0.0, far if ends[1] > 0 else 0.0)
        whisker = discover_plots.interval(ends[0], known.value, ends[1], inside=inside)
    return {"name": shown_name, "shown": shown_size(one), "whisker": whisker}


def equivalents(finding: Finding) -> list[dict[str, Any]]:
    """Returns a row for each equivalent explanation, the best one first; no row if there is only one."""
    rivals = {rival.name: rival for one in finding.effects for rival in one.equivalents}
    best = {f"{one.name}.{key}": value for one in finding.effects for key, value in one.parameters.items()}
    found = []
    for name in alternatives(finding) if rivals else []:
        values = rivals[name].parameters if name in rivals else best
        shown = _labelled(list(values), [quantity(one.value, one.unit) for one in values.values()])
        worse = plain(rivals[name].worse_by, 2) if name in rivals else None
        found.append({"name": name, "words": explanation(name), "values": shown, "worse_by": worse})
    return found


def nominal(finding: Finding) -> list[dict[str, Any]]:
    """Returns a row for each nominal parameter that was fitted: first the stated ones, then the others."""
    rows = []
    for name, one in finding.nominal.items():
        away = (one.after - one.before) / one.sd if one.sd else None
        rows.append(
            {
                "name": say(name),
                "before": trusted(one.before, one.sd, one.unit),
                "after": quantity(one.after, one.unit),
                "change": signed(100 * (one.after / one.before - 1), 1) if one.before else None,
                "away": None if away is None else signed(away, 1),
                "whisker": None if away is None else discover_plots.interval(0.0, away, away, inside=(-4.0, 4.0)),
                "leaves_prior": one.leaves_prior,
                "data": "agree with it" if _determined(finding, name) else "do not determine it",
            }
        )
    model = finding.augmented
    units = {info.name: unit_on(model, info) for info in catalogue.parameters()}
    for name in model.basis:
        if name in units and name not in finding.nominal:
            data = "determine it" if _determined(finding, name) else "do not determine it"
            after = quantity(model.parameters[name], units[name])
            unstated = {"before": "not stated", "change": None, "away": None, "leaves_prior": False}
            rows.append({**unstated, "name": say(name), "after": after, "data": data})
    return rows


def run_values(one: RunValues) -> dict[str, Any]:
    """Returns one kind of value that differs from run to run, with a row for each run."""
    return {
        "words": one.words,
        "sentence": one.sentence(),
        "rows": [
            (name, quantity(value, one.unit, ci95 if all(np.isfinite(ci95)) else None))
            for name, (value, ci95) in one.runs.items()
        ],
    }


def share(one: Share) -> dict[str, str]:
    """Returns the row of an explanation of the set that holds 95 % of the weight."""
    return {
        "names": " + ".join(one.effects) or "no effect",
        "words": " with ".join(words(name) for name in one.effects) or "nothing is missing",
        "weight": percent(one.weight),
        "width": f"{100 * one.weight:.1f}",
        "mechanism": ", ".join(one.mechanisms) or DASH,
    }


def _determined(finding: Finding, name: str) -> bool:
    """Returns whether the data determine a nominal parameter, by its basis in the model."""
    return not finding.augmented.basis.get(name, "").endswith(("prior alone", "not narrowed by the data"))


def rank(one: Rank, model: Model) -> dict[str, Any]:
    """Returns the row of one explanation in the ranking."""
    own = {key: value for key, value in one.parameters.items() if "@" not in key}
    sizes = [_quantity(key, value, model) for key, value in own.items()]
    return {
        "names": " + ".join(one.names) or "no effect",
        "values": _labelled(list(own), sizes) + _of_runs(one),
        "error": gap_text(one.prediction_error),
        "removed": percent(one.removed),
        "width": f"{100 * min(max(one.removed, 0.0), 1.0):.1f}",
        "why": one.why,
    }


def _of_runs(one: Rank) -> list[tuple[str, Shown]]:
    """Returns the least and the largest value of each kind that runs have of their own."""
    found = []
    for kind, info in RUN_KINDS.items():
        values = [value for key, value in one.parameters.items() if key.startswith(f"{kind}@")]
        if values:
            found += [(f"{say(kind)} from", quantity(min(values), info.unit)), ("to", quantity(max(values), info.unit))]
    return found


def start_s(finding: Finding, run: str) -> float:
    """Returns the start of a run on its own clock, s; pages count from there."""
    return next((float(one.time[0]) for one in finding.dataset.runs if one.name == run), 0.0)


def fault(one: Fault, finding: Finding) -> dict[str, str]:
    """Returns the row of a data fault."""
    start = start_s(finding, one.run)
    return {
        "run": one.run,
        "signal": say(one.signal),
        "kind": say(one.kind),
        "from_s": f"{one.from_s - start:.3f}",
        "to_s": f"{one.to_s - start:.3f}",
    }


def _labelled(names: Sequence[str], shown: Sequence[Shown]) -> list[tuple[str, Shown]]:
    """Labels values of "effect.parameter" or "parameter"; names each of several effects once, a single one never."""
    effects = [name.rpartition(".")[0] for name in names]
    several = len(set(effects)) > 1
    labels = [
        f"{effect}: {say(name.rpartition('.')[2])}"
        if several and effect not in effects[:k]
        else say(name.rpartition(".")[2])
        for k, (name, effect) in enumerate(zip(names, effects, strict=True))
    ]
    return list(zip(labels, shown, strict=True))


def _quantity(key: str, value: float, model: Model) -> Shown:
    """Returns the value of "effect.parameter" with its unit."""
    effect, _, parameter = key.rpartition(".")
    infos = next((one.parameters for one in catalogue.effects() if one.name == effect), ())
    return quantity(value, next((unit_on(model, one) for one in infos if one.name == parameter), "1"))
