"""The score of one result of the blind test (see result.py).

A result holds the truth (`hidden`: effect -> parameter -> value, SI) and the verdict. Explanations are compared by the
names of their effects. Parameters are compared only if the names are right.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

Result = Mapping[str, Any]

VISIBLE = 5.0
"""The least rms change, in noise sd, of the most changed signal by a clearly visible effect."""

AMONG = {"imu+encoders": 3, "imu": 4}
"""Sensors -> the largest number of names per hidden effect with which an `ambiguous` verdict has credit."""
AMBIGUOUS_CREDIT = {"imu+encoders": 0.5, "imu": 1.0}
"""Sensors -> the credit of an `ambiguous` verdict."""
REMOVED = 0.8
"""A composed term has to remove at least this share of the held-out gap."""

_Z = 1.959964  # quantile of the normal distribution for 95 %
_FULL_TURN = 2 * math.pi


@dataclass(frozen=True)
class Share:
    """`hits` of `of` sets; half a hit is possible. Value and Wilson's 95 % interval (1927) are None if `of` is 0."""

    hits: float
    of: int

    @property
    def value(self) -> float | None:
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float] | None:
        if not self.of:
            return None
        n, p, z2 = self.of, self.hits / self.of, _Z * _Z
        centre = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z / (1 + z2 / n) * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)


def kind(result: Result) -> str:
    """Returns the kind of hidden effects: "none", "single", "pairs", "triples" or "odd"; "unmade": no set."""
    hidden = result["hidden"]
    if hidden is None:
        return "unmade"
    if any(name.startswith("odd_") for name in hidden):
        return "odd"
    return ("none", "single", "pairs")[len(hidden)] if len(hidden) < 3 else "triples"


def move(result: Result) -> float:
    """Returns the rms, in noise sd, by which the hidden effects change the most changed signal."""
    return float(max(result["visibility"].values(), default=0.0))


def visible(result: Result) -> bool:
    """Returns whether the hidden effects are clearly visible: see `VISIBLE`."""
    return move(result) >= VISIBLE


def detected(result: Result) -> bool:
    """Returns whether the verdict says that something is missing."""
    return result["verdict"] in ("named", "ambiguous", "unknown")


def any_named(result: Result) -> bool:
    """Returns whether the verdict is `named`."""
    return bool(result["verdict"] == "named")


def named(result: Result) -> list[str]:
    """Returns the effects of the best explanation; empty if the verdict names no effect."""
    return [effect["name"] for effect in result.get("effects", ())]


def explanations(result: Result) -> list[frozenset[str]]:
    """Returns the effect names of each explanation that the verdict leaves open, the best explanation first."""
    best = frozenset(named(result))
    others = [other["name"] for effect in result.get("effects", ()) for other in effect["equivalents"]]
    return [best, *(frozenset(other.split(" + ")) for other in others)] if best else []


def found(result: Result) -> frozenset[str]:
    """Returns the effects that all open explanations have in common."""
    left = explanations(result)
    return frozenset.intersection(*left) if left else frozenset()


def credit(result: Result) -> float:
    """Returns the credit of a set with hidden effects, 0 to 1.

    `named` counts 1 if the true name comes first or, with several effects, if all true names are among the names.
    `ambiguous` counts `AMBIGUOUS_CREDIT` if one explanation contains all hidden effects, and all explanations together
    have at most `AMONG` names for each hidden effect.
    """
    truth = set(result["hidden"])
    if result.get("error") or not truth:
        return 0.0
    if result["verdict"] == "named":
        names = named(result)
        return float(names[:1] == list(truth) if len(truth) == 1 else truth <= set(names))
    if result["verdict"] == "ambiguous":
        left = explanations(result)
        few = len(frozenset.union(*left)) <= AMONG[result["sensors"]] * len(truth)
        return AMBIGUOUS_CREDIT[result["sensors"]] if few and any(truth <= one for one in left) else 0.0
    return 0.0


def wrong(result: Result) -> bool:
    """Returns whether a `named` verdict, or an `unknown` verdict beside its composed term, claims a wrong name."""
    return result["verdict"] in ("named", "unknown") and bool(set(named(result)) - set(result["hidden"]))


def right(result: Result) -> bool:
    """Returns whether the verdict is the best possible: `none`, `unknown`, or exactly the true names."""
    expected = {"none": "none", "odd": "unknown"}.get(kind(result), "named")
    return (
        not result.get("error")
        and result["verdict"] == expected
        and (expected != "named" or set(named(result)) == set(result["hidden"]))
    )


def decided(result: Result) -> bool:
    """Returns whether the verdict after the next experiment is `right`."""
    return right({**result, **result["follow"]})


def parameter_errors(results: Iterable[Result], *, main: bool) -> list[float]:
    """Returns relative errors of the fitted parameters of rightly named effects.

    A true value of zero has no relative error and is left out. The error of an angle is divided by pi.

    Args:
        main: whether to use only the first parameter that an effect lists, which is its size.
    """
    errors = []
    for effect, truth in _rightly_named(results):
        for name, value in list(effect["parameters"].items())[: 1 if main else None]:
            true = truth.get(name)
            if true is None or (true == 0 and not _periodic(name)):
                continue
            error = _difference(name, value["value"], true)
            errors.append(abs(error) / (math.pi if _periodic(name) else abs(true)))
    return errors


def intervals_hold(results: Iterable[Result]) -> Share:
    """Returns the share of 95 % intervals that contain the true value, for parameters of rightly named effects."""
    holding = []
    for effect, truth in _rightly_named(results):
        for name, value in effect["parameters"].items():
            if value["ci95"] is None or name not in truth:
                continue
            low, high = value["ci95"]
            middle = 0.5 * (low + high)
            holding.append(abs(_difference(name, middle, truth[name])) <= 0.5 * (high - low))
    return Share(sum(holding), len(holding))


def _rightly_named(results: Iterable[Result]) -> Iterable[tuple[Mapping[str, Any], Mapping[str, float]]]:
    for result in results:
        if result["verdict"] == "named" and set(named(result)) == set(result["hidden"]):
            for effect in result["effects"]:
                yield effect, result["hidden"][effect["name"]]


def _periodic(parameter: str) -> bool:
    return parameter in ("phase", "phase_difference")


def _difference(parameter: str, value: float, true: float) -> float:
    difference = value - true
    return difference - _FULL_TURN * round(difference / _FULL_TURN) if _periodic(parameter) else difference


def whole(result: Result) -> bool:
    """Returns whether all hidden effects are found."""
    return set(result["hidden"]) <= found(result)


def clean_part(result: Result) -> bool:
    """Returns whether at least one hidden effect is found, and no other effect."""
    return bool(found(result)) and found(result) <= set(result["hidden"])


def composed(result: Result) -> bool:
    """Returns whether the verdict is `unknown` with a term that removes `REMOVED` of the held-out gap."""
    removed = result["held_out"]["removed"] if result["verdict"] == "unknown" and result.get("term") else None
    return removed is not None and removed >= REMOVED
