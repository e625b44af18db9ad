"""The table of the blind test as text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any


def lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields the lines of what `table.table` returns."""
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
    yield from _peer_lines(table["peer"])
    if table["errors"]:
        yield ""
        yield "== errors =="
        yield from (f"{name}: {text}" for name, text in table["errors"].items())


def headline(table: Mapping[str, Any]) -> str:
    """Returns what was run, in a line."""
    offsets = ", ".join(map(str, table["seed_offsets"])) or "not known"
    return f"{table['sets']} sets of {' and '.join(table['engines'])}, seed offsets: {offsets}"


def sections(table: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """Returns title -> those claims of it that count any set; a title without such a claim is left out."""
    titles = {f"claims, {group}": made for group, made in table["claims"].items()}
    titles |= {f"suite {name}": made for name, made in table["suites"].items()}
    counted = {title: [one for one in made if one["of"]] for title, made in titles.items()}
    return {title: made for title, made in counted.items() if made}


MARKS = ("<!-- hidden effects -->", "<!-- end of hidden effects -->")
"""They enclose the quick suites' table on a page."""


def write(table: Mapping[str, Any], folder: Path) -> None:
    """Writes FOLDER/table.json, everything, and FOLDER/table.md, the quick suites."""
    (folder / "table.json").write_text(json.dumps(table, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    (folder / "table.md").write_text("\n".join(markdown(table)) + "\n", encoding="utf-8")


def _claim_line(one: Mapping[str, Any]) -> str:
    mark = {True: "[+]", False: "[-]", None: "   "}[one["holds"]]
    return f"{mark} {one['what']:84}{_value(one):>9} {_spread(one):17}{_wanted(one):>12}  of {one['of']}"


def markdown(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields the lines of the quick suites' table for a page."""
    yield "| suite | figure | result | 95 % interval | of | asked for |"
    yield "|---|---|---|---|---|---|"
    for name, made in table["suites"].items():
        suite, _, words = name.partition(": ")
        for one in made:
            if one["of"]:
                what = f"{words}: {one['what']}" if one is made[0] else one["what"]
                yield f"| {' | '.join((f'`{suite}`', what, *claim_cells(one)))} |"


def claim_cells(claim: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the result of a claim, its 95 % interval, of how many, and what is asked for; "-" for none."""
    cells = (_value(claim), _spread(claim).strip("()"), str(claim["of"]), _wanted(claim))
    return tuple(cell.strip() or "-" for cell in cells)


def _power_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yields a line for each effect and set of sensors: share that is right and change in noise sd at each size."""
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


def _peer_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    if not rows:
        return
    names = list(rows[0]["by"])
    yield ""
    yield "== beside PySINDy, on the same sets; sets with effects only where its library has them =="
    yield f"{'':60}{'sets':>6}" + "".join(f"{name:>28}" for name in names)
    for one in rows:
        cells = "".join(
            f"{_percent(one['by'][name]['value']):>11} {_interval(one['by'][name]['interval']):16}" for name in names
        )
        yield f"{one['what']:60}{one['of']:6d}{cells}".rstrip()


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
