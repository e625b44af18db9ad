"""The table of the blind test, made only from the stored results: claims and power curves, as an object and as text."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lab import measured
from lab.claims import SENSORS, claims
from lab.law_claims import by_suite
from lab.score import (
    VISIBLE,
    Result,
    Share,
    composed,
    credit,
    detected,
    kind,
    move,
)

_BINS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, math.inf)  # edges of the bins of the power curve, in noise sd


def power(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Returns, for each effect, size and set of sensors, the share of detected and of rightly named data sets."""
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
    """Returns the verdict and the effects of the best explanation."""
    if result["verdict"] in ("none", "error"):
        return str(result["verdict"])
    names = " + ".join(effect["name"] for effect in result["effects"])
    return names if result["verdict"] == "named" else f"{result['verdict']} {names}".strip()


def curve(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Returns the detection power over all single effects, for bins of the largest rms change of a signal."""
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


def table(results: Sequence[Result]) -> dict[str, Any]:
    """Returns all printed results, as one object."""
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
        "measured": measured.told((one.get("measured") for one in results), "sets"),
        "visible_from_noise_sd": VISIBLE,
        "claims": {group: [claim.to_json() for claim in claims(among)] for group, among in groups.items()},
        "suites": {name: [claim.to_json() for claim in made] for name, made in by_suite(results).items()},
        "power": power(long),
        "curve": curve(long),
        "errors": {one["name"]: one["error"] for one in results if one.get("error")},
    }


def lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields the text lines of a result of `table`."""
    yield headline(table)
    yield "In brackets: 95 % intervals (Wilson). [+]: what is asked for holds; [-]: it does not."
    for title, counted in sections(table).items():
        yield ""
        yield f"== {title} =="
        yield from map(_claim_line, counted)
    if table["curve"]:
        yield ""
        yield "== detection power, single effects, by the largest change of a signal in noise sd rms =="
        yield f"{'sensors':16}{'change':>12}{'sets':>6}{'detected':>11}{'':17}{'right name':>11}"
        for one in table["curve"]:
            span = f"{one['from']:g}..{'' if one['to'] is None else format(one['to'], 'g')}"
            any_verdict = f"{_percent(one['detected']):>11} {_interval(one['detected_interval']):16}"
            good = f"{_percent(one['right']):>11} {_interval(one['right_interval'])}"
            yield f"{one['sensors']:16}{span:>12}{one['sets']:6d}{any_verdict}{good}"
    yield from _power_lines(table["power"])
    if table["errors"]:
        yield ""
        yield "== errors =="
        yield from (f"{name}: {text}" for name, text in table["errors"].items())


def headline(table: Mapping[str, Any]) -> str:
    """Returns one line on the sets that were run."""
    offsets = ", ".join(map(str, table["seed_offsets"])) or "not known"
    return f"{table['sets']} sets of {' and '.join(table['engines'])}, seed offsets: {offsets}"


def sections(table: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """Returns title -> the claims that rest on at least one set; a title without such claims is left out."""
    titles = {f"claims, {group}": made for group, made in table["claims"].items()}
    titles |= {f"suite {name}": made for name, made in table["suites"].items()}
    counted = {title: [one for one in made if one["of"]] for title, made in titles.items()}
    return {title: made for title, made in counted.items() if made}


MARKS = ("<!-- hidden effects -->", "<!-- end of hidden effects -->")
"""The marks before and after the quick suites' table on a page."""


def write(table: Mapping[str, Any], folder: Path) -> None:
    """Writes FOLDER/table.json, the whole table, and FOLDER/table.md, the quick suites."""
    (folder / "table.json").write_text(json.dumps(table, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    (folder / "table.md").write_text("\n".join(markdown(table)) + "\n", encoding="utf-8")


def _claim_line(one: Mapping[str, Any]) -> str:
    mark = {True: "[+]", False: "[-]", None: "   "}[one["holds"]]
    return f"{mark} {one['what']:84}{_value(one):>9} {_spread(one):17}{_wanted(one):>12}  of {one['of']}"


def markdown(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields a line on the sets and the state of the checkout, then the lines of the quick suites' table for a page."""
    yield f"{headline(table)}; {table['measured']}."
    yield ""
    yield "| suite | figure | result | 95 % interval | of | asked for |"
    yield "|---|---|---|---|---|---|"
    for name, made in table["suites"].items():
        suite, _, words = name.partition(": ")
        for one in made:
            if one["of"]:
                what = f"{words}: {one['what']}" if one is made[0] else one["what"]
                yield f"| {' | '.join((f'`{suite}`', what, *claim_cells(one)))} |"


def claim_cells(claim: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the result of a claim, its 95 % interval, its number of sets, and the value asked for; "-" for none."""
    cells = (_value(claim), _spread(claim).strip("()"), str(claim["of"]), _wanted(claim))
    return tuple(cell.strip() or "-" for cell in cells)


def _power_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yields a line per effect and set of sensors: share of right answers and change in noise sd, for each size."""
    sizes = sorted({one["size"] for one in rows})
    if not sizes:
        return
    yield ""
    yield "== by size: share of sets that are right, change in noise sd, and the verdicts where they are wrong =="
    yield f"{'effect':28}{'sensors':14}" + "".join(f"{f'x{size:g}':>16}" for size in sizes)
    cells = {(one["effect"], one["sensors"], one["size"]): one for one in rows}
    for effect, sensors in sorted({(one["effect"], one["sensors"]) for one in rows}):
        line, missed = f"{effect:28}{sensors:14}", []
        for size in sizes:
            one = cells.get((effect, sensors, size))
            line += f"{'':>16}" if one is None else f"{_percent(one['right']):>8}{one['visibility']:8.1f}"
            if one is not None and one["right"] < 1 and one["said"] not in missed:
                missed.append(one["said"])
        yield f"{line}  {'; '.join(missed)}".rstrip()


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"


def _spread(claim: Mapping[str, Any]) -> str:
    """Returns the interval of a share or of a figure."""
    if claim["unit"] == "%" or claim["interval"] is None:
        return _interval(claim["interval"])
    low, high = claim["interval"]
    return f"({low:.3g}..{high:.3g})"


def _value(claim: Mapping[str, Any]) -> str:
    if claim["value"] is None:
        return "-"
    return _percent(claim["value"]) if claim["unit"] == "%" else f"{claim['value']:.3g} {claim['unit']}".strip()


def _interval(interval: Sequence[float] | None) -> str:
    return "" if interval is None else f"({100 * interval[0]:.1f}..{100 * interval[1]:.1f})"


def _wanted(claim: Mapping[str, Any]) -> str:
    if claim["wanted"] is None:
        return ""
    low, high = claim["wanted"]
    scale, unit = (100, " %") if claim["unit"] == "%" else (1, f" {claim['unit']}".rstrip())
    if low == high:
        return f"= {scale * low:g}{unit}"
    if high == 1.0 and claim["unit"] == "%":
        return f">= {scale * low:g}{unit}"
    return f"<= {scale * high:g}{unit}" if low == 0 else f"{scale * low:g}..{scale * high:g}{unit}"
