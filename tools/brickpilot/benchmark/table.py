"""The table of the blind test, from its results alone: claims, power curves, and the peer beside discovery."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from brickpilot.benchmark.claims import SENSORS, claims
from brickpilot.benchmark.law_claims import by_suite
from brickpilot.benchmark.score import (
    VISIBLE,
    Result,
    Share,
    clean_part,
    composed,
    credit,
    detected,
    kind,
    move,
    right,
    visible,
    whole,
    wrong,
)
from brickpilot.benchmark.sindy import BIC_ALONE, METHODS, nameable, verdict_of

_BINS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, math.inf)  # of the power curve over all effects, in noise sd


def power(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Returns for each effect, size and set of sensors the share of sets detected, and rightly named."""
    cells: dict[tuple[str, str, float], list[Result]] = {}
    for one in results:
        if kind(one) in ("single", "odd") and one["size"] is not None:
            cells.setdefault((next(iter(one["hidden"])), one["sensors"], one["size"]), []).append(one)
    return [
        {
            "effect": effect,
            "sensors": sensors,
            "size": size,
            "sets": len(among),
            "detected": Share(sum(map(detected, among)), len(among)).value,
            "right": Share(sum((composed if kind(one) == "odd" else credit)(one) for one in among), len(among)).value,
            "visibility": float(np.median([move(one) for one in among])),
            "said": Counter(said(one) for one in among).most_common(1)[0][0],
        }
        for (effect, sensors, size), among in sorted(cells.items())
    ]


def said(result: Result) -> str:
    """Returns the verdict and the effects of its best explanation."""
    if result["verdict"] in ("none", "error"):
        return str(result["verdict"])
    names = " + ".join(effect["name"] for effect in result["effects"])
    return names if result["verdict"] == "named" else f"{result['verdict']} {names}".strip()


def curve(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Returns the detection power over all single effects, by the largest change of a signal in noise sd, rms."""
    rows = []
    for sensors in SENSORS:
        for low, high in pairwise(_BINS):
            among = [
                one
                for one in results
                if kind(one) == "single" and one["sensors"] == sensors and low <= move(one) < high
            ]
            if among:
                any_verdict = Share(sum(map(detected, among)), len(among))
                good = Share(sum(map(credit, among)), len(among))
                rows.append(
                    {
                        "sensors": sensors,
                        "from": low,
                        "to": None if math.isinf(high) else high,
                        "sets": len(among),
                        "detected": any_verdict.value,
                        "detected_interval": any_verdict.interval,
                        "right": good.value,
                        "right_interval": good.interval,
                    }
                )
    return rows


Compared = tuple[str, list[Result], Callable[[Result], float]]
"""A line of the comparison: its words, the sets, and what each set counts."""


def side_by_side(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Returns the verdicts of the peer, scored as ours, on the sets that it was given.

    Sets with hidden effects count only if the library of the peer has a column for each.
    """
    both = [one for one in results if one.get("peer") and not one.get("error")]
    if not both:
        return []
    views: dict[str, Callable[[Result], Result]] = {"brickpilot": lambda one: one}
    views |= {f"PySINDy {method}": partial(verdict_of, method=method) for method in (*METHODS, BIC_ALONE)}
    rows = []
    for what, sets, count in _compared(both):
        among = [one for one in sets if kind(one) in ("none", "odd") or nameable(one["hidden"])]
        shares = {
            name: Share(sum(float(count(view(one))) for one in among), len(among)) for name, view in views.items()
        }
        if among:
            by = {name: {"value": one.value, "interval": one.interval} for name, one in shares.items()}
            rows.append({"what": what, "of": len(among), "by": by})
    return rows


def _compared(both: Sequence[Result]) -> list[Compared]:
    """Returns the lines of the comparison."""
    single = [one for one in both if kind(one) == "single" and visible(one)]
    lines: list[Compared] = []
    for sensors, label in SENSORS.items():
        clear = [one for one in single if one["sensors"] == sensors]
        lines.append((f"single, clearly visible, {label}: right name", clear, credit))
        lines.append((f"single, clearly visible, {label}: named, and no other name", clear, right))
    lines.append(("single, clearly visible: a wrong name given as certain", single, wrong))
    lines.append(("nothing hidden: an effect is named or suspected", [o for o in both if kind(o) == "none"], detected))
    for suite, every in (("pairs", "both"), ("triples", "all three")):
        among = [one for one in both if kind(one) == suite]
        lines.append((f"{suite}: {every} found", among, whole))
        lines.append((f"{suite}: at least one found and no false one", among, clean_part))
    lines.append(("outside the library: a wrong name given as certain", [o for o in both if kind(o) == "odd"], wrong))
    return lines


def table(results: Sequence[Result]) -> dict[str, Any]:
    """Returns everything that is printed, as one object."""
    engines = sorted({str(one["engine"]) for one in results})
    long = [one for one in results if not one.get("group")]
    groups = {"all": long}
    if len(engines) > 1:
        groups |= {engine: [one for one in long if one["engine"] == engine] for engine in engines}
    return {
        "sets": len(results),
        "engines": engines,
        "seed_offsets": sorted({one["seed_offset"] for one in results if one["seed_offset"] is not None}),
        "versions": sorted({one["version"] for one in results}),
        "visible_from_noise_sd": VISIBLE,
        "claims": {group: [claim.to_json() for claim in claims(among)] for group, among in groups.items()},
        "suites": {name: [claim.to_json() for claim in made] for name, made in by_suite(results).items()},
        "power": power(long),
        "curve": curve(long),
        "peer": side_by_side(long),
        "errors": {one["name"]: one["error"] for one in results if one.get("error")},
    }
