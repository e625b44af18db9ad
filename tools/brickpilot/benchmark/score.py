"""Scores of the blind test, from its results alone: one record a set, as `benchmark` writes them.

A record holds the truth (`hidden`: effect -> parameter -> value, SI) and the verdict. What an explanation names is
compared by name; parameters are compared where the name is right.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

Result = Mapping[str, Any]

VISIBLE = 5.0
"""Noise sd, rms, in some signal: from here on an effect is called clearly visible."""

AMONG = {"imu+encoders": 3, "imu": 4}
"""Most names that an `ambiguous` verdict may hold, by what was measured."""
AMBIGUOUS_CREDIT = {"imu+encoders": 0.5, "imu": 1.0}
"""What it then counts."""
REMOVED = 0.8
"""Of the held-out gap: what a composed term must take away."""

_Z = 1.959964  # of 95 %
_FULL_TURN = 2 * math.pi


@dataclass(frozen=True)
class Share:
    """`hits` (halves are possible) out of `of`, and the interval of Wilson 1927 for 95 %. No sets: all None."""

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
    """By what is hidden: "none", "single", "pairs", "triples" or "odd"; "unmade" where the set could not be made."""
    hidden = result["hidden"]
    if hidden is None:
        return "unmade"
    if any(name.startswith("odd_") for name in hidden):
        return "odd"
    return ("none", "single", "pairs")[len(hidden)] if len(hidden) < 3 else "triples"


def move(result: Result) -> float:
    """Noise sd, rms: how far what is hidden moves the signal that it moves most."""
    return float(max(result["visibility"].values(), default=0.0))


def visible(result: Result) -> bool:
    """Whether what is hidden changes some signal by `VISIBLE` noise sd rms or more."""
    return move(result) >= VISIBLE


def detected(result: Result) -> bool:
    """Whether anything is said to be missing."""
    return result["verdict"] in ("named", "ambiguous", "unknown")


def any_named(result: Result) -> bool:
    """Whether the verdict is `named`."""
    return bool(result["verdict"] == "named")


def named(result: Result) -> list[str]:
    """The effects of the best explanation, the strongest first; none where the verdict is `none` or there is none."""
    return [effect["name"] for effect in result.get("effects", ())]


def explanations(result: Result) -> list[frozenset[str]]:
    """All explanations that the verdict leaves open, the best first; each the names of its effects."""
    best = frozenset(named(result))
    others = [other["name"] for effect in result.get("effects", ()) for other in effect["equivalents"]]
    return [best, *(frozenset(other.split(" + ")) for other in others)] if best else []


def found(result: Result) -> frozenset[str]:
    """The effects that the verdict stands for: what all the explanations it leaves open have in common."""
    left = explanations(result)
    return frozenset.intersection(*left) if left else frozenset()


def credit(result: Result) -> float:
    """What a set with hidden effects counts, 0 to 1.

    1: `named`, the true name first; of several effects, all of them among the names. An `ambiguous` verdict counts
    `AMBIGUOUS_CREDIT` where some explanation holds all that is hidden, and all of them together at most `AMONG` names
    for each effect that is hidden.
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
    """Whether a name is given with confidence that is not hidden: `named`, or beside a composed term."""
    return result["verdict"] in ("named", "unknown") and bool(set(named(result)) - set(result["hidden"]))


def right(result: Result) -> bool:
    """Whether the verdict is all that can be said: `none`, `unknown`, or the true names and no other."""
    expected = {"none": "none", "odd": "unknown"}.get(kind(result), "named")
    return (
        not result.get("error")
        and result["verdict"] == expected
        and (expected != "named" or set(named(result)) == set(result["hidden"]))
    )


def decided(result: Result) -> bool:
    """Whether the verdict after the suggested experiment is `right`."""
    return right({**result, **result["follow"]})


def parameter_errors(results: Iterable[Result], *, main: bool) -> list[float]:
    """Relative errors of the fitted parameters of rightly named effects.

    An effect's main parameter is the first that it lists, which is its size. Parameters that are truly zero have no
    relative error, and an angle none either: its error is taken over pi.
    """
    errors = []
    for effect, truth in _rightly_named(results):
        for name, value in list(effect["parameters"].items())[: 1 if main else None]:
            true = truth.get(name)
            if true is None or (true == 0 and not _periodic(name)):
                continue
            error = _apart(name, value["value"], true)
            errors.append(abs(error) / (math.pi if _periodic(name) else abs(true)))
    return errors


def intervals_hold(results: Iterable[Result]) -> Share:
    """How many of the 95 % intervals of rightly named effects hold the true value."""
    held = []
    for effect, truth in _rightly_named(results):
        for name, value in effect["parameters"].items():
            if value["ci95"] is None or name not in truth:
                continue
            low, high = value["ci95"]
            middle = 0.5 * (low + high)
            held.append(abs(_apart(name, middle, truth[name])) <= 0.5 * (high - low))
    return Share(sum(held), len(held))


def _rightly_named(results: Iterable[Result]) -> Iterable[tuple[Mapping[str, Any], Mapping[str, float]]]:
    for result in results:
        if result["verdict"] == "named" and set(named(result)) == set(result["hidden"]):
            for effect in result["effects"]:
                yield effect, result["hidden"][effect["name"]]


def _periodic(parameter: str) -> bool:
    return parameter in ("phase", "phase_difference")


def _apart(parameter: str, value: float, true: float) -> float:
    apart = value - true
    return apart - _FULL_TURN * round(apart / _FULL_TURN) if _periodic(parameter) else apart


def whole(result: Result) -> bool:
    """Whether all that is hidden is found."""
    return set(result["hidden"]) <= found(result)


def clean_part(result: Result) -> bool:
    """Whether at least one of what is hidden is found, and nothing else."""
    return bool(found(result)) and found(result) <= set(result["hidden"])


def composed(result: Result) -> bool:
    """Whether the verdict is `unknown` with a term that takes away `REMOVED` of the held-out gap."""
    removed = result["held_out"]["removed"] if result["verdict"] == "unknown" and result.get("term") else None
    return removed is not None and removed >= REMOVED
