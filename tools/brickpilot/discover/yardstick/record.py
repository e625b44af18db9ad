"""The figures of the yardstick, as verdict.json and the page show them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from brickpilot.data.agreement import Agreement
from brickpilot.data.signals import SIGNALS


@dataclass(frozen=True)
class Numbers:
    """R2 about the mean, and rms of error and signal in SI; see `data.agreement`. None: there is no such number."""

    r2: float | None
    rms_error: float | None
    rms_signal: float | None

    @classmethod
    def of(cls, one: Agreement) -> Numbers:
        return cls(one.r2, one.rms_error, one.rms_signal)


@dataclass(frozen=True)
class Fit:
    """How well one signal is simulated at one horizon, in percent of the signal: see `data.agreement`.

    It is over all samples of all runs of a role. None: there is no such run, or the signal is no more than its noise.

    Attributes:
        before, after: of the calibrated nominal model and of the augmented model.
        attainable: what a model could reach at least: of a black box that knows no law and predicts runs that it has
            not seen, or of `before` or `after` if that is more.
        numbers_before, numbers_after: the other headline numbers of the two models.
    """

    before: float | None
    after: float | None
    attainable: float | None
    numbers_before: Numbers = field(default_factory=lambda: Numbers(None, None, None))
    numbers_after: Numbers = field(default_factory=lambda: Numbers(None, None, None))

    def to_json(self) -> dict[str, Any]:
        first, last = self.numbers_before, self.numbers_after
        return {
            "before": self.before,
            "after": self.after,
            "attainable": self.attainable,
            "r2": {"before": first.r2, "after": last.r2},
            "rms_error": {"before": first.rms_error, "after": last.rms_error},
            "rms_signal": last.rms_signal,
        }


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
        return {**self.fit.to_json(), "repeatability": self.repeatability, "held_out": self.held_out.to_json()}


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
            signal: {horizon: {**one.to_json(), "unit": SIGNALS[signal].unit} for horizon, one in fits.items()}
            for signal, fits in self.signals.items()
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
