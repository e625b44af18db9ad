"""What changed, in terms of the machine: each difference with its size before and after, and their intervals."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from brickpilot import __version__, catalogue
from brickpilot.changed.differences import CONSTANTS, Difference
from brickpilot.data.dataset import Dataset
from brickpilot.data.shown import Result, valid
from brickpilot.discover import numbers
from brickpilot.discover.finding import Step
from brickpilot.vehicle.combinations import FORMULAS, Formula
from brickpilot.vehicle.model import Model, with_values
from brickpilot.vehicle.replay import RUN_KINDS, in_recording
from brickpilot.vehicle.spread import Spread

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]
Answer = Literal["nothing", "changed", "ambiguous", "unknown"]

_STEP = 1e-3  # step of a coordinate of a spread, for slopes
_QUANTILE = float(norm.ppf((1 + numbers.SURE) / 2))
_COMBINATION = {"viscous_friction": "kV", "wheel_inertia": "kA", "mass": "kA"}


@cache
def combinations() -> Mapping[str, str]:
    """Returns constant, or "effect.parameter" of a torque in volts, -> the combination in which its difference is
    reported. The data may determine the combination without determining the constant or torque alone."""
    rows = ((one.name, row) for one in catalogue.effects() for row in one.parameters)
    return {**_COMBINATION, **{f"{effect}.{row.name}": row.in_volts for effect, row in rows if row.in_volts}}


def told_combinations() -> frozenset[str]:
    """Returns the combinations whose value by each recording alone is reported."""
    return frozenset({*combinations().values(), "speed per volt"})


@dataclass(frozen=True)
class Sized:
    """A value with its 95 % interval, (low, high)."""

    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Since:
    """The moment at which a difference begins: a run, the time on its clock, s, and the 95 % interval."""

    run: str
    at_s: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Change:
    """One difference between two recordings.

    Attributes:
        recording: the name of the later recording that has the difference.
        what: an effect, a combination of constants (kV, kA, dry friction in volts) or a constant.
        mechanism: the mechanism of the difference, as for an effect.
        side: "left" or "right"; None: the difference belongs to both sides, or to the whole machine.
        parameter: the value of the model that differs.
        unit: the unit of `before`, `after` and `change`.
        before, after: the values.
        change: after less before.
        percent: `change` in percent of `before`; None if `before` is 0, or its sign is not sure.
        since: when it begins; None: at the start of the recording, as far as the data show.
        rivals: other explanations that the data do not rule out, each as the names of its differences.
        weight: the weight of the explanations that hold this difference, 0..1.
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
    since: Since | None
    rivals: tuple[tuple[str, ...], ...]
    weight: float
    words: str
    advice: str


@dataclass(frozen=True)
class FitPercent:
    """Fit in percent of one signal in free runs; None: the signal was not measured in this recording.

    Attributes:
        old_model_before, old_model_after: in BEFORE and AFTER, by the model of BEFORE alone.
        explained_after: in AFTER, by the model with the changes.
    """

    old_model_before: float | None
    old_model_after: float | None
    explained_after: float | None


@dataclass(frozen=True)
class Constant:
    """A combination of constants that one recording alone determines."""

    recording: str
    what: str
    unit: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal of one run of a later recording, SI: measured, and by the models before and after, (n,) each."""

    run: str
    signal: str
    time: Array
    measured: Array
    old: Array
    explained: Array


@dataclass(frozen=True, eq=False, repr=False)
class Changed(Result):
    """What differs in later recordings from an earlier one.

    Attributes:
        before, after: the names of the recordings.
        dataset: the first later recording, for its vehicle and units.
        verdict: the strongest of the later recordings' verdicts.
        verdicts: later recording -> its own verdict.
        changes: the changes, the surest first.
        fits: later recording -> signal -> fit in percent.
        constants: the combinations of constants that each recording alone determines.
        traces: later recording -> traces of the runs and signals in which the changes show most.
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
    traces: Mapping[str, Sequence[Trace]]
    steps: Mapping[str, tuple[Step, ...]]
    notes: tuple[str, ...]
    seed: int

    @property
    def verdict(self) -> Answer:
        order: tuple[Answer, ...] = ("changed", "ambiguous", "unknown", "nothing")
        return next(one for one in order if one in self.verdicts.values())

    def to_dict(self) -> dict[str, Any]:
        """Returns the content of changed.json."""
        single = self.fits[self.after[0]] if len(self.after) == 1 else None
        found: dict[str, Any] = {
            "verdict": self.verdict,
            "verdicts": self.verdicts,
            "before": self.before,
            "after": list(self.after),
            "changes": self.changes,
            "fit_percent": single if single is not None else _pooled(self.fits),
            "fit_percent_by_recording": self.fits,
            "constants": self.constants,
            "steps": self.steps,
            "notes": self.notes,
            "seed": self.seed,
            "version": __version__,
        }
        return {key: valid(one) for key, one in found.items()}

    def to_frame(self) -> pandas.DataFrame:
        """Returns a row for each change: its size, with the ends of the 95 % interval."""
        import pandas

        rows = [
            (one.recording, one.what, one.mechanism, one.before, one.after, *one.change.ci95, one.unit, one.weight)
            for one in self.changes
        ]
        columns = ["recording", "what", "mechanism", "before", "after", "low", "high", "unit", "weight"]
        return pandas.DataFrame(rows, columns=columns)


def _pooled(fits: Mapping[str, Mapping[str, FitPercent]]) -> dict[str, FitPercent]:
    """Returns signal -> the mean fit over the later recordings."""
    names = dict.fromkeys(name for one in fits.values() for name in one)

    def mean(values: Sequence[float | None]) -> float | None:
        known = [one for one in values if one is not None]
        return sum(known) / len(known) if known else None

    return {
        name: FitPercent(
            *(
                mean([getattr(one[name], field.name) for one in fits.values() if name in one])
                for field in dataclasses.fields(FitPercent)
            )
        )
        for name in names
    }


@dataclass(frozen=True)
class Quantity:
    """The quantity by which a difference is reported: its name, unit, and value in the model of a recording."""

    what: str
    unit: str
    value_in: Callable[[Model], float]


def quantity_of(difference: Difference, vehicle: str) -> Quantity:
    """Returns the quantity by which a difference is reported: the combination that the data determine, or the value."""
    name = difference.what
    formula = next((one for one in FORMULAS[vehicle] if one.name == combinations().get(name)), None)
    if formula is not None:
        return Quantity(formula.name, formula.unit, lambda model: in_model(formula, model))
    if name in RUN_KINDS:
        base = 1.0 if RUN_KINDS[name].unit == "1" else 0.0
        return Quantity(name, RUN_KINDS[name].unit, lambda model: base + _of_runs(model, name))
    if difference.is_new:
        row = difference.rows[difference.free[0]]
        return Quantity(name, row.unit, lambda model: _of_effect(model, difference.free[0]))
    if "." in name:
        effect = name.partition(".")[0]
        return Quantity(effect, difference.rows[name].unit, lambda model: _of_effect(model, name))
    return Quantity(name, difference.rows[name].unit, lambda model: float(model.parameters[name]))


def in_model(formula: Formula, model: Model) -> float:
    """Returns the value of a combination; 0 for friction that the model lacks, NaN if it is undefined."""
    known = {f"{effect}.{name}": value for effect, table in model.effects.items() for name, value in table.items()}
    values = dict.fromkeys(combinations(), 0.0) | known | dict(model.parameters)
    with np.errstate(divide="ignore", invalid="ignore"):
        try:
            return float(formula.value_at(values))
        except ZeroDivisionError:
            return math.nan


def _of_runs(model: Model, kind: str) -> float:
    return model.by_run.get(kind, {}).get("", 0.0)


def _of_effect(model: Model, key: str) -> float:
    effect, _, name = key.partition(".")
    return model.effects.get(effect, {}).get(name, 0.0)


def sized(value_in: Callable[[Model], float], model: Model, spread: Spread | None, extra_sd: float = 0.0) -> Sized:
    """Returns a value with its interval, by first-order propagation of a fit's spread.

    The data may determine this value without determining single parameters: the value is constant along the directions
    that the data leave open.

    Args:
        extra_sd: further sd of the value, beside that of the fit.
    """
    centre, slopes = value_in(model), []
    if spread is not None:
        for step in _STEP * np.eye(len(spread.names)):
            ends = [value_in(with_values(model, spread.at(one))) for one in (step, -step)]
            slopes.append((ends[0] - ends[1]) / (2 * _STEP))
    slope = np.array(slopes)
    variance = float(slope @ spread.covariance @ slope) if spread is not None and len(slope) else 0.0
    half = _QUANTILE * math.sqrt(max(variance, 0.0) + extra_sd**2)
    return Sized(centre, (centre - half, centre + half))


def change_of(
    difference: Difference, model: Model, spread: Spread | None, sd: float, before: str, after: str,
    alone: Mapping[str, tuple[Sized, Sized]], **told: Any,
) -> Change:  # fmt: skip
    """Returns a difference as a change.

    Args:
        model: the model of the explanation that holds the difference.
        spread: the uncertainty of the fitted values of `model`.
        sd: sd of the difference's first value between recordings of one state, in the value's own unit.
        before, after: the names of the recordings.
        alone: combination -> its value by each recording alone, (before, after). A difference that is too small to be
            named still moves the other values; so the values alone are reported if they surely differ.
        told: further fields of the change, which the explanation does not give.
    """
    one = quantity_of(difference, model.vehicle)

    def pair(of: Model) -> tuple[float, float]:
        first, second = (one.value_in(in_recording(of, name, ("",))) for name in (before, after))
        return first, second

    def gone(of: Model) -> float:
        first, second = pair(of)
        return second - first

    def share(of: Model) -> float:
        first, second = pair(of)
        return 100 * (second / first - 1)

    first, second = pair(model)
    told_sd = sd * abs(_slope(one, model, difference))
    change = sized(gone, model, spread, told_sd)
    percent = sized(share, model, spread, 100 * told_sd / abs(first)) if first > 0 else None
    if one.what in alone and is_sure(apart := _apart(*alone[one.what], told_sd)):
        first, second, change = alone[one.what][0].value, alone[one.what][1].value, apart
        percent = _in_percent(*alone[one.what], told_sd)
    side, words, advice = _said(difference, model, after, change, percent, one.unit)
    return Change(
        recording=after,
        what=one.what,
        mechanism=difference.mechanism,
        side=side,
        parameter=difference.free[0],
        unit=one.unit,
        before=first,
        after=second,
        change=change,
        percent=percent,
        words=words,
        advice=advice,
        **told,
    )


def _slope(one: Quantity, model: Model, difference: Difference) -> float:
    """Returns the change of the reported quantity per unit of the first value that differs."""
    recording, key = difference.recording, difference.free[0]
    step = 1e-3 * difference.rows[key].trial
    value = model.by_run[key][recording]
    low, high = (
        one.value_in(in_recording(with_values(model, {f"{key}@{recording}": value + move}), recording, ("",)))
        for move in (-step, step)
    )
    return (high - low) / (2 * step)


def is_sure(change: Sized) -> bool:
    """Returns whether the interval of a change excludes 0."""
    low, high = change.ci95
    return low > 0 or high < 0


def _apart(before: Sized, after: Sized, sd: float) -> Sized:
    half = math.hypot(_half(before), _half(after), _QUANTILE * sd)
    change = after.value - before.value
    return Sized(change, (change - half, change + half))


def _in_percent(before: Sized, after: Sized, sd: float) -> Sized | None:
    if before.value <= 0:
        return None
    ratio = after.value / before.value
    half = 100 * math.hypot(_half(after), ratio * _half(before), _QUANTILE * sd) / before.value
    return Sized(100 * (ratio - 1), (100 * (ratio - 1) - half, 100 * (ratio - 1) + half))


def _half(one: Sized) -> float:
    return (one.ci95[1] - one.ci95[0]) / 2


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


_LESS = "Less of it is no fault by itself. If nobody mended it, look for what came loose or is missing."


def subject(what: str) -> str:
    """Returns a noun phrase for what differs: a constant, a value of runs, an effect or "effect.parameter"."""
    if what in CONSTANTS:
        return CONSTANTS[what].words
    if what in RUN_KINDS:
        return RUN_KINDS[what].words[0].lower() + RUN_KINDS[what].words[1:]
    return catalogue.effect(what.partition(".")[0]).words


def _said(
    difference: Difference, model: Model, recording: str, change: Sized, percent: Sized | None, unit: str
) -> tuple[Literal["left", "right"] | None, str, str]:
    """Returns the side of a change, a sentence, and what to do about it."""
    name, effect = difference.what, difference.what.partition(".")[0]
    gone = difference.recording != recording
    table = in_recording(model, recording, ("",)).effects.get(effect, {})
    advice = _ADVICE.get(name) or catalogue.advice(effect, table)
    if gone or (difference.mechanism == "bearing" and not difference.is_new and change.value < 0):
        advice = _LESS
    if not difference.is_new:
        verb = "rose" if change.value > 0 else "fell"
        by = _size(percent.value, percent.ci95, "%") if percent else _size(change.value, change.ci95, unit)
        return None, f"{subject(name)} {verb} by {by}", advice
    row = next(one for one in catalogue.effect(effect).parameters if difference.free[0] == f"{effect}.{one.name}")
    value = -change.value if gone else change.value
    clause = catalogue.says(effect, row.name, value)
    sides = [one for one in _SIDES if f"the {one}" in clause]
    size = _size(100 * value, _times(100, change.ci95), "%") if unit == "1" else _size(value, change.ci95, unit)
    told = f": {clause.format(size)}" if clause else f", {size}"
    words = f"{subject(name)} {'is gone' if gone else 'is new'}{told}"
    return (sides[0] if row.odd and sides else None), words, advice


_SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")


def _times(factor: float, ends: tuple[float, float]) -> tuple[float, float]:
    return factor * ends[0], factor * ends[1]


def _size(value: float, ends: tuple[float, float], unit: str) -> str:
    """Returns the size of a value with its interval: "38 % (34 to 41 %)"."""
    low, high = sorted(abs(one) for one in ends)
    if ends[0] < 0 < ends[1]:
        low = 0.0
    digits = max(0, 1 - math.floor(math.log10(max(high - low, 1e-12)))) if high > low else 3
    size, least, most = (f"{round(one, digits):.{digits}f}" for one in (abs(value), low, high))
    return f"{size} {unit} ({least} to {most} {unit})"
