"""The page and the files that discovery writes; the page gives the verdict in a sentence, then the evidence."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.dataset import own_unit
from brickpilot.data.gap import Gap
from brickpilot.discover.finding import Finding, Rank, verdict_json
from brickpilot.report import composed_law, discover_fit, experiment_files, plot
from brickpilot.report.discover_runs import compared_signals, figures, gap_map
from brickpilot.report.discover_text import (
    OVER_NOISE,
    alternatives,
    explanation,
    known_size,
    left_predictable,
    listed,
    verdict,
    words,
)
from brickpilot.report.quantities import ROLES, RUNS, Shown, gap_text, plain, quantity, say, trusted
from brickpilot.report.template import render
from brickpilot.report.user_terms import frames, shown_finding, told
from brickpilot.vehicle import compensation
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.manoeuvres import Manoeuvre
from brickpilot.vehicle.model import Model, unit_on
from brickpilot.vehicle.replay import RUN_KINDS

_NO_GAP = Gap(None, None)
_UNDETERMINED = ("prior alone", "not narrowed by the data")
"""If the data do not determine a nominal parameter, its basis in the model ends with one of these texts."""


def page(finding: Finding, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        finding: the result of discovery.
        command: the command line that reproduces the result.
    """
    own = shown_finding(finding)
    compared = compared_signals(finding)
    shown, folded = figures(finding, compared)
    voltages, break_points = _voltages(finding)
    sizes = {name: gap.after for name, gap in finding.by_signal.items() if gap.after is not None}
    return render(
        "discover",
        title=f"{finding.dataset.name}: {'no' if finding.verdict == 'none' else 'the'} missing effect",
        finding=own,
        sentence=verdict(finding),
        map=gap_map(finding, compared),
        shown=shown,
        folded=folded,
        voltages=voltages,
        break_points=break_points,
        sizes=sizes,
        over={name: size for name, size in sorted(sizes.items(), key=lambda item: -item[1]) if size > OVER_NOISE},
        coloured=[say(name) for name, one in finding.whiteness.items() if not one.white],
        left_predictable=left_predictable(finding),
        autocorrelation=plot.autocorrelation,
        term_html=None if finding.term is None else Markup(composed_law.as_html(finding.term)),
        term_source=composed_law.of_finding(finding),
        model_text=model_file.render(finding.augmented),
        command=command,
        gaps=[(label, finding.gap.get(role, _NO_GAP)) for role, label in RUNS.items()],
        gap_chart=_gap_chart(finding),
        starts={run.name: float(run.time[0]) for run in finding.dataset.runs},
        told=partial(told, finding.dataset),
        words=words,
        explanation=explanation,
        listed=listed,
        known_size=known_size,
        whisker=_whisker,
        trusted=trusted,
        interval=plot.interval,
        finite=np.isfinite,
        **discover_fit.shown(finding),
        laws={one.name: one for one in catalogue.effects_of([one.name for one in finding.effects])},
        equivalents=equivalent_rows(own),
        unstated=_unstated(finding),
        undetermined={name for name, basis in finding.augmented.basis.items() if basis.endswith(_UNDETERMINED)},
        ranking=[(one, ranked_values(one, finding.augmented)) for one in own.ranking],
        runs={role: [name for name, one in finding.roles.items() if one == role] for role in ROLES},
        wheels=finding.dataset.vehicle == "motor" or any(name.startswith("wheel") for name in finding.noise_sd),
        units={name: own_unit(finding.dataset, name) for name in finding.noise_sd},
        frames=frames(finding.dataset),
    )


def write(finding: Finding, folder: Path, command: str, manoeuvre: Manoeuvre | None) -> Compensation | None:
    """Writes the page, verdict.json and model.toml into `folder`.

    The C source of a composed term, the next experiment and compensation.toml are written too, if they exist.

    Args:
        command: the command line that reproduces the result.
        manoeuvre: the manoeuvre to drive next; None: there is none.

    Returns:
        The compensation for the firmware; None: the firmware can compensate nothing.
    """
    texts = {
        "verdict.json": json.dumps(verdict_json(finding), indent=2, allow_nan=False) + "\n",
        "report.html": page(finding, command),
        **composed_law.of_finding(finding),
        **({} if manoeuvre is None else experiment_files.files_of(manoeuvre, finding.dataset.vehicle)),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    model_file.save(finding.augmented, folder / "model.toml")
    undone = compensation.from_model(finding.augmented)
    if undone is not None:
        undone.save(folder / "compensation.toml")
    return undone


def _gap_chart(finding: Finding) -> Markup:
    """Draws the gap before and after discovery, for the runs of each role and for each signal."""
    rows = [
        (label, gap.before, gap.after) for role, label in RUNS.items() if (gap := finding.gap.get(role)) is not None
    ]
    rows += [(say(name), gap.before, gap.after) for name, gap in finding.by_signal.items()]
    text = "; ".join(f"{label} {gap_text(before)} to {gap_text(after)}" for label, before, after in rows)
    return plot.gaps(rows, single=finding.verdict == "none", title=f"Gap before and after, over noise: {text}")


def _voltages(finding: Finding) -> tuple[Markup | None, dict[str, tuple[tuple[float, float], ...]]]:
    """Returns the chart of the next manoeuvre or None, and motor -> the break points (s, V) of its voltage."""
    manoeuvre = None if finding.next_experiment is None else finding.next_experiment.manoeuvre
    if manoeuvre is None:
        return None, {}
    single = finding.dataset.vehicle == "motor"
    title = f"Voltages of the manoeuvre {manoeuvre.name}, {plain(manoeuvre.duration_s)} s"
    sides = {"left": manoeuvre.voltage_left, "right": manoeuvre.voltage_right}
    points = {"voltage": manoeuvre.voltage_left} if single else sides
    return plot.voltages(manoeuvre, single=single, title=title), points


def _whisker(value: float, ci95: tuple[float, float] | None) -> Markup | None:
    """Draws a value with its interval, in a range that holds 0 and the interval; None: an end is not finite."""
    if ci95 is None or not all(np.isfinite(ci95)):
        return None
    low, high = ci95
    far = 1.05 * max(abs(low), abs(high)) or 1.0
    return plot.interval(low, value, high, inside=(-far if low < 0 else 0.0, far if high > 0 else 0.0))


def equivalent_rows(finding: Finding) -> list[dict[str, Any]]:
    """Returns a row for each equivalent explanation, the best one first; no row if there is only one explanation."""
    rivals = {rival.name: rival for one in finding.effects for rival in one.equivalents}
    best = {f"{one.name}.{key}": value for one in finding.effects for key, value in one.parameters.items()}
    found = []
    for name in alternatives(finding) if rivals else []:
        values = rivals[name].parameters if name in rivals else best
        shown = _labelled(list(values), [quantity(one.value, one.unit) for one in values.values()])
        worse = plain(rivals[name].worse_by, 2) if name in rivals else None
        found.append({"name": name, "words": explanation(name), "values": shown, "worse_by": worse})
    return found


def _unstated(finding: Finding) -> dict[str, Shown]:
    """Returns parameter -> fitted value, for the nominal parameters that the data set does not state."""
    model = finding.augmented
    units = {info.name: unit_on(model, info) for info in catalogue.parameters()}
    names = [name for name in model.basis if name in units and name not in finding.nominal]
    return {name: quantity(model.parameters[name], units[name]) for name in names}


def ranked_values(one: Rank, model: Model) -> list[tuple[str, Shown]]:
    """Returns an explanation's fitted values; if each run has a value of its own, the smallest and the largest one."""
    own = {key: value for key, value in one.parameters.items() if "@" not in key}
    shown = _labelled(list(own), [_quantity(key, value, model) for key, value in own.items()])
    for kind, info in RUN_KINDS.items():
        values = [value for key, value in one.parameters.items() if key.startswith(f"{kind}@")]
        if values:
            shown += [(f"{say(kind)} from", quantity(min(values), info.unit)), ("to", quantity(max(values), info.unit))]
    return shown


def _labelled(names: Sequence[str], shown: Sequence[Shown]) -> list[tuple[str, Shown]]:
    """Returns (label, value) pairs for names "effect.parameter" or "parameter"; labels tell several effects apart."""
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
