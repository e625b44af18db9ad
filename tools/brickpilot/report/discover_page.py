"""The page that discovery writes: the verdict in a sentence, then the evidence for it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.dataset import own_unit
from brickpilot.data.gap import Gap
from brickpilot.discover.finding import Effect, Finding, Parameter, Rank
from brickpilot.report import composed_law, discover_fit, plot
from brickpilot.report.discover_runs import compared_signals, figures, gap_map
from brickpilot.report.discover_text import (
    OVER_NOISE,
    alternatives,
    explanation,
    known_size,
    left_predictable,
    listed,
    shown_parameter,
    verdict,
    words,
)
from brickpilot.report.quantities import ROLES, Shown, gap_text, percent, plain, quantity, say, signed, trusted
from brickpilot.report.template import render
from brickpilot.report.user_terms import frames, shown_finding, shown_rank, shown_size, told
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model, unit_on
from brickpilot.vehicle.replay import RUN_KINDS

_RANKED = 8  # number of explanations that are shown; further explanations are folded
_PLACES = 8  # number of places that are shown
_LISTED = 20  # number of faults that are shown; further faults are folded

_ROLE_ROWS = (("held_out", "held-out runs"), ("fit", "fit runs"))
_NO_GAP = Gap(None, None)
_HEADINGS = {"none": "no missing effect", "named": "named", "ambiguous": "ambiguous", "unknown": "unknown"}


def page(finding: Finding, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        finding: the result of discovery.
        command: the command line that reproduces the result.
    """
    compared = compared_signals(finding)
    shown, folded = figures(finding, compared)
    voltages, break_points = _voltages(finding)
    return render(
        "discover",
        title=f"{finding.dataset.name}: {'no' if finding.verdict == 'none' else 'the'} missing effect",
        finding=finding,
        heading=_HEADINGS[finding.verdict],
        sentence=verdict(finding),
        warnings=told(finding.dataset, _warnings(finding)),
        map=gap_map(finding, compared),
        shown=shown,
        folded=folded,
        voltages=voltages,
        break_points=break_points,
        remaining=_remaining(finding),
        whiteness=_whiteness(finding),
        term_html=None if finding.term is None else Markup(composed_law.as_html(finding.term)),
        term_source=composed_law.of_finding(finding),
        model_text=model_file.render(finding.augmented),
        command=command,
        gaps=[(label, finding.gap.get(name, _NO_GAP)) for name, label in _ROLE_ROWS],
        gap_chart=_gap_chart(finding),
        places=finding.where[:_PLACES],
        starts={run.name: float(run.time[0]) for run in finding.dataset.runs},
        ranked=_RANKED,
        listed=_LISTED,
        told=partial(told, finding.dataset),
        words=words,
        explanation=explanation,
        finite=np.isfinite,
        **discover_fit.shown(finding),
        **told(finding.dataset, _tables(finding)),
        runs={role: [name for name, one in finding.roles.items() if one == role] for role in ROLES},
        wheels=finding.dataset.vehicle == "motor" or any(name.startswith("wheel") for name in finding.noise_sd),
        units={name: own_unit(finding.dataset, name) for name in finding.noise_sd},
        frames=frames(finding.dataset),
        notes=told(finding.dataset, list(finding.notes)),
    )


def _tables(finding: Finding) -> dict[str, Any]:
    """Returns the rows of the tables of effects, explanations and parameters."""
    own, data = shown_finding(finding), finding.dataset
    return {
        "effects": [effect_row(one) for one in own.effects],
        "equivalents": equivalent_rows(own),
        "nominal": nominal_rows(finding),
        "ranking": [(one, ranked_values(shown_rank(data, one), finding.augmented)) for one in finding.ranking],
        "power": [(words(name), name, shown_size(data, name, one)) for name, one in finding.power.items()],
    }


def _gap_chart(finding: Finding) -> Markup:
    """Draws the gap before and after, for each role and for each signal."""
    rows = [(label, gap.before, gap.after) for name, label in _ROLE_ROWS if (gap := finding.gap.get(name)) is not None]
    rows += [(say(name), gap.before, gap.after) for name, gap in finding.by_signal.items()]
    text = "; ".join(f"{label} {gap_text(before)} to {gap_text(after)}" for label, before, after in rows)
    return plot.gaps(rows, single=finding.verdict == "none", title=f"Gap before and after, over noise: {text}")


def _warnings(finding: Finding) -> list[str]:
    """Returns the sentences on why the verdict may be less certain."""
    found = []
    for name, one in finding.nominal.items():
        if one.leaves_prior:
            away = abs(one.after - one.before) / one.sd if one.sd else 0.0
            found.append(
                f"The stated value of {say(name)}, {quantity(one.before, one.unit)}, does not fit these data: the fit "
                f"gives {quantity(one.after, one.unit)}, which is {away:.1f} standard deviations away. A wrong nominal "
                "value is not a missing effect. Please check this value."
            )
    if finding.faults:
        kinds = list(dict.fromkeys(say(one.kind) for one in finding.faults))
        found.append(
            f"Part of the data is damaged ({', '.join(kinds)}). These samples were left out; they are listed below."
        )
    if "held_out" not in finding.roles.values() and not finding.held_out_stretches:
        found.append("No run was held out, so nothing on this page is validated on data outside the fit.")
    return found


def _whiteness(finding: Finding) -> list[dict[str, Any]]:
    """Returns the autocorrelation of each signal's residual as a chart; the caption depends on the residual's size."""
    found = []
    for signal, one in finding.whiteness.items():
        outside = sum(abs(value) > one.bound for value in one.correlation)
        count = f"{outside} of {len(one.correlation)} lags lie outside the band"
        title = f"Autocorrelation of the residual of {say(signal)}: {count}"
        chart = plot.autocorrelation(one, title=title)
        size = finding.by_signal.get(signal, _NO_GAP).after
        is_noise = one.white and (size is None or size <= OVER_NOISE)
        says = "white" if is_noise else f"{gap_text(size)} times the noise" if one.white else "not white"
        found.append({"signal": say(signal), "white": is_noise, "says": says, "count": count, "chart": chart})
    return found


def _remaining(finding: Finding) -> list[str]:
    """Returns sentences on the residual of the augmented model. They call it noise only if its size agrees."""
    sizes = {name: gap.after for name, gap in finding.by_signal.items() if gap.after is not None}
    over = {name: size for name, size in sizes.items() if size > OVER_NOISE}
    coloured = [name for name, one in finding.whiteness.items() if not one.white]
    found = []
    if sizes and not over:
        found.append(
            f"The remaining gap is as small as the noise: at most {gap_text(max(sizes.values()))} times the noise in "
            "every signal."
        )
    for name, size in sorted(over.items(), key=lambda item: -item[1]):
        found.append(f"The remaining gap of {say(name)} is {gap_text(size)} times the noise.")
    if coloured:
        found.append(
            f"The residual of {listed([say(name) for name in coloured])} is not white: its samples are correlated in "
            "time. Either the simulator still lacks some dynamics, or the sensor noise is coloured."
        )
    elif finding.whiteness and not over:
        found.append("The residual is white: its samples are not correlated in time.")
    if left := left_predictable(finding):
        found.append(left)
    return found


def _voltages(finding: Finding) -> tuple[Markup | None, dict[str, tuple[tuple[float, float], ...]]]:
    """Returns the chart of the next manoeuvre, if there is one, and motor -> the break points (s, V) of its voltage."""
    manoeuvre = None if finding.next_experiment is None else finding.next_experiment.manoeuvre
    if manoeuvre is None:
        return None, {}
    single = finding.dataset.vehicle == "motor"
    title = f"Voltages of the manoeuvre {manoeuvre.name}, {plain(manoeuvre.duration_s)} s"
    sides = {"left": manoeuvre.voltage_left, "right": manoeuvre.voltage_right}
    points = {"voltage": manoeuvre.voltage_left} if single else sides
    return plot.voltages(manoeuvre, single=single, title=title), points


def effect_row(one: Effect) -> dict[str, Any]:
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
        whisker = plot.interval(ends[0], known.value, ends[1], inside=inside)
    return {"name": shown_name, "shown": shown_parameter(one), "whisker": whisker}


def equivalent_rows(finding: Finding) -> list[dict[str, Any]]:
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


def nominal_rows(finding: Finding) -> list[dict[str, Any]]:
    """Returns a row for each nominal parameter that was fitted: first the stated parameters, then the others."""
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
                "whisker": None if away is None else plot.interval(0.0, away, away, inside=(-4.0, 4.0)),
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


def _determined(finding: Finding, name: str) -> bool:
    """Returns whether the data determine a nominal parameter, by its basis in the model."""
    return not finding.augmented.basis.get(name, "").endswith(("prior alone", "not narrowed by the data"))


def ranked_values(one: Rank, model: Model) -> list[tuple[str, Shown]]:
    """Returns the fitted values of an explanation; of values that differ from run to run, the smallest and largest."""
    own = {key: value for key, value in one.parameters.items() if "@" not in key}
    shown = _labelled(list(own), [_quantity(key, value, model) for key, value in own.items()])
    for kind, info in RUN_KINDS.items():
        values = [value for key, value in one.parameters.items() if key.startswith(f"{kind}@")]
        if values:
            shown += [(f"{say(kind)} from", quantity(min(values), info.unit)), ("to", quantity(max(values), info.unit))]
    return shown


def _labelled(names: Sequence[str], shown: Sequence[Shown]) -> list[tuple[str, Shown]]:
    """Labels values of "effect.parameter" or "parameter". Several effects are each named once, a single one is not."""
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
