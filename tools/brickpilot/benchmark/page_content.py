"""What the pages of the benchmark show: the cells of the tables, and the numbers behind them for the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from brickpilot.benchmark import law_score, real_table, score, table, table_text
from brickpilot.benchmark.peers import PEERS
from brickpilot.benchmark.real_logs import RealLog
from brickpilot.benchmark.real_results import judged_on, models, pooled
from brickpilot.benchmark.real_score import ROLES

Result = Mapping[str, Any]


def hidden(results: Sequence[Result], found: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the content of the page on hidden effects; `found` is what `table.table` returns of the results."""
    return {
        "headline": table_text.headline(found),
        "versions": found["versions"],
        "sections": {
            title: [{**one, "cells": table_text.claim_cells(one)} for one in made]
            for title, made in table_text.sections(found).items()
        },
        "sets": sorted(
            map(_set, results),
            key=lambda one: (one["right"], one["suite"], one["name"], one["engine"], str(one["seed"])),
        ),
    }


def _set(result: Result) -> dict[str, Any]:
    """Returns the row of one set. What its truth does not tell is None."""
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
    """Returns whether one set counts as right in all that its suite asks: see `score.right` for the long suites."""
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
    """Returns model -> fit percent of one log by role; "nominal" is calibrated, "discover" the written model."""
    found = models(result)
    entries = {"nominal": found.get("before"), "discover": found.get("after")}
    entries |= {peer.name: result.get("peers", {}).get(peer.name) for peer in PEERS}
    return {
        "name": result["name"],
        "role": judged_on(result),
        "attainable": real_table.attainable(result),
        "models": {name: {role: pooled(entry, role) for role in ROLES} for name, entry in entries.items()},
    }
