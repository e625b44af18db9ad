"""The page that discovery writes: the verdict in a sentence, then the evidence for it."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from brickpilot.data.gap import Gap
from brickpilot.data.own_units import own_unit
from brickpilot.discover.finding import Finding
from brickpilot.report import composed_law, discover_fit, discover_plots, discover_tables
from brickpilot.report.discover_runs import compared_signals, figures, gap_map
from brickpilot.report.discover_text import OVER_NOISE, explanation, left_predictable, listed, say, verdict, words
from brickpilot.report.quantities import ROLES, gap_text, plain, quantity
from brickpilot.report.template import render
from brickpilot.report.user_terms import frames, shown_finding, shown_rank, shown_size, told
from brickpilot.vehicle import model as model_file

_RANKED = 8  # explanations that are shown; the others are folded
_PLACES = 8  # places that are shown
_LISTED = 20  # faults that are shown; the others are folded

_ROLE_ROWS = (("held_out", "held-out runs"), ("fit", "fit runs"))
_HEADINGS = {"none": "no missing effect", "named": "named", "ambiguous": "ambiguous", "unknown": "unknown"}


def page(finding: Finding, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        finding: the result of discovery.
        command: the command line that reproduces it.
    """
    compared = compared_signals(finding)
    shown, folded = figures(finding, compared)
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
        experiment=told(finding.dataset, _experiment(finding)),
        remaining=_remaining(finding),
        whiteness=_whiteness(finding),
        term_html=None if finding.term is None else Markup(composed_law.as_html(finding.term)),
        term_source=composed_law.of_finding(finding),
        model_text=model_file.render(finding.augmented),
        command=command,
        **discover_fit.shown(finding),
        **_gaps(finding),
        **told(finding.dataset, _tables(finding)),
        **_data(finding),
    )


def _gaps(finding: Finding) -> dict[str, Any]:
    """Returns the gaps before and after, by role and by signal, as text and as a chart."""
    return {
        "gaps": [(label, *_pair(finding.gap.get(name))) for name, label in _ROLE_ROWS],
        "by_signal": [(say(name), *_pair(gap)) for name, gap in finding.by_signal.items()],
        "gap_chart": _gap_chart(finding),
    }


def _tables(finding: Finding) -> dict[str, Any]:
    """Returns the rows of the tables on effects, explanations and parameters."""
    own, data = shown_finding(finding), finding.dataset
    return {
        "places": [discover_tables.place(one, finding) for one in finding.where[:_PLACES]],
        "effects": [discover_tables.effect(one) for one in own.effects],
        "equivalents": discover_tables.equivalents(own),
        "explanations": [discover_tables.share(one) for one in finding.explanations],
        "nominal": discover_tables.nominal(finding),
        "run_values": [discover_tables.run_values(one) for one in finding.run_values],
        "ranking": [discover_tables.rank(shown_rank(data, one), finding.augmented) for one in finding.ranking],
        "ranked": _RANKED,
        "power": [
            (words(name), name, say(one.parameter), quantity(one.size, one.unit))
            for name, found in finding.power.items()
            for one in (shown_size(data, name, found),)
        ],
    }


def _data(finding: Finding) -> dict[str, Any]:
    """Returns the data set's part of the page: its runs by role, its faults and its noise."""
    return {
        "runs": {role: [name for name, one in finding.roles.items() if one == role] for role in ROLES},
        "faults": [discover_tables.fault(one, finding) for one in finding.faults],
        "listed": _LISTED,
        "wheels": finding.dataset.vehicle == "motor" or any(name.startswith("wheel") for name in finding.noise_sd),
        "noise": [
            (say(name), quantity(own.size(sd), own.unit))
            for name, sd in finding.noise_sd.items()
            for own in (own_unit(finding.dataset, name),)
        ],
        "frames": frames(finding.dataset),
        "notes": told(finding.dataset, list(finding.notes)),
    }


def _gap_chart(finding: Finding) -> Markup:
    """Draws the gap of each role and each signal, before and after."""
    rows = [(label, gap.before, gap.after) for name, label in _ROLE_ROWS if (gap := finding.gap.get(name)) is not None]
    rows += [(say(name), gap.before, gap.after) for name, gap in finding.by_signal.items()]
    text = "; ".join(f"{label} {gap_text(before)} to {gap_text(after)}" for label, before, after in rows)
    return discover_plots.gaps(
        rows, single=finding.verdict == "none", title=f"Gap before and after, over noise: {text}"
    )


def _warnings(finding: Finding) -> list[str]:
    """Returns the sentences that limit the trust in the verdict."""
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
    """Returns the autocorrelation of each signal's residual as a chart with its caption; the words follow its size."""
    found = []
    for signal, one in finding.whiteness.items():
        outside = sum(abs(value) > one.bound for value in one.correlation)
        count = f"{outside} of {len(one.correlation)} lags lie outside the band"
        title = f"Autocorrelation of the residual of {say(signal)}: {count}"
        chart = discover_plots.autocorrelation(one, title=title)
        size = finding.by_signal.get(signal, Gap(None, None)).after
        is_noise = one.white and (size is None or size <= OVER_NOISE)
        says = "white" if is_noise else f"{gap_text(size)} times the noise" if one.white else "not white"
        found.append({"signal": say(signal), "white": is_noise, "says": says, "count": count, "chart": chart})
    return found


def _remaining(finding: Finding) -> list[str]:
    """Returns sentences on the residual of the augmented model. They say noise only if its size fits."""
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


def _experiment(finding: Finding) -> dict[str, Any] | None:
    """Returns the proposed experiment with the chart and the break points of its manoeuvre."""
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


def _pair(gap: Gap | None) -> tuple[str, str]:
    return gap_text(None if gap is None else gap.before), gap_text(None if gap is None else gap.after)
