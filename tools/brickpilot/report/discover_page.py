"""The page that discovery writes: the verdict in a sentence, then everything that one would ask before believing it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from brickpilot import __version__, catalogue
from brickpilot.data.dataset import Fault
from brickpilot.discover.finding import Effect, Finding, Gap, Parameter, Place, Rank
from brickpilot.report import discover_plots
from brickpilot.report.discover_runs import figures, gap_map, left_over
from brickpilot.report.discover_text import (
    OVER_NOISE,
    ROLES,
    Shown,
    alternatives,
    explanation,
    gap_text,
    listed,
    percent,
    plain,
    quantity,
    say,
    signed,
    trusted,
    verdict,
    words,
)
from brickpilot.report.run_page import environment
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model, unit_on

_RANKED = 8  # explanations in the open; the others are folded away
_LISTED = 20  # faults, the same

_ROLE_ROWS = (("held_out", "runs held out"), ("fit", "runs fitted"))
_HEADINGS = {"none": "nothing is missing", "named": "named", "ambiguous": "ambiguous", "unknown": "unknown"}


def page(finding: Finding, command: str) -> str:
    """One self-contained HTML page.

    Args:
        finding: as discovery gives it; the runs of its data set, its roles and its simulations belong together.
        command: what made it, to be shown under "how to reproduce it".
    """
    left = left_over(finding)
    shown, folded = figures(finding, left)
    return (
        environment()
        .get_template("discover.html.j2")
        .render(
            title=f"{finding.dataset.name}: {'no' if finding.verdict == 'none' else 'the'} missing effect",
            finding=finding,
            heading=_HEADINGS[finding.verdict],
            sentence=verdict(finding),
            warnings=_warnings(finding),
            gaps=[(label, *_pair(finding.gap.get(name))) for name, label in _ROLE_ROWS],
            by_signal=[(say(name), *_pair(gap)) for name, gap in finding.by_signal.items()],
            gap_chart=_gap_chart(finding),
            runs={role: [name for name, one in finding.roles.items() if one == role] for role in ROLES},
            places=[_place(one, finding) for one in finding.where],
            map=gap_map(finding, left),
            shown=shown,
            folded=folded,
            effects=[_effect(one) for one in finding.effects],
            alternatives=_alternatives(finding),
            nominal=_nominal(finding),
            ranking=[_rank(one, finding.augmented) for one in finding.ranking],
            ranked=_RANKED,
            whiteness=_whiteness(finding),
            remaining=_remaining(finding),
            experiment=_experiment(finding),
            power=[
                (words(name), name, say(one.parameter), quantity(one.size, one.unit))
                for name, one in finding.power.items()
            ],
            faults=[_fault(one) for one in finding.faults],
            listed=_LISTED,
            wheels=finding.dataset.vehicle == "motor" or any(name.startswith("wheel") for name in finding.noise_sd),
            noise=[(say(name), quantity(sd, catalogue.outputs()[name])) for name, sd in finding.noise_sd.items()],
            term_html=None if finding.term is None else Markup(finding.term.html),
            model_text=model_file.render(finding.augmented),
            command=command,
            version=__version__,
        )
    )


def _gap_chart(finding: Finding) -> Markup:
    rows = [(label, gap.before, gap.after) for name, label in _ROLE_ROWS if (gap := finding.gap.get(name)) is not None]
    rows += [(say(name), gap.before, gap.after) for name, gap in finding.by_signal.items()]
    said = "; ".join(f"{label} {gap_text(before)} to {gap_text(after)}" for label, before, after in rows)
    return discover_plots.gaps(rows, title=f"Gap before and after, over noise: {said}")


def _place(one: Place, finding: Finding) -> dict[str, str]:
    return {
        "run": one.run,
        "role": ROLES[finding.roles[one.run]],
        "signal": say(one.signal),
        "from_s": f"{one.from_s:.2f}",
        "to_s": f"{one.to_s:.2f}",
        "when": one.when,
        "share": percent(one.share_of_gap),
        "width": f"{100 * one.share_of_gap / max(place.share_of_gap for place in finding.where):.1f}",
    }


def _effect(one: Effect) -> dict[str, Any]:
    source = next((info.source for info in catalogue.effects() if info.name == one.name), "")
    return {
        "name": one.name,
        "words": words(one.name),
        "acts_on": one.acts_on,
        "equation": one.equation,
        "source": source,
        "confidence": percent(one.confidence),
        "rows": [_parameter(name, parameter) for name, parameter in one.parameters.items()],
    }


def _parameter(name: str, one: Parameter) -> dict[str, Any]:
    ends = one.ci95
    whisker = None
    if ends is not None and all(np.isfinite(ends)):
        far = 1.05 * max(abs(ends[0]), abs(ends[1])) or 1.0
        inside = (-far if ends[0] < 0 else 0.0, far if ends[1] > 0 else 0.0)
        whisker = discover_plots.interval(ends[0], one.value, ends[1], inside=inside)
    return {"name": say(name), "shown": quantity(one.value, one.unit, ends), "whisker": whisker}


def _alternatives(finding: Finding) -> list[dict[str, Any]]:
    """The explanations between which the data cannot choose, the best one first; none where there is but one."""
    rivals = {rival.name: rival for one in finding.effects for rival in one.equivalents}
    best = {f"{one.name}.{key}": value for one in finding.effects for key, value in one.parameters.items()}
    found = []
    for name in alternatives(finding.effects) if rivals else []:
        values = rivals[name].parameters if name in rivals else best
        shown = _labelled(list(values), [quantity(one.value, one.unit) for one in values.values()])
        worse = plain(rivals[name].worse_by, 2) if name in rivals else None
        found.append({"name": name, "words": explanation(name), "values": shown, "worse_by": worse})
    return found


def _nominal(finding: Finding) -> list[dict[str, Any]]:
    """Every nominal value that was fitted: those that were stated, then those that were not."""
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
                "told": "agree" if _told(finding, name) else "say nothing of it",
            }
        )
    model = finding.augmented
    units = {info.name: unit_on(model, info) for info in catalogue.parameters()}
    for name in model.basis:
        if name in units and name not in finding.nominal:
            told = "give it" if _told(finding, name) else "do not narrow it"
            after = quantity(model.parameters[name], units[name])
            unstated = {"before": "not stated", "change": None, "away": None, "leaves_prior": False}
            rows.append({**unstated, "name": say(name), "after": after, "told": told})
    return rows


def _told(finding: Finding, name: str) -> bool:
    """Whether the data narrow a nominal value, by what the model's file says that it is based on."""
    return not finding.augmented.basis.get(name, "").endswith(("prior alone", "not narrowed by the data"))


def _warnings(finding: Finding) -> list[str]:
    """What a reader should know beside the verdict, because it bears on how far to trust it."""
    found = []
    for name, one in finding.nominal.items():
        if one.leaves_prior:
            away = abs(one.after - one.before) / one.sd if one.sd else 0.0
            found.append(
                f"The value stated for {say(name)} does not fit these data: {quantity(one.before, one.unit)} stated, "
                f"{quantity(one.after, one.unit)} fitted, {away:.1f} of its standard deviations away. A wrong nominal "
                "value is no missing effect: check it."
            )
    if finding.faults:
        kinds = list(dict.fromkeys(one.kind for one in finding.faults))
        found.append(
            f"Part of the data is damaged ({', '.join(say(kind) for kind in kinds)}) and was left out: see the faults "
            "below."
        )
    if "held_out" not in finding.roles.values():
        found.append("No run was held out, so that nothing here is proved on data the fit has not seen.")
    return found


def _rank(one: Rank, model: Model) -> dict[str, Any]:
    sizes = [_quantity(key, value, model) for key, value in one.parameters.items()]
    return {
        "names": " + ".join(one.names),
        "values": _labelled(list(one.parameters), sizes),
        "gap": gap_text(one.gap),
        "removed": percent(one.removed),
        "width": f"{100 * min(max(one.removed, 0.0), 1.0):.1f}",
        "why": one.why,
    }


def _whiteness(finding: Finding) -> list[dict[str, Any]]:
    found = []
    for signal, one in finding.whiteness.items():
        outside = sum(abs(value) > one.bound for value in one.correlation)
        said = f"{outside} of {len(one.correlation)} lags outside the band"
        title = f"Autocorrelation of what is left in {say(signal)}: {said}"
        chart = discover_plots.autocorrelation(one, title=title)
        found.append({"signal": say(signal), "white": one.white, "said": said, "chart": chart})
    return found


def _remaining(finding: Finding) -> list[str]:
    """Sentences on what the augmented simulator still gets wrong."""
    sizes = {name: gap.after for name, gap in finding.by_signal.items() if gap.after is not None}
    over = {name: size for name, size in sizes.items() if size > OVER_NOISE}
    coloured = [name for name, one in finding.whiteness.items() if not one.white]
    found = []
    if sizes and not over:
        found.append(
            f"In size, what is left is noise: at most {gap_text(max(sizes.values()))} times it in every signal."
        )
    for name, size in sorted(over.items(), key=lambda item: -item[1]):
        found.append(f"In {say(name)}, {gap_text(size)} times the noise is left.")
    if coloured:
        found.append(
            f"In {listed([say(name) for name in coloured])} it is not white: one moment's error says something of the "
            "next one's. That is a sign of dynamics that the simulator does not have, or of coloured sensor noise."
        )
    elif finding.whiteness:
        found.append("It is white: one moment's error says nothing of the next one's.")
    return found


def _experiment(finding: Finding) -> dict[str, Any] | None:
    one = finding.next_experiment
    if one is None:
        return None
    single = finding.dataset.vehicle == "motor"
    chart, points = None, []
    if one.manoeuvre is not None:
        title = f"Voltages of the manoeuvre {one.manoeuvre.name}, {plain(one.manoeuvre.duration_s)} s"
        chart = discover_plots.voltages(one.manoeuvre, single=single, title=title)
        sides = [("voltage", one.manoeuvre.voltage_left)]
        if not single:
            sides = [("left", one.manoeuvre.voltage_left), ("right", one.manoeuvre.voltage_right)]
        points = [(side, [(plain(t, 4), plain(v, 3)) for t, v in values]) for side, values in sides]
    return {
        "advice": one.advice,
        "separates": [explanation(name) for name in one.separates],
        "separation": gap_text(one.separation),
        "signal": None if one.signal is None else say(one.signal),
        "manoeuvre": one.manoeuvre,
        "single": single,
        "chart": chart,
        "points": points,
    }


def _fault(one: Fault) -> dict[str, str]:
    return {
        "run": one.run,
        "signal": say(one.signal),
        "kind": say(one.kind),
        "from_s": f"{one.from_s:.3f}",
        "to_s": f"{one.to_s:.3f}",
    }


def _pair(gap: Gap | None) -> tuple[str, str]:
    return gap_text(None if gap is None else gap.before), gap_text(None if gap is None else gap.after)


def _labelled(names: Sequence[str], shown: Sequence[Shown]) -> list[tuple[str, Shown]]:
    """Values of "effect.parameter" or "parameter", labelled; an effect is said once, and not if there is but one."""
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
    """The value of "effect.parameter"."""
    effect, _, parameter = key.rpartition(".")
    infos = next((one.parameters for one in catalogue.effects() if one.name == effect), ())
    return quantity(value, next((unit_on(model, one) for one in infos if one.name == parameter), "1"))
