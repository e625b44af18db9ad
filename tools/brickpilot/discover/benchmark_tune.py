"""Tunes the peer of the blind test: window by the names it finds, gates by what it finds where nothing is hidden."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from brickpilot.discover.benchmark_score import Result, Share, credit, detected, kind, visible
from brickpilot.discover.benchmark_sindy import METHODS, WINDOWS_S, Setting, nameable, verdict_of
from brickpilot.errors import InputError

_FALSE = 0.02
_LEAST_GATE = 3.0  # log likelihood: about what BIC asks of a term among a few hundred samples


@dataclass(frozen=True)
class Tuned:
    """One point of the grid. `false`: clean sets that get a name; `right`: credit of clearly visible single effects."""

    method: str
    setting: Setting
    false: Share
    right: Share


def tune(results: Sequence[Result]) -> list[Tuned]:
    """Every method at every window, with the gates at which it names an effect in at most 2 % of the clean sets.

    Args:
        results: of a benchmark on calibration seeds, made with the peer's whole grid: clean sets and single effects.

    Raises:
        InputError: no such sets among them.
    """
    given = [one for one in results if one.get("peer") and all(f"{w:g}" in one["peer"] for w in WINDOWS_S)]
    clean = [one for one in given if kind(one) == "none"]
    single = [one for one in given if kind(one) == "single" and visible(one) and nameable(one["hidden"])]
    sensors = sorted({str(one["sensors"]) for one in single})
    if not single or any(not [one for one in clean if one["sensors"] == name] for name in sensors):
        raise InputError(
            "clean sets and single effects are needed, run with --peer sindy-grid on calibration seeds", field="RESULTS"
        )
    found = []
    for method in METHODS:
        for window_s in WINDOWS_S:
            gate = {
                name: _gate([_first(one, method, window_s) for one in clean if one["sensors"] == name])
                for name in sensors
            }
            setting = Setting(window_s, gate)
            said = [verdict_of(one, method, setting) for one in clean if one["sensors"] in gate]
            named = [verdict_of(one, method, setting) for one in single]
            found.append(
                Tuned(
                    method,
                    setting,
                    Share(sum(map(detected, said)), len(said)),
                    Share(sum(map(credit, named)), len(named)),
                )
            )
    return found


def _first(result: Result, method: str, window_s: float) -> float:
    """What the first term gains; all of it hangs on that one."""
    gains = result["peer"][f"{window_s:g}"][method]["gains"]
    return float(gains[0]) if gains else 0.0


def _gate(gains: Sequence[float]) -> float:
    """The least that lets at most `_FALSE` of these pass."""
    ordered = sorted(gains, reverse=True)
    highest = ordered[int(_FALSE * len(ordered))]
    return max(_LEAST_GATE, 1.001 * highest)


def to_json(found: Sequence[Tuned]) -> list[dict[str, Any]]:
    """One object for each point of the grid."""
    return [
        {
            "method": one.method,
            "window_s": one.setting.window_s,
            "gate": dict(one.setting.gate),
            "false": one.false.value,
            "clean_sets": one.false.of,
            "right": one.right.value,
            "single_sets": one.right.of,
        }
        for one in found
    ]


def lines(found: Sequence[Tuned]) -> Iterator[str]:
    """The grid as text, and for each method the point that is best."""
    yield f"{'method':8}{'window':>9}{'right':>9}{'false':>9}   gates, log likelihood held out"
    for one in found:
        gates = ", ".join(f"{name} {gate:.1f}" for name, gate in one.setting.gate.items())
        right, false = (f"{100 * (share.value or 0.0):.1f} %" for share in (one.right, one.false))
        yield f"{one.method:8}{one.setting.window_s:7g} s{right:>9}{false:>9}   {gates}"
    for method in METHODS:
        best = max((one for one in found if one.method == method), key=lambda one: one.right.value or 0.0)
        yield f"best {method}: {best.setting.window_s:g} s, by {best.right.of} effects and {best.false.of} clean sets"
