"""The claims of the blind test: the required performance of discovery, as shares and figures over many results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lab.score import (
    REMOVED,
    Result,
    Share,
    any_named,
    clean_part,
    composed,
    credit,
    decided,
    detected,
    intervals_hold,
    kind,
    parameter_errors,
    right,
    visible,
    whole,
    wrong,
)

SENSORS = {"imu+encoders": "wheel speeds measured", "imu": "IMU alone"}

_LEAST_CLEAN = 100  # a share of the sets with nothing hidden is meaningful from this number of sets on
_ANSWER_S = 15.0
_OVER_FLOOR = 1.1

Wanted = tuple[float, float]


@dataclass(frozen=True)
class Claim:
    """One line of the table.

    Attributes:
        what: the claim in words.
        value: a share if `unit` is "%", otherwise a figure in `unit`; None: there are no sets.
        of: the number of sets or parameters that count.
        interval: the 95 % interval of a share.
        wanted: the required range, (lowest, highest); None: nothing is required.
        least: least number of sets; with fewer sets, `holds` is None.
    """

    what: str
    value: float | None
    of: int
    interval: tuple[float, float] | None = None
    unit: str = "%"
    wanted: Wanted | None = None
    least: int = 1

    @property
    def holds(self) -> bool | None:
        if self.wanted is None or self.value is None or self.of < self.least:
            return None
        return self.wanted[0] - 1e-12 <= self.value <= self.wanted[1] + 1e-12

    def to_json(self) -> dict[str, Any]:
        return {
            "what": self.what,
            "value": self.value,
            "of": self.of,
            "interval": self.interval,
            "unit": self.unit,
            "wanted": self.wanted,
            "holds": self.holds,
        }


def share_of(
    what: str,
    among: Sequence[Result],
    count: Callable[[Result], Any],
    wanted: Wanted | None = None,
    least: int = 1,
) -> Claim:
    """Returns the claim on the mean of `count` over `among`. `count` gives 0 to 1; True counts as 1."""
    share = Share(sum(_counted(count(one)) for one in among), len(among))
    return Claim(what, share.value, share.of, share.interval, "%", wanted, least)


def _counted(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float(bool(value))


def _figure(
    what: str, values: Sequence[float], of: Callable[[Any], Any], unit: str, wanted: Wanted | None = None
) -> Claim:
    return Claim(what, float(of(values)) if len(values) else None, len(values), None, unit, wanted)


def claims(results: Sequence[Result]) -> list[Claim]:
    """Returns all claims on the long suites, with or without a required value."""
    of = {name: [one for one in results if kind(one) == name] for name in ("single", "none", "pairs", "triples", "odd")}
    return [
        *_single(of["single"]),
        *_ambiguous(results),
        *_clean(of["none"]),
        *_several("pairs", of["pairs"], "both", (0.85, 1.0), (0.95, 1.0)),
        *_several("triples", of["triples"], "all three", None, None),
        *_odd(of["odd"]),
        *_fitted(results),
        *_times(results),
    ]


def _single(results: Sequence[Result]) -> Iterator[Claim]:
    for sensors, label in SENSORS.items():
        mine = [one for one in results if one["sensors"] == sensors]
        clear = [one for one in mine if visible(one)]
        yield share_of(f"single, clearly visible, {label}: right name", clear, credit, (0.95, 1.0))
        yield share_of(f"single, clearly visible, {label}: named, and no other name", clear, right)
        yield share_of(f"single, all sizes, {label}: right name", mine, credit)
        yield share_of(f"single, all sizes, {label}: something is said to be missing", mine, detected)
    clear = [one for one in results if visible(one)]
    yield share_of("single, clearly visible: a wrong name given as certain", clear, wrong)


def _ambiguous(results: Sequence[Result]) -> Iterator[Claim]:
    unsure = [one for one in results if one["verdict"] == "ambiguous"]
    made = [one for one in unsure if one.get("follow")]
    yield share_of("any set: ambiguous", results, lambda one: one["verdict"] == "ambiguous")
    single = [one for one in made if kind(one) == "single"]
    yield share_of("ambiguous, single: the next experiment decides rightly", single, decided, (0.90, 1.0))
    yield share_of("ambiguous, any set: the next experiment decides rightly", made, decided)
    yield share_of("ambiguous: no experiment that the engine can make", unsure, lambda one: not one.get("follow"))


def _clean(results: Sequence[Result]) -> Iterator[Claim]:
    for percent in (2, 0, 5):
        among = [one for one in results if round(100 * one["nominal_error"]) == percent]
        what = f"nothing hidden, nominal values {percent} % off: an effect is named or suspected"
        if percent == 2:
            yield share_of(what, among, detected, (0.0, 0.02), _LEAST_CLEAN)
        else:
            yield share_of(what, among, detected)
    yield share_of("nothing hidden: a wrong nominal value named as an effect", results, any_named, (0.0, 0.0))


def _several(
    suite: str, results: Sequence[Result], every: str, all_wanted: Wanted | None, one_wanted: Wanted | None
) -> Iterator[Claim]:
    yield share_of(f"{suite}: {every} found", results, whole, all_wanted)
    yield share_of(f"{suite}: {every}, ambiguous verdicts counted as for single ones", results, credit)
    yield share_of(f"{suite}: at least one found and no false one", results, clean_part, one_wanted)


def _odd(results: Sequence[Result]) -> Iterator[Claim]:
    clear = [one for one in results if visible(one)]
    what = f"unknown, with a term that removes {100 * REMOVED:.0f} % of the held-out gap"
    yield share_of(f"outside the library, clearly visible: {what}", clear, composed, (0.85, 1.0))
    yield share_of("outside the library, all sizes: the same", results, composed)
    yield share_of("outside the library: a wrong name given as certain", results, wrong, (0.0, 0.05))


def _fitted(results: Sequence[Result]) -> Iterator[Claim]:
    clear = [one for one in results if visible(one)]
    for what, main in (("the size", True), ("all parameters", False)):
        errors = parameter_errors(clear, main=main)
        yield _figure(f"rightly named, clearly visible: median error of {what}", errors, np.median, "%", (0.0, 0.05))
    yield _figure(
        "rightly named, all sizes: median error of the size", parameter_errors(results, main=True), np.median, "%"
    )
    for what, among, wanted in (("clearly visible", clear, (0.90, 0.99)), ("all sizes", results, None)):
        held = intervals_hold(among)
        text = f"rightly named, {what}: 95 % intervals that hold the truth"
        yield Claim(text, held.value, held.of, held.interval, "%", wanted)
    named = [one for one in clear if right(one) and kind(one) != "odd"]
    left = [one["held_out"]["after"] for one in named if one["held_out"]["after"] is not None]
    text = "rightly named, clearly visible: held-out residual over the noise floor"
    yield _figure(f"{text}, median", left, np.median, "", (0.0, _OVER_FLOOR))
    yield _figure(f"{text}, 95th percentile", left, lambda values: np.percentile(values, 95), "")


def _times(results: Sequence[Result]) -> Iterator[Claim]:
    times = [one["elapsed_s"] for one in results if one.get("elapsed_s") is not None]
    yield _figure("time to answer, median", times, np.median, "s", (0.0, _ANSWER_S))
    yield _figure("time to answer, worst", times, np.max, "s", (0.0, _ANSWER_S))
    yield share_of("sets that ended in an error", results, lambda one: bool(one.get("error")), (0.0, 0.0))
