"""Tunes the peer: gates by what it finds in clean sets, window and share by the names that it finds in others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from brickpilot.benchmark.score import Result, Share, clean_part, credit, detected, kind, right, visible, whole
from brickpilot.benchmark.sindy import METHODS, SHARES, WINDOWS_S, Setting, nameable, verdict_of
from brickpilot.errors import InputError

_FALSE = 0.02  # of the clean sets may get a name
_LEAST_GATE = 3.0  # log likelihood: about what BIC asks of a term for a few hundred samples


@dataclass(frozen=True)
class Tuned:
    """One point of the grid.

    Attributes:
        false: share of clean sets that get a name.
        right, alone: shares of clearly visible single effects that are named first, and named alone.
        whole, part: shares of pairs of which both effects are found; at least one and no false one.
    """

    method: str
    setting: Setting
    false: Share
    right: Share
    alone: Share
    whole: Share
    part: Share

    @property
    def score(self) -> float:
        """Mean of the four shares that should be high; of the first two if there are no pairs."""
        shares = [one.value for one in (self.right, self.alone, self.whole, self.part) if one.value is not None]
        return sum(shares) / len(shares)


def tune(results: Sequence[Result]) -> list[Tuned]:
    """Returns every method at every point of the grid, with gates that let at most 2 % of the clean sets pass.

    Args:
        results: of a benchmark on calibration seeds with the peer's whole grid: clean sets, single effects and, if
            there are any, pairs.

    Raises:
        InputError: no clean sets or single effects among them.
    """
    given = [one for one in results if one.get("peer") and all(f"{w:g}" in one["peer"] for w in WINDOWS_S)]
    clean = [one for one in given if kind(one) == "none"]
    hidden = [one for one in given if kind(one) in ("single", "pairs") and nameable(one["hidden"])]
    single = [one for one in hidden if kind(one) == "single" and visible(one)]
    pairs = [one for one in hidden if kind(one) == "pairs"]
    sensors = sorted({str(one["sensors"]) for one in (*single, *pairs)})
    if not single or any(not [one for one in clean if one["sensors"] == name] for name in sensors):
        raise InputError(
            "clean sets and single effects are needed, run with --peer sindy-grid on calibration seeds", field="RESULTS"
        )
    found = []
    for method, window_s, share in product(METHODS, WINDOWS_S, SHARES):
        gate = {
            name: _gate([_first(one, method, window_s) for one in clean if one["sensors"] == name]) for name in sensors
        }
        setting = Setting(window_s, share, gate)
        said, named, both = (
            [verdict_of(one, method, setting) for one in among]
            for among in ([one for one in clean if one["sensors"] in gate], single, pairs)
        )
        found.append(
            Tuned(
                method,
                setting,
                Share(sum(map(detected, said)), len(said)),
                Share(sum(map(credit, named)), len(named)),
                Share(sum(map(right, named)), len(named)),
                Share(sum(map(whole, both)), len(both)),
                Share(sum(map(clean_part, both)), len(both)),
            )
        )
    return found


def best(found: Sequence[Tuned]) -> list[Tuned]:
    """Returns the point of the highest score for each method."""
    return [max((one for one in found if one.method == method), key=lambda one: one.score) for method in METHODS]


def _first(result: Result, method: str, window_s: float) -> float:
    """Returns what the first term gains: it decides whether a set gets a name at all."""
    gains = result["peer"][f"{window_s:g}"][method]["gains"]
    return float(gains[0]) if gains else 0.0


def _gate(gains: Sequence[float]) -> float:
    """Returns the least gate that lets at most `_FALSE` of these gains pass."""
    ordered = sorted(gains, reverse=True)
    highest = ordered[int(_FALSE * len(ordered))]
    return max(_LEAST_GATE, 1.001 * highest)


def to_json(found: Sequence[Tuned]) -> list[dict[str, Any]]:
    """Returns one object for each point of the grid."""
    chosen = best(found)
    return [
        {
            "method": one.method,
            "window_s": one.setting.window_s,
            "share": one.setting.share,
            "gate": dict(one.setting.gate),
            "false": one.false.value,
            "right": one.right.value,
            "alone": one.alone.value,
            "pairs_both": one.whole.value,
            "pairs_part": one.part.value,
            "sets": {"clean": one.false.of, "single": one.right.of, "pairs": one.whole.of},
            "best": one in chosen,
        }
        for one in found
    ]


def lines(found: Sequence[Tuned]) -> Iterator[str]:
    """Yields the grid as text. A star marks the best point of each method."""
    sizes = found[0]
    yield f"{sizes.false.of} clean sets, {sizes.right.of} single effects, {sizes.whole.of} pairs"
    yield f"  {'method':8}{'window':>9}{'share':>7}{'false':>8}{'first':>8}{'alone':>8}{'both':>8}{'part':>8}   gates"
    chosen = best(found)
    for one in found:
        shares = (one.false, one.right, one.alone, one.whole, one.part)
        text = "".join(f"{'-' if s.value is None else format(100 * s.value, '.1f'):>8}" for s in shares)
        gates = ", ".join(f"{name} {gate:.1f}" for name, gate in one.setting.gate.items())
        mark = "*" if one in chosen else " "
        yield f"{mark} {one.method:8}{one.setting.window_s:7g} s{one.setting.share:7g}{text}   {gates}"
