"""Describes each difference of a machine as a quantity before and after, with an interval, and in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.stats import norm

from brickpilot import __version__, catalogue
from brickpilot.changed.differences import CONSTANTS, Difference
from brickpilot.changed.recordings import Onset
from brickpilot.data.dataset import Dataset
from brickpilot.data.shown import Result, valid
from brickpilot.data.signals import Array
from brickpilot.discover import numbers
from brickpilot.discover.finding import Step
from brickpilot.fit.parameters import values_of
from brickpilot.vehicle.combinations import FORMULAS, Formula
from brickpilot.vehicle.model import Model, with_values
from brickpilot.vehicle.replay import RUN_KINDS, in_recording
from brickpilot.vehicle.spread import Spread

if TYPE_CHECKING:
    import pandas

Answer = Literal["nothing", "changed", "ambiguous", "unknown"]

_STEP = 1e-3  # step of a coordinate of a `Spread`, for numerical derivatives
_QUANTILE = float(norm.ppf((1 + numbers.SURE) / 2))
_COMBINATION = {"viscous_friction": "kV", "wheel_inertia": "kA", "mass": "kA"}


@cache
def combinations() -> Mapping[str, str]:
    """Returns name -> the combination that reports its difference. Names: constants, and "effect.parameter" of torques.

    The data may determine a combination although they do not determine the constant or the torque alone.
    """
    rows = ((effect.name, row) for effect in catalogue.effects() for row in effect.parameters)
    return {**_COMBINATION, **{f"{effect}.{row.name}": row.in_volts for effect, row in rows if row.in_volts}}


@dataclass(frozen=True)
class Sized:
    """A value with its 95 % interval, (low, high)."""

    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Change:
    """One difference between two recordings.

    Attributes:
        recording: the name of the later recording that has the difference.
        what: an effect, a combination of constants (kV, kA, dry friction in volts) or a constant.
        mechanism: the part of the machine that the difference stands for, such as "bearing".
        side: the side with the difference, "left" or "right"; None: both sides, or the whole machine.
        parameter: the name of the model's value that differs.
        unit: the unit of `before`, `after` and `change`.
        before, after: the value of `what` in the earlier and in the later recording.
        change: `after` minus `before`.
        percent: `change` in percent of `before`; None if `before` is not above 0.
        since: the moment at which the difference begins; None: the start of the recording, as far as the data show.
        rivals: the other explanations that the data do not rule out; each is given by the names of its differences.
        weight: the sum of the weights of the explanations with this difference, 0..1.
        words: a sentence on the change.
        advice: a sentence on what to do about the change.
    """

    recording: str
    what: str
    mechanism: str
    side: Literal["left", "right"] | None
    parameter: str
    unit: str
    before: float
    after: float
    change: Sized
    percent: Sized | None
    since: Onset | None
    rivals: tuple[tuple[str, ...], ...]
    weight: float
    words: str
    advice: str


@dataclass(frozen=True)
class FitPercent:
    """Fit in percent of one signal in free runs; None: the signal was not measured in this recording.

    Attributes:
        old_model_before, old_model_after: the fit of the model without changes, in the earlier and the later recording.
        explained_after: the fit of the model with the changes, in the later recording.
    """

    old_model_before: float | None
    old_model_after: float | None
    explained_after: float | None


@dataclass(frozen=True)
class Constant:
    """A combination of constants, or the size of an effect, as one recording alone determines it."""

    recording: str
    what: str
    unit: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Shared:
    """One value in all recordings.

    Attributes:
        what, unit: the name and the unit of the value, as in `Constant`.
        value: the mean over the recordings that agree.
        between_sd: the sd of the value between the recordings that agree, beyond what their uncertainty explains.
        apart: the recordings whose value surely differs from the others.
    """

    what: str
    unit: str
    value: Sized
    between_sd: float
    apart: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal in one run of a later recording, SI, (n,) each: measured, and simulated without and with changes."""

    run: str
    signal: str
    time: Array
    measured: Array
    old: Array
    explained: Array


@dataclass(frozen=True, eq=False, repr=False)
class Changed(Result):
    """The differences of later recordings from an earlier recording.

    Attributes:
        before, after: the names of the recordings.
        dataset: the first later recording, which gives the vehicle and the units.
        verdict: the first of "changed", "ambiguous", "unknown" and "nothing" that `verdicts` holds.
        verdicts: later recording -> the verdict on this recording.
        changes: the changes of all recordings, the most certain change first.
        fits: later recording -> signal -> fit in percent.
        constants: the values that a single recording determines. The size of a new effect is among them if there are
            several later recordings.
        shared: what all recordings share, for each value that at least three recordings determine.
        traces: later recording -> traces of the runs and signals in which the changes explain most.
        steps: later recording -> the stages that set or changed its verdict.
        notes: sentences on what was assumed or left out.
        seed: the seed of the random starts.
    """

    before: str
    after: tuple[str, ...]
    dataset: Dataset
    verdicts: Mapping[str, Answer]
    changes: tuple[Change, ...]
    fits: Mapping[str, Mapping[str, FitPercent]]
    constants: tuple[Constant, ...]
    shared: tuple[Shared, ...]
    traces: Mapping[str, Sequence[Trace]]
    steps: Mapping[str, tuple[Step, ...]]
    notes: tuple[str, ...]
    seed: int

    @property
    def verdict(self) -> Answer:
        order: tuple[Answer, ...] = ("changed", "ambiguous", "unknown", "nothing")
        return next(answer for answer in order if answer in self.verdicts.values())

    def to_dict(self) -> dict[str, Any]:
        """Returns the content of changed.json."""
        content: dict[str, Any] = {
            "verdict": self.verdict,
            "verdicts": self.verdicts,
            "before": self.before,
            "after": list(self.after),
            "changes": self.changes,
            "fit_percent": _pooled(self.fits),
            "fit_percent_by_recording": self.fits,
            "constants": self.constants,
            "shared": self.shared,
            "steps": self.steps,
            "notes": self.notes,
            "seed": self.seed,
            "version": __version__,
        }
        return {key: valid(value) for key, value in content.items()}

    def to_frame(self) -> pandas.DataFrame:
        """Returns a row for each change: its size, with the ends of the 95 % interval."""
        import pandas

        rows = [
            (row.recording, row.what, row.mechanism, row.before, row.after, *row.change.ci95, row.unit, row.weight)
            for row in self.changes
        ]
        columns = ["recording", "what", "mechanism", "before", "after", "low", "high", "unit", "weight"]
        return pandas.DataFrame(rows, columns=columns)


def _pooled(fits: Mapping[str, Mapping[str, FitPercent]]) -> dict[str, FitPercent]:
    """Returns signal -> the mean fit over the later recordings."""
    pooled = {}
    for signal in dict.fromkeys(signal for by_signal in fits.values() for signal in by_signal):
        rows = [vars(by_signal[signal]) for by_signal in fits.values() if signal in by_signal]
        known = {key: [row[key] for row in rows if row[key] is not None] for key in rows[0]}
        pooled[signal] = FitPercent(**{key: sum(fit) / len(fit) if fit else None for key, fit in known.items()})
    return pooled


@dataclass(frozen=True)
class Quantity:
    """The quantity in which a difference is reported: its name, its unit, and its value in a recording's model."""

    what: str
    unit: str
    value_in: Callable[[Model], float]


def quantity_of(difference: Difference, vehicle: str) -> Quantity:
    """Returns the quantity that reports a difference: a combination (see `combinations`) or the value itself."""
    name = difference.what
    formula = next((row for row in FORMULAS[vehicle] if row.name == combinations().get(name)), None)
    if formula is not None:
        return Quantity(formula.name, formula.unit, lambda model: in_model(formula, model))
    if name in RUN_KINDS:
        base = 1.0 if RUN_KINDS[name].unit == "1" else 0.0
        return Quantity(name, RUN_KINDS[name].unit, lambda model: base + model.by_run.get(name, {}).get("", 0.0))
    key = difference.free[0]
    effect, dot, parameter = key.partition(".")
    if dot:
        return Quantity(
            effect, difference.rows[key].unit, lambda model: model.effects.get(effect, {}).get(parameter, 0.0)
        )
    return Quantity(name, difference.rows[name].unit, lambda model: float(model.parameters[name]))


def in_model(formula: Formula, model: Model) -> float:
    """Returns the value of a combination. Friction that the model lacks counts as 0; NaN: the value is undefined."""
    values = dict.fromkeys(combinations(), 0.0) | values_of(model)
    with np.errstate(divide="ignore", invalid="ignore"):
        try:
            return float(formula.value_at(values))
        except ZeroDivisionError:
            return math.nan


def sized(value_in: Callable[[Model], float], model: Model, spread: Spread | None, extra_sd: float = 0.0) -> Sized:
    """Returns a value with its interval, by first-order propagation of a fit's spread.

    The interval may be narrow although the data determine no single parameter: they may still determine the value.

    Args:
        extra_sd: a further sd of the value, independent of the sd of the fit.
    """
    variance = 0.0
    if spread is not None and spread.names:
        slopes = []
        for step in _STEP * np.eye(len(spread.names)):
            above, below = (value_in(with_values(model, spread.at(end))) for end in (step, -step))
            slopes.append((above - below) / (2 * _STEP))
        variance = float(np.array(slopes) @ spread.covariance @ np.array(slopes))
    return _within(value_in(model), _QUANTILE * math.sqrt(max(variance, 0.0) + extra_sd**2))


def _within(value: float, half: float) -> Sized:
    return Sized(value, (value - half, value + half))


def change_of(
    difference: Difference, model: Model, spread: Spread | None, sd: float, before: str, after: str,
    alone: Mapping[str, tuple[Constant, Constant]], **other_fields: Any,
) -> Change:  # fmt: skip
    """Returns the change that reports a difference.

    Args:
        model: the model of the explanation that contains the difference.
        spread: the uncertainty of the fitted values of `model`.
        sd: sd of the first value of `difference` between recordings of an unchanged machine, in the value's unit.
        before, after: the names of the recordings.
        alone: combination -> its values (before, after), each determined by one recording alone. These values are
            reported if they surely differ. The values of `model` are less exact: differences that are too small to be
            named shift them.
        other_fields: the fields of `Change` that neither the difference nor the model gives.
    """
    quantity = quantity_of(difference, model.vehicle)

    def value_in(of: Model, recording: str) -> float:
        return quantity.value_in(in_recording(of, recording, ("",)))

    first, second = value_in(model, before), value_in(model, after)
    quantity_sd = sd * abs(_slope(quantity, model, difference))
    change = sized(lambda of: value_in(of, after) - value_in(of, before), model, spread, quantity_sd)
    percent = None
    if first > 0:
        sd_percent = 100 * quantity_sd / first
        percent = sized(lambda of: 100 * (value_in(of, after) / value_in(of, before) - 1), model, spread, sd_percent)
    if quantity.what in alone:
        apart, in_percent = _apart(*alone[quantity.what], quantity_sd)
        if is_sure(apart):
            first, second = (constant.value for constant in alone[quantity.what])
            change, percent = apart, in_percent
    side, words, advice = _described(difference, model, after, change, percent, quantity.unit)
    return Change(
        recording=after,
        what=quantity.what,
        mechanism=difference.mechanism,
        side=side,
        parameter=difference.free[0],
        unit=quantity.unit,
        before=first,
        after=second,
        change=change,
        percent=percent,
        words=words,
        advice=advice,
        **other_fields,
    )


def _slope(quantity: Quantity, model: Model, difference: Difference) -> float:
    """Returns the derivative of the reported quantity with respect to the first value that differs."""
    recording, key = difference.recording, difference.free[0]
    step = 1e-3 * difference.rows[key].trial
    value = model.by_run[key][recording]
    low, high = (
        quantity.value_in(in_recording(with_values(model, {f"{key}@{recording}": value + move}), recording, ("",)))
        for move in (-step, step)
    )
    return (high - low) / (2 * step)


def is_sure(change: Sized) -> bool:
    """Returns whether the interval of a change excludes 0."""
    low, high = change.ci95
    return low > 0 or high < 0


def _apart(before: Constant, after: Constant, sd: float) -> tuple[Sized, Sized | None]:
    """Returns the change of a combination, and the change in percent, or None if the value before is not above 0.

    `sd`: the sd of the change between recordings of an unchanged machine.
    """
    first, second = ((constant.ci95[1] - constant.ci95[0]) / 2 for constant in (before, after))
    change = _within(after.value - before.value, math.hypot(first, second, _QUANTILE * sd))
    if before.value <= 0:
        return change, None
    ratio = after.value / before.value
    half = 100 * math.hypot(second, ratio * first, _QUANTILE * sd) / before.value
    return change, _within(100 * (ratio - 1), half)


_ADVICE = {
    "viscous_friction": "Look for what brakes in motion: old grease, a brake or a damper, a tight belt.",
    "mass": "Weigh the machine as it drives.",
    "wheel_inertia": "Look at what the motor turns: another load, another wheel, ground contact.",
    "yaw_inertia": "Look for a load that is further from the middle than before.",
    "wheel_radius": "Measure the wheels, and pump them up or replace them.",
    "half_track": "Measure the distance between the wheels.",
    "supply_gain": "Measure the battery's voltage, and charge it; look at the leads from it to the motors.",
    "delay": "Look at the link and at the period of the program that sends commands.",
}
_LESS = "Less of it is no fault by itself. If nobody repaired it, look for a part that came loose or is missing."


def subject(what: str) -> str:
    """Returns a noun phrase for what differs: a constant, a value of runs, an effect or "effect.parameter"."""
    if what in CONSTANTS:
        return CONSTANTS[what].words
    if what in RUN_KINDS:
        return RUN_KINDS[what].words[0].lower() + RUN_KINDS[what].words[1:]
    return catalogue.effect(what.partition(".")[0]).words


def _described(
    difference: Difference, model: Model, recording: str, change: Sized, percent: Sized | None, unit: str
) -> tuple[Literal["left", "right"] | None, str, str]:
    """Returns the side of a change, a sentence on the change, and advice."""
    name, effect = difference.what, difference.what.partition(".")[0]
    is_gone = difference.recording != recording
    table = in_recording(model, recording, ("",)).effects.get(effect, {})
    advice = _ADVICE.get(name) or catalogue.advice(effect, table)
    if is_gone or (difference.mechanism == "bearing" and not difference.is_new and change.value < 0):
        advice = _LESS
    if not difference.is_new:
        verb = "rose" if change.value > 0 else "fell"
        by = _size(percent, "%") if percent else _size(change, unit)
        return None, f"{subject(name)} {verb} by {by}", advice
    key = difference.free[0].partition(".")[2]
    row = next(row for row in catalogue.effect(effect).parameters if row.name == key)
    clause = catalogue.says(effect, key, -change.value if is_gone else change.value)
    size = _size(change, "%", 100.0) if unit == "1" else _size(change, unit)
    what_it_does = f": {clause.format(size)}" if clause else f", {size}"
    words = f"{subject(name)} {'is gone' if is_gone else 'is new'}{what_it_does}"
    if not row.odd:
        return None, words, advice
    return "left" if "the left" in clause else "right" if "the right" in clause else None, words, advice


def _size(change: Sized, unit: str, factor: float = 1.0) -> str:
    """Returns the size of a change with its interval, each multiplied by `factor`: "38 % (34 to 41 %)"."""
    low, high = sorted(factor * abs(end) for end in change.ci95)
    if change.ci95[0] < 0 < change.ci95[1]:
        low = 0.0
    digits = max(0, 1 - math.floor(math.log10(max(high - low, 1e-12)))) if high > low else 3
    size, least, most = (f"{round(number, digits):.{digits}f}" for number in (factor * abs(change.value), low, high))
    return f"{size} {unit} ({least} to {most} {unit})"
