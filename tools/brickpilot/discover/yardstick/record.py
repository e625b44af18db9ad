"""The figures of the yardstick, as verdict.json and the page show them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Fit:
    """How well one signal is simulated at one horizon, in percent: 100 is perfect, 0 is as good as a constant.

    It is 100 (1 - rms(measured - simulated) / rms(measured - its mean)), over all samples of all runs of a role. None:
    there is no such run, or the signal hardly moves in it.

    Attributes:
        before, after: of the calibrated nominal model and of the augmented model.
        attainable: what a model could reach at least: of a black box that knows no law and predicts runs that it has
            not seen, or of `before` or `after` if that is more.
    """

    before: float | None
    after: float | None
    attainable: float | None


@dataclass(frozen=True)
class SignalFit:
    """One signal at one horizon.

    Attributes:
        repeatability: fit in percent of a perfect model, as far as repeats of the same inputs tell: two repeats differ
            by what no model can know. None: nothing was repeated.
    """

    fit: Fit
    held_out: Fit
    repeatability: float | None

    def to_json(self) -> dict[str, Any]:
        held_out = dataclasses.asdict(self.held_out)
        return {**dataclasses.asdict(self.fit), "repeatability": self.repeatability, "held_out": held_out}


@dataclass(frozen=True)
class Source:
    """A group of what the black box was told.

    Attributes:
        what: "input", "speed", "direction" and so on.
        share: the share of the predictable error that it loses if this group is shuffled, 0..1. Groups that say the
            same stand in for one another, so the shares need not add up to 1.
    """

    what: str
    share: float


@dataclass(frozen=True)
class Predictable:
    """How much of the nominal model's error is predictable at one horizon.

    Shares are of the squared error, each signal in units of its own variance. Predictable is what the black box takes
    away on runs that it has not seen.

    Attributes:
        share: the share of the error on the fit runs that is predictable, 0..1; `interval` holds it in 95 % of draws
            of stretches of 1 s.
        held_out, held_out_interval: the same on the held-out runs, predicted from the fit runs alone.
        removed, removed_held_out: the share of the predictable error that the augmented model takes away; negative
            where it makes the error larger, 1 if it takes away more than the black box. None: nothing is predictable.
        by_run: run -> its share of all predictable error.
        sources: what the error is predicted from, what counts most first.
    """

    share: float | None
    interval: tuple[float, float] | None
    held_out: float | None
    held_out_interval: tuple[float, float] | None
    removed: float | None
    removed_held_out: float | None
    by_run: Mapping[str, float]
    sources: tuple[Source, ...]

    def to_json(self) -> dict[str, Any]:
        return {
            "share": self.share,
            "ci95": None if self.interval is None else list(self.interval),
            "removed": self.removed,
            "held_out": {
                "share": self.held_out,
                "ci95": None if self.held_out_interval is None else list(self.held_out_interval),
                "removed": self.removed_held_out,
            },
            "by_run": dict(self.by_run),
            "from": [dataclasses.asdict(one) for one in self.sources],
        }


@dataclass(frozen=True)
class Yardstick:
    """What a real machine can be held to. See the package's page.

    Attributes:
        signals: signal -> horizon -> fit.
        predictable: horizon -> how much of the nominal model's error is predictable.
        notes: sentences on what is absent, and on how unseen data were made where there is one run alone.
    """

    signals: Mapping[str, Mapping[str, SignalFit]] = field(default_factory=dict)
    predictable: Mapping[str, Predictable] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def fit_json(self) -> dict[str, Any]:
        """Returns `fit_percent` of verdict.json."""
        return {
            signal: {horizon: one.to_json() for horizon, one in fits.items()} for signal, fits in self.signals.items()
        }

    def predictable_json(self) -> dict[str, Any]:
        """Returns `predictable` of verdict.json."""
        return {horizon: one.to_json() for horizon, one in self.predictable.items()}


def percent(value: float) -> float | None:
    """Returns `value` to a thousandth, or None if it is no number: JSON has neither NaN nor Infinity."""
    return round(float(value), 3) if math.isfinite(value) else None


def share(value: float) -> float | None:
    """Returns `value` to a ten-thousandth, or None if it is no number."""
    return round(float(value), 4) if math.isfinite(value) else None
