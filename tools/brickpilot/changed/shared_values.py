"""The values that each recording alone determines, what all recordings share, and what a single recording has.

What all recordings of one kind of machine share is an error of the model. What a single recording has is a fault of its
machine, or belongs to its day or its floor. The values of machines without a fault differ, too, by more than their own
uncertainty: these are random effects (DerSimonian & Laird 1986, Controlled Clinical Trials 7).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.stats import norm, t

from brickpilot.changed.change import Constant, Shared, Sized, combinations, in_model, sized
from brickpilot.changed.differences import Difference
from brickpilot.changed.recordings import variance_between
from brickpilot.discover import numbers
from brickpilot.discover.explanation import Explanation, joined, refine
from brickpilot.discover.parts import Part
from brickpilot.discover.prepare import Prepared
from brickpilot.fit.uncertainty import assess
from brickpilot.vehicle.combinations import FORMULAS
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import in_recording

Alone = Mapping[str, tuple[Prepared, Explanation]]
"""Recording -> this recording alone, ready for fits, and its explanation."""

Constants = dict[tuple[str, str], Constant]
"""(recording, name of the value) -> the value, as this recording alone determines it."""

_LEAST_RECORDINGS = 3  # with two recordings nothing tells which of them differs
_TAIL = (1 - numbers.SURE) / 2


def values_of(alone: Alone, vehicle: str, new: Sequence[tuple[Difference, Model]] = (), jobs: int = 1) -> Constants:
    """Returns the combinations of constants that each recording determines, and the sizes of the effects in `new`.

    Each recording is fitted with all these effects, so that the same model gives the values of all recordings.

    Args:
        new: differences that are new effects, each with a model that has it.
    """
    constants: Constants = {}
    reported = {*combinations().values(), "speed per volt"}
    parts = [(_part(one), _part(one).values_in(in_recording(model, one.recording, ("",)))) for one, model in new]
    rows = {one.what: one.rows[one.free[0]] for one, _ in new}
    for name, (own, explanation) in alone.items():
        for part, values in parts:
            if part.effect not in explanation.model.effects:
                explanation = joined(explanation, part, values)
        found = (refine(own.coarse, [explanation], jobs) or [explanation])[0] if parts else explanation
        spread = assess(own.coarse, found.model, found.plan.uncertain).spread
        sizes = {(one.name, one.unit): partial(in_model, one) for one in FORMULAS[vehicle] if one.name in reported}
        for part, _ in parts:
            sizes[part.effect, rows[part.effect].unit] = partial(_size, effect=part.effect, parameter=part.free[0])
        for (what, unit), value_in in sizes.items():
            value = sized(value_in, found.model, spread)
            if np.isfinite([value.value, *value.ci95]).all():
                constants[name, what] = Constant(name, what, unit, value.value, value.ci95)
    return constants


def _size(model: Model, effect: str, parameter: str) -> float:
    return model.effects[effect][parameter]


def _part(difference: Difference) -> Part:
    """Turns a difference that is a new effect into a part that belongs to no recording."""
    fixed = {key.partition(".")[2]: value for key, value in difference.fixed.items()}
    return Part(difference.what, tuple(key.partition(".")[2] for key in difference.free), fixed)


def shared_values(constants: Sequence[Constant]) -> tuple[Shared, ...]:
    """Returns a row for each value that at least three recordings determine."""
    by_name: dict[str, list[Constant]] = {}
    for constant in constants:
        by_name.setdefault(constant.what, []).append(constant)
    return tuple(_shared(rows) for rows in by_name.values() if len(rows) >= _LEAST_RECORDINGS)


def _shared(rows: Sequence[Constant]) -> Shared:
    """Takes out the recording that differs most, as long as one surely differs. Returns what the others share."""
    agreeing, apart = list(rows), list[str]()
    while len(agreeing) >= _LEAST_RECORDINGS:
        distances = [_distance(row, [other for other in agreeing if other is not row]) for row in agreeing]
        if max(distances) < t.ppf(1 - _TAIL / len(agreeing), len(agreeing) - 2):  # any of them may differ by chance
            break
        apart.append(agreeing.pop(int(np.argmax(distances))).recording)
    mean, sd, between = _mean(agreeing)
    # The sd between few recordings is itself uncertain, so Student's t makes the interval wider.
    half = sd * float(t.ppf(1 - _TAIL, len(agreeing) - 1) if between > 0 else norm.ppf(1 - _TAIL))
    return Shared(rows[0].what, rows[0].unit, Sized(mean, (mean - half, mean + half)), between, tuple(apart))


def _distance(row: Constant, others: Sequence[Constant]) -> float:
    """Returns how far a value is from the mean of the others, in sd of that distance for a recording like them."""
    mean, sd, between = _mean(others)
    return abs(row.value - mean) / math.hypot(_sd(row), sd, between)


def _mean(rows: Sequence[Constant]) -> tuple[float, float, float]:
    """Returns the mean of random effects, its sd, and the sd between the recordings."""
    values, own = np.array([row.value for row in rows]), np.array([_sd(row) for row in rows]) ** 2
    between = variance_between([list(zip(values.tolist(), (1 / own).tolist(), strict=True))])
    weights = 1 / (own + between)
    return float(weights @ values / weights.sum()), float(weights.sum() ** -0.5), between**0.5


def _sd(row: Constant) -> float:
    """Returns the sd of a value, which is never 0."""
    return max((row.ci95[1] - row.ci95[0]) / 2 / float(norm.ppf(1 - _TAIL)), 1e-9 * abs(row.value), 1e-300)
