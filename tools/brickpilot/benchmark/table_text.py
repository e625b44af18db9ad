"""The table of the blind test as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields the lines of what `table.table` returns."""
    offsets = ", ".join(map(str, table["seed_offsets"])) or "not known"
    yield f"{table['sets']} sets of {' and '.join(table['engines'])}, seed offsets: {offsets}"
    yield "In brackets: 95 % intervals (Wilson). [+]: what is asked for holds; [-]: it does not."
    for group, made in table["claims"].items():
        yield ""
        yield f"== claims, {group} =="
        for one in made:
            if one["of"]:
                mark = {True: "[+]", False: "[-]", None: "   "}[one["holds"]]
                figures = f"{_value(one):>9} {_interval(one['interval']):17}{_wanted(one):>12}"
                yield f"{mark} {one['what']:84}{figures}  of {one['of']}"
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


def _value(claim: dict[str, Any]) -> str:
    if claim["value"] is None:
        return "-"
    return _percent(claim["value"]) if claim["unit"] == "%" else f"{claim['value']:.3g} {claim['unit']}".strip()


def _interval(interval: Sequence[float] | None) -> str:
    return "" if interval is None else f"({100 * interval[0]:.1f}..{100 * interval[1]:.1f})"


def _wanted(claim: dict[str, Any]) -> str:
    if claim["wanted"] is None:
        return ""
    low, high = claim["wanted"]
    scale, unit = (100, " %") if claim["unit"] == "%" else (1, f" {claim['unit']}".rstrip())
    if low == high:
        return f"= {scale * low:g}{unit}"
    if high == 1.0 and claim["unit"] == "%":
        return f">= {scale * low:g}{unit}"
    return f"<= {scale * high:g}{unit}" if low == 0 else f"{scale * low:g}..{scale * high:g}{unit}"
