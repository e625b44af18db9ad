"""The pages of the benchmark: on hidden effects, and on real logs.

`hidden` and `real` turn results into plain content: the cells of the tables and the numbers for the charts.
`hidden_page` and `real_page` only draw this content.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brickpilot.report.plot import Colour, row_chart
from brickpilot.report.quantities import DASH, ROLES
from brickpilot.report.template import render
from markupsafe import Markup, escape

from lab import law_score, real_score, real_table, score, table
from lab.peers import PEERS
from lab.real_logs import RealLog
from lab.real_results import judged_on, models, pooled

_HERE = Path(__file__).parent
_HOLDS: dict[bool | None, tuple[str, Colour]] = {
    True: ("met", "blue"),
    False: ("not met", "orange"),
    None: ("nothing asked, or too few sets", "grey"),
}
_LEAST = 0.0  # lower end of a chart, percent; smaller values are drawn at this end


def hidden_page(content: Mapping[str, Any]) -> str:
    """Returns the page on hidden effects as one self-contained HTML text."""
    return render(
        "benchmark",
        folder=_HERE,
        title="Benchmark: hidden effects",
        headline=content["headline"],
        versions=content["versions"],
        sections=[(title, _claims_chart(title, made), made) for title, made in content["sections"].items()],
        sets=[_shown_set(one) for one in content["sets"]],
        logs=None,
    )


def _claims_chart(title: str, claims: Sequence[Mapping[str, Any]]) -> Markup | None:
    """Draws the claims whose value is a percentage, with their row numbers in the table; None: no such claim."""
    shares = [(number, one) for number, one in enumerate(claims, 1) if one["unit"] == "%" and one["value"] is not None]
    if not shares:
        return None
    curves = {
        words: (colour, [100 * one["value"] if one["holds"] is holds else None for _, one in shares])
        for holds, (words, colour) in _HOLDS.items()
        if any(one["holds"] is holds for _, one in shares)
    }
    text = "; ".join(f"{one['what']} {one['cells'][0]}" for _, one in shares)
    return row_chart(
        [f"{number}  {one['what']}" for number, one in shares],
        curves,
        [_percents(one["interval"]) for _, one in shares],
        "share",
        "%",
        title=f"{title}: {text}",
        asked=[_percents(one["wanted"]) for _, one in shares],
    )


def _percents(span: Sequence[float] | None) -> tuple[float, float] | None:
    return None if span is None else (100 * span[0], 100 * span[1])


def _shown_set(one: Mapping[str, Any]) -> dict[str, Any]:
    numbers = {key: DASH if one[key] is None else f"{one[key]:.2f}" for key in ("before", "after")}
    return {**one, **numbers, "seconds": DASH if one["seconds"] is None else f"{one['seconds']:.1f}"}


def real_page(content: Mapping[str, Any]) -> str:
    """Returns the page on real logs as one self-contained HTML text."""
    return render(
        "benchmark",
        folder=_HERE,
        title="Benchmark: real logs",
        remarks=[marked(one) for one in content["remarks"]],
        overview=_overview(content["logs"], content["peer"]),
        tables=[
            (words, content[head], [[marked(cell) for cell in row] for row in content[rows]])
            for words, head, rows in (
                ("Verdicts. The last column is the share of the predictable error that the written model removes on "
                 "the runs that judge.", "verdict_head", "verdicts"),
                ("Fit percent on held-out runs, in brackets on fit runs.", "fit_head", "fits"),
            )
        ],
        logs=[(one["name"], ROLES[one["role"]], _models_chart(one)) for one in content["logs"]],
    )  # fmt: skip


def marked(text: str) -> Markup:
    """Returns a line of Markdown as HTML: code marks are converted, all else is escaped."""
    parts = [escape(part) for part in text.split("`")]
    return Markup("").join(Markup("<code>{}</code>").format(part) if k % 2 else part for k, part in enumerate(parts))


def _overview(logs: Sequence[Mapping[str, Any]], peer: str) -> Markup:
    """Draws a row for each log: the fits of the nominal model, one peer and discovery, and the attainable fit."""
    columns: dict[str, Colour] = {"nominal": "grey", peer: "orange", "discover": "blue"}
    limit: dict[str, tuple[Colour, list[float | None]]] = {
        "attainable": ("green", [_place(one["attainable"]) for one in logs])  # drawn first, so other marks may cover it
    }
    curves = limit | {
        name: (colour, [_place(one["models"][name][one["role"]]) for one in logs]) for name, colour in columns.items()
    }
    return row_chart(
        [one["name"] for one in logs],
        curves,
        [None] * len(logs),
        "fit",
        "%",
        title=f"Fit of each log by the nominal model, by {peer} and by discover",
    )


def _models_chart(log: Mapping[str, Any]) -> Markup:
    """Draws a row for each model of one log: its fit on the fit runs and, if runs are held out, on held-out runs."""
    models, role = log["models"], log["role"]
    curves: dict[str, tuple[Colour, list[float | None]]] = {
        "fit runs": ("grey", [_place(one["fit"]) for one in models.values()])
    }
    if role == "held_out":
        curves["held-out runs"] = ("blue", [_place(one["held_out"]) for one in models.values()])
    text = "; ".join(f"{name} {_percent(one[role])}" for name, one in models.items())
    return row_chart(
        list(models),
        curves,
        [None] * len(models),
        "fit",
        "%",
        title=f"{log['name']}, {ROLES[role]}s: {text}",
        lines=() if log["attainable"] is None else (_place(log["attainable"]) or _LEAST,),
    )


def _place(value: float | None) -> float | None:
    return None if value is None else max(value, _LEAST)


def _percent(value: float | None) -> str:
    return DASH if value is None else f"{value:.1f} %"


Result = Mapping[str, Any]


def hidden(results: Sequence[Result], found: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the content of the page on hidden effects; `found`: the table of the results by `table.table`."""
    return {
        "headline": table.headline(found),
        "versions": found["versions"],
        "sections": {
            title: [{**one, "cells": table.claim_cells(one)} for one in made]
            for title, made in table.sections(found).items()
        },
        "sets": sorted(
            map(_set, results),
            key=lambda one: (one["right"], one["suite"], one["name"], one["engine"], str(one["seed"])),
        ),
    }


def _set(result: Result) -> dict[str, Any]:
    """Returns the row of one set. A value is None if the set's truth does not state it."""
    names = [*(result["hidden"] or ()), *(f"nominal {name}" for name in result.get("wrong", ()))]
    lawful = bool(result.get("laws"))
    return {
        "name": result["name"],
        "engine": result["engine"],
        "seed": result["seed"],
        "suite": result.get("group") or result.get("suite") or "",
        "hidden": ", ".join(names) or "nothing",
        "verdict": f"error: {result['error']}" if result.get("error") else table.said(result),
        "right": is_right(result),
        "mechanism": law_score.mechanism_right(result) if lawful else None,
        "law": law_score.law_right(result) if lawful else None,
        "before": result["held_out"]["before"],
        "after": result["held_out"]["after"],
        "seconds": result["elapsed_s"],
    }


def is_right(result: Result) -> bool:
    """Returns whether one set is right in all criteria of its suite; for the long suites see `score.right`."""
    if not result.get("group") or result.get("error"):
        return score.right(result)
    told = not law_score.false_names(result)
    if result["wrong"]:
        return told and law_score.nominal_found(result)
    return told and (not result["laws"] or (law_score.mechanism_right(result) and law_score.law_right(result)))


def real(results: Mapping[str, Result], known: Mapping[str, RealLog]) -> dict[str, Any]:
    """Returns the content of the page on real logs."""
    among = real_table.ordered(results, known)
    return {
        "verdict_head": (*real_table.VERDICT_HEAD, "removed"),
        "verdicts": [[*real_table.verdict_cells(one, known), _share(real_table.removed(one))] for one in among],
        "fit_head": real_table.FIT_HEAD,
        "fits": [real_table.fit_cells(one) for one in among],
        "remarks": real_table.remarks(among, known),
        "peer": PEERS[0].name,
        "logs": [_log(one) for one in among],
    }


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f} %"


def _log(result: Result) -> dict[str, Any]:
    """Returns name, role and attainable fit of one log, and model -> role -> fit. Fits are in percent.

    "nominal" is the calibrated nominal model, "discover" the written explanation, "predictor" that of `--predictor`.
    """
    found = models(result)
    entries = {"nominal": found.get("before"), "discover": found.get("after"), "predictor": found.get("predictor")}
    entries |= {peer.name: result.get("peers", {}).get(peer.name) for peer in PEERS}
    return {
        "name": result["name"],
        "role": judged_on(result),
        "attainable": real_table.attainable(result),
        "models": {name: {role: pooled(entry, role) for role in real_score.ROLES} for name, entry in entries.items()},
    }
