"""The claims of each quick suite: shares with Wilson's interval, medians with an interval from order statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.stats import binom

from lab import law_score
from lab.claims import Claim, Wanted, share_of
from lab.score import Result, Share, detected, intervals_hold

_NULLS = 200  # least number of sets with nothing hidden from which a share is meaningful
_WORDS = {
    "same": "one effect, by the library's law",
    "other": "one effect, by another law",
    "outside": "one effect outside every law of the library",
    "nulls": "nothing hidden, six kinds of robots",
    "nominal": "a nominal value that is wrong",
    "scales": "robots of 0.3, 2.5 and 8 kg",
}


def by_suite(results: Sequence[Result]) -> dict[str, list[Claim]]:
    """Returns title of a quick suite -> its claims, for each suite that has results."""
    found = {}
    for group in law_score.GROUPS:
        mine = [one for one in results if one.get("group") == group]
        if mine:
            found[f"{group}: {_WORDS[group]}"] = list(_CLAIMS[group](mine))
    return found


def _named_alone(results: Sequence[Result]) -> Iterator[Claim]:
    yield share_of("mechanism right", results, law_score.mechanism_right, (0.95, 1.0))
    yield share_of("law right, or said to differ", results, law_score.law_right, (0.90, 1.0))
    yield share_of("first name right, claimed or suspected", results, law_score.name_right)
    yield share_of("a wrong name given as certain", results, law_score.false_names)
    told = [one for one in results if one.get("held") is not None]  # older results lack the explanations
    yield share_of("95 % sets of explanations that hold the right mechanism", told, law_score.set_holds, (0.90, 0.99))
    held = intervals_hold(results)
    yield Claim("95 % intervals that hold the truth", held.value, held.of, held.interval, "%", (0.90, 0.99))
    yield from _places(results)
    shares = [
        one["held_out"]["removed"]
        for one in results
        if one["verdict"] == "named" and one["held_out"]["removed"] is not None
    ]
    yield median("when named: share of the held-out gap removed", shares, "", (0.8, 1.0))
    yield share_of(
        "when named: the held-out gap grows",
        [one for one in results if one["verdict"] == "named" and one["held_out"]["removed"] is not None],
        lambda one: one["held_out"]["removed"] < 0,
        (0.0, 0.0),
    )
    yield from _times(results)


def _outside(results: Sequence[Result]) -> Iterator[Claim]:
    yield share_of("mechanism right", results, law_score.mechanism_right)
    yield share_of("said to differ: unknown, mechanism right", results, law_score.law_right)
    yield share_of("a wrong name given as certain", results, law_score.false_names, (0.0, 0.05))
    yield from _places(results)
    yield from _times(results)


def _clean(results: Sequence[Result]) -> Iterator[Claim]:
    yield share_of("a name given as certain", results, law_score.false_names, (0.0, 0.02), _NULLS)
    yield share_of("something is said to be missing", results, detected)
    yield share_of("a nominal value is said to be wrong", results, lambda one: bool(one["left_prior"]))
    yield from _times(results)


def _nominal(results: Sequence[Result]) -> Iterator[Claim]:
    yield share_of("the wrong value is reported", results, law_score.nominal_found)
    yield share_of("a wrong name given as certain", results, law_score.false_names)
    yield from _times(results)


def _scales(results: Sequence[Result]) -> Iterator[Claim]:
    hiding = [one for one in results if one["hidden"]]
    clean = [one for one in results if not one["hidden"]]
    yield share_of("mechanism right", hiding, law_score.mechanism_right, (0.95, 1.0))
    yield share_of("law right, or said to differ", hiding, law_score.law_right, (0.90, 1.0))
    yield share_of("a wrong name given as certain", hiding, law_score.false_names)
    yield share_of("nothing hidden: a name given as certain", clean, law_score.false_names, (0.0, 0.02), _NULLS)
    yield from _places(hiding)
    yield from _times(results)


def _places(results: Sequence[Result]) -> Iterator[Claim]:
    said = [one for one in results if detected(one)]
    scores = [score for one in said if (score := law_score.overlap(one).f1) is not None]
    yield median("where, F1 of time by run and signal", scores, "", (0.8, 1.0))
    pairs = [law_score.condition_share(one) for one in said]
    share = Share(sum(right for right, _ in pairs), sum(of for _, of in pairs))
    yield Claim("where: the condition is the known region's", share.value, share.of, share.interval)


def _times(results: Sequence[Result]) -> Iterator[Claim]:
    spent = [one["cpu_s"] for one in results if one.get("cpu_s") is not None]
    yield median("processor time", spent, "s")
    yield share_of("sets that ended in an error", results, lambda one: bool(one.get("error")), (0.0, 0.0))


def median(what: str, values: Sequence[float], unit: str, wanted: Wanted | None = None) -> Claim:
    """Returns a claim on the median. Its 95 % interval comes from order statistics, so it assumes no distribution.

    With fewer than six values there is no such interval.
    """
    ordered, count = sorted(values), len(values)
    rank = int(binom.ppf(0.025, count, 0.5))
    held = rank > 0 and count >= 6
    interval = (ordered[rank - 1], ordered[count - rank]) if held else None
    return Claim(what, float(np.median(ordered)) if count else None, count, interval, unit, wanted)


_CLAIMS: dict[str, Callable[[Sequence[Result]], Iterator[Claim]]] = {
    "same": _named_alone,
    "other": _named_alone,
    "outside": _outside,
    "nulls": _clean,
    "nominal": _nominal,
    "scales": _scales,
}
