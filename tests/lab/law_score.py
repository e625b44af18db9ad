"""Scores one result of a quick suite by mechanism, law, name, nominal value and place (see result.py).

For every hidden effect, a quick suite states its law: a law of the library ("same"), another law of a mechanism that
the library knows ("other"), or a law outside the library ("odd"). The suite also states the regions in which the effect
is visible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from brickpilot import catalogue
from numpy.typing import NDArray

from lab.score import Result, explanations, named

GROUPS = ("same", "other", "outside", "nulls", "nominal", "scales")

ADEQUATE = 1.1
"""Largest ratio of held-out residual to noise floor at which the data cannot separate a law from the true law."""

_GRID_S = 0.01  # step of the grid on which places are compared


@dataclass(frozen=True)
class Overlap:
    """Time, s, summed over signals, in which the verdict (said), the truth (known), or both place the effect."""

    said: float
    known: float
    both: float

    @property
    def f1(self) -> float | None:
        """The F1 score; None if no region is known."""
        return 2 * self.both / (self.said + self.known) if self.known else None


def _laws(result: Result) -> Sequence[Mapping[str, Any]]:
    return list(result["laws"].values())


def true_mechanisms(result: Result) -> frozenset[str]:
    """Returns the right mechanisms; for laws of the library, the mechanisms of the catalogue."""
    right: set[str] = set()
    for law in _laws(result):
        right |= set(law["mechanisms"] or (catalogue.effect(name).mechanism for name in law["names"]))
    return frozenset(right)


def true_names(result: Result) -> frozenset[str]:
    """Returns the right names; an odd law has no right name."""
    return frozenset(name for law in _laws(result) for name in law["names"])


def _is_called(name: str, right: frozenset[str]) -> bool:
    """Returns whether `name` is one of `right`, or a law of the same family."""
    return name in right or catalogue.family(name) in {catalogue.family(one) for one in right}


def first_names(result: Result) -> list[str]:
    """Returns the effects of the best explanation, claimed or only suspected."""
    return named(result) or [effect["name"] for effect in result["suspected"]]


def said_mechanism(result: Result) -> str | None:
    """Returns the mechanism of the verdict, or of the first name if the verdict gives no mechanism."""
    if result.get("error") or result["verdict"] == "none":
        return None
    said = result["mechanism"]
    names = first_names(result)
    return said or (catalogue.effect(names[0]).mechanism if names else None)


def mechanism_right(result: Result) -> bool:
    """Returns whether the verdict says that something is missing and gives a right mechanism."""
    return said_mechanism(result) in true_mechanisms(result)


def set_holds(result: Result) -> bool:
    """Returns whether one of the explanations that together hold 95 % of the weight has a right mechanism."""
    right = true_mechanisms(result)
    return any(right & {*mechanisms} for mechanisms in result.get("held") or ())


def name_right(result: Result) -> bool:
    """Returns whether the first name, claimed or suspected, is a right name or in the family of a right name."""
    names = [] if result.get("error") else first_names(result)[:1]
    right = true_names(result)
    return bool(right) and bool(names) and _is_called(names[0], right)


def law_right(result: Result) -> bool:
    """Returns whether the verdict is right about the law.

    For a law of the library, its name or a name of its family has to be claimed, alone or among rivals, and the verdict
    must not state that the law differs. For another law, the verdict has to be `unknown` with the right mechanism, or
    to claim a right name and state that its law differs. A right name without this statement counts if the residual on
    held-out runs is noise, so that the data cannot separate both laws.
    """
    if result.get("error"):
        return False
    relation = {law["law"] for law in _laws(result)}
    if result["verdict"] == "unknown":
        return relation != {"same"} and mechanism_right(result)
    if result["verdict"] not in ("named", "ambiguous"):
        return False
    right = true_names(result)
    alone = [one for one in explanations(result) if all(_is_called(name, right) for name in one)]
    if not right or not alone:
        return False
    differs = bool(result.get("law_differs"))
    if relation == {"same"}:
        return not differs
    left = result["held_out"]["after"]
    return differs or (left is not None and left <= ADEQUATE)


def false_names(result: Result) -> list[str]:
    """Returns the names claimed as certain that are neither right nor of the same family as a right name."""
    if result.get("error") or result["verdict"] != "named":
        return []
    right = true_names(result) | set(result.get("called", ()))
    return [name for name in named(result) if not _is_called(name, right)] if right else named(result)


def nominal_found(result: Result) -> bool:
    """Returns whether a wrong nominal value is reported: the value leaves its prior, or an effect that causes the same
    difference is claimed or suspected."""
    wrong = set(result["wrong"])
    told = {name for one in explanations(result) for name in one} | set(first_names(result))
    return not result.get("error") and bool(wrong & set(result["left_prior"]) or told & set(result["called"]))


def overlap(result: Result) -> Overlap:
    """Returns the seconds, summed over signals, in which the places of the verdict overlap the known regions."""
    said, known = (_by_signal(result[key]) for key in ("where", "regions"))
    empty = np.zeros(0, dtype=bool)
    both = 0
    for key in said.keys() & known.keys():
        shortest = min(len(said[key]), len(known[key]))
        both += int((said[key][:shortest] & known[key][:shortest]).sum())
    sizes = [sum(int(one.sum()) for one in (*side.values(), empty)) for side in (said, known)]
    return Overlap(sizes[0] * _GRID_S, sizes[1] * _GRID_S, both * _GRID_S)


def _by_signal(spans: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], NDArray[np.bool_]]:
    """Returns (run, signal) -> whether each step of the grid is in a span."""
    found: dict[tuple[str, str], NDArray[np.bool_]] = {}
    for span in spans:
        key = (str(span["run"]), str(span["signal"]))
        first, last = max(round(span["from_s"] / _GRID_S), 0), max(round(span["to_s"] / _GRID_S), 0)
        old = found.get(key, np.zeros(0, dtype=bool))
        grown = np.zeros(max(last, len(old)), dtype=bool)
        grown[: len(old)] = old
        grown[first:last] = True
        found[key] = grown
    return found


def condition_share(result: Result) -> tuple[float, int]:
    """Returns how many places overlap a region and state its condition, and how many places overlap a region."""
    right = counted = 0
    for place in result["where"]:
        near = [one for one in result["regions"] if (one["run"], one["signal"]) == (place["run"], place["signal"])]
        shared = [min(one["to_s"], place["to_s"]) - max(one["from_s"], place["from_s"]) for one in near]
        if near and max(shared) > 0:
            counted += 1
            right += near[int(np.argmax(shared))]["when"] == place["when"]
    return right, counted
