"""The table of the blind test, from its results alone: what is claimed, the power curves, and the peer beside it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from brickpilot.benchmark.score import (
    REMOVED,
    VISIBLE,
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
    move,
    parameter_errors,
    right,
    visible,
    whole,
    wrong,
)
from brickpilot.benchmark.sindy import BIC_ALONE, METHODS, nameable, verdict_of

_SENSORS = {"imu+encoders": "wheel speeds measured", "imu": "IMU alone"}
_BINS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, math.inf)  # noise sd, of the power curve over all effects
_LEAST_CLEAN = 100  # sets with nothing hidden below which their share says nothing
_ANSWER_S = 15.0
_OVER_FLOOR = 1.1

Wanted = tuple[float, float]


@dataclass(frozen=True)
class Claim:
    """One line of the table.

    Attributes:
        what: in words.
        value: a share where `unit` is "%", else a figure in `unit`; None where no set tells.
        of: sets, or parameters, that it is of.
        interval: 95 %, of a share of sets.
        wanted: lowest and highest that is asked for, where something is.
        least: sets below which `holds` stays open.
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


def _share(
    what: str,
    among: Sequence[Result],
    count: Callable[[Result], float],
    wanted: Wanted | None = None,
    least: int = 1,
) -> Claim:
    share = Share(sum(float(count(one)) for one in among), len(among))
    return Claim(what, share.value, share.of, share.interval, "%", wanted, least)


def _figure(
    what: str, values: Sequence[float], of: Callable[[Any], Any], unit: str, wanted: Wanted | None = None
) -> Claim:
    return Claim(what, float(of(values)) if len(values) else None, len(values), None, unit, wanted)


def claims(results: Sequence[Result]) -> list[Claim]:
    """What discovery is asked to show, and what stands beside each of it."""
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
    for sensors, label in _SENSORS.items():
        mine = [one for one in results if one["sensors"] == sensors]
        clear = [one for one in mine if visible(one)]
        yield _share(f"single, clearly visible, {label}: right name", clear, credit, (0.95, 1.0))
        yield _share(f"single, clearly visible, {label}: named, and right alone", clear, right)
        yield _share(f"single, all sizes, {label}: right name", mine, credit)
        yield _share(f"single, all sizes, {label}: something said to be missing", mine, detected)
    clear = [one for one in results if visible(one)]
    yield _share("single, clearly visible: a wrong name given as sure", clear, wrong)


def _ambiguous(results: Sequence[Result]) -> Iterator[Claim]:
    unsure = [one for one in results if one["verdict"] == "ambiguous"]
    made = [one for one in unsure if one.get("follow")]
    yield _share("any set: ambiguous", results, lambda one: one["verdict"] == "ambiguous")
    single = [one for one in made if kind(one) == "single"]
    yield _share("ambiguous, single: the suggested experiment decides rightly", single, decided, (0.90, 1.0))
    yield _share("ambiguous, any set: the suggested experiment decides rightly", made, decided)
    yield _share("ambiguous: none suggested that the engine can make", unsure, lambda one: not one.get("follow"))


def _clean(results: Sequence[Result]) -> Iterator[Claim]:
    for percent in (2, 0, 5):
        among = [one for one in results if round(100 * one["nominal_error"]) == percent]
        what = f"nothing hidden, nominal values {percent} % off: an effect all the same"
        if percent == 2:
            yield _share(what, among, detected, (0.0, 0.02), _LEAST_CLEAN)
        else:
            yield _share(what, among, detected)
    yield _share("nothing hidden: a wrong nominal value named as an effect", results, any_named, (0.0, 0.0))


def _several(
    suite: str, results: Sequence[Result], every: str, all_wanted: Wanted | None, one_wanted: Wanted | None
) -> Iterator[Claim]:
    yield _share(f"{suite}: {every} found", results, whole, all_wanted)
    yield _share(f"{suite}: {every}, ambiguous verdicts counted as for single ones", results, credit)
    yield _share(f"{suite}: at least one found and no false one", results, clean_part, one_wanted)


def _odd(results: Sequence[Result]) -> Iterator[Claim]:
    clear = [one for one in results if visible(one)]
    what = f"unknown, with a term that removes {100 * REMOVED:.0f} % of the held-out gap"
    yield _share(f"off-library, clearly visible: {what}", clear, composed, (0.85, 1.0))
    yield _share("off-library, all sizes: the same", results, composed)
    yield _share("off-library: a wrong name given as sure", results, wrong, (0.0, 0.05))


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
    yield _share("sets that ended in an error", results, lambda one: bool(one.get("error")), (0.0, 0.0))


def power(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Each hidden effect at each size, with either set of sensors: shares of sets found and found rightly."""
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
            "said": Counter(_said(one) for one in among).most_common(1)[0][0],
        }
        for (effect, sensors, size), among in sorted(cells.items())
    ]


def _said(result: Result) -> str:
    if result["verdict"] in ("none", "error"):
        return str(result["verdict"])
    names = " + ".join(effect["name"] for effect in result["effects"])
    return names if result["verdict"] == "named" else f"{result['verdict']} {names}".strip()


def curve(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Detection power over all single effects, by how far they move the signal that they move most, in noise sd rms."""
    rows = []
    for sensors in _SENSORS:
        for low, high in pairwise(_BINS):
            among = [
                one
                for one in results
                if kind(one) == "single" and one["sensors"] == sensors and low <= move(one) < high
            ]
            if among:
                seen = Share(sum(map(detected, among)), len(among))
                good = Share(sum(map(credit, among)), len(among))
                rows.append(
                    {
                        "sensors": sensors,
                        "from": low,
                        "to": None if math.isinf(high) else high,
                        "sets": len(among),
                        "detected": seen.value,
                        "detected_interval": seen.interval,
                        "right": good.value,
                        "right_interval": good.interval,
                    }
                )
    return rows


def side_by_side(results: Sequence[Result]) -> list[dict[str, Any]]:
    """The peer's verdicts scored as ours, on the sets it was given; those with effects where its library names all."""
    both = [one for one in results if one.get("peer") and not one.get("error")]
    if not both:
        return []
    views: dict[str, Callable[[Result], Result]] = {"brickpilot": lambda one: one}
    views |= {f"PySINDy {method}": partial(verdict_of, method=method) for method in (*METHODS, BIC_ALONE)}
    judged: list[tuple[str, list[Result], Callable[[Result], float]]] = []
    for sensors, label in _SENSORS.items():
        clear = [one for one in both if kind(one) == "single" and visible(one) and one["sensors"] == sensors]
        judged.append((f"single, clearly visible, {label}: right name", clear, credit))
        judged.append((f"single, clearly visible, {label}: named, and right alone", clear, right))
    clear = [one for one in both if kind(one) == "single" and visible(one)]
    judged += [
        ("single, clearly visible: a wrong name given as sure", clear, wrong),
        ("nothing hidden: an effect all the same", [one for one in both if kind(one) == "none"], detected),
    ]
    for suite, every in (("pairs", "both"), ("triples", "all three")):
        among = [one for one in both if kind(one) == suite]
        judged.append((f"{suite}: {every} found", among, whole))
        judged.append((f"{suite}: at least one found and no false one", among, clean_part))
    judged.append(("off-library: a wrong name given as sure", [one for one in both if kind(one) == "odd"], wrong))
    rows = []
    for what, among, count in judged:
        among = [one for one in among if kind(one) in ("none", "odd") or nameable(one["hidden"])]
        shares = {
            name: Share(sum(float(count(view(one))) for one in among), len(among)) for name, view in views.items()
        }
        if among:
            rows.append(
                {
                    "what": what,
                    "of": len(among),
                    "by": {name: {"value": one.value, "interval": one.interval} for name, one in shares.items()},
                }
            )
    return rows


def table(results: Sequence[Result]) -> dict[str, Any]:
    """Everything that is printed, as one object."""
    engines = sorted({str(one["engine"]) for one in results})
    groups = {"all": list(results)}
    if len(engines) > 1:
        groups |= {engine: [one for one in results if one["engine"] == engine] for engine in engines}
    return {
        "sets": len(results),
        "engines": engines,
        "seed_offsets": sorted({one["seed_offset"] for one in results if one["seed_offset"] is not None}),
        "versions": sorted({one["version"] for one in results}),
        "visible_from_noise_sd": VISIBLE,
        "claims": {group: [claim.to_json() for claim in claims(among)] for group, among in groups.items()},
        "power": power(results),
        "curve": curve(results),
        "peer": side_by_side(results),
        "errors": {one["name"]: one["error"] for one in results if one.get("error")},
    }
