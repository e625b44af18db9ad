"""Finds channels that are wired or stated wrongly in all runs: swapped, reversed, dead, or scaled wrongly.

Each channel is predicted from the other channels by a regression; see `wiring_motion`. After swaps and signs are
corrected, the same regressions give the scale factors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import erf, exp, log, pi, sqrt

import numpy as np

from brickpilot.data.audit.view import Channels, typical_motion
from brickpilot.data.audit.wiring_motion import (
    FREE,
    LAGS,
    SURE,
    UNIT_FITS,
    Miswired,
    Motion,
    Taken,
    pair,
)

_SIDES_FREE = 2.5  # largest ratio of two motors' gains that a weak motor explains
_UNITS = tuple(one for by in (180 / pi, 30 / pi, 1000.0) for one in (by, 1 / by))
_STEPS_S = (1e-4, 0.5)  # shortest and longest plausible time between samples in a robot's log
COUNTS_A_TURN = " counts a turn"
"""The end of a text in `Dataset.guessed` that states the counts per turn of an encoder."""

_FULL = (100.0, 255.0, 1000.0, 1023.0, 4095.0, 32767.0)  # usual PWM values of full drive


def miswired(runs: Sequence[Channels], nominal: Mapping[str, float]) -> tuple[Miswired, ...]:
    """Returns the faults in wiring and scale that all runs of a two-wheeled robot share, in the order of the search.

    Args:
        runs: the runs as measured, in the paper's frame.
        nominal: wheel_radius, half_track (m) and battery_voltage (V), as far as these are known.
    """
    runs = [one for one in runs if len(one.time) > 20]
    if not runs or set(runs[0].drives) != {"left", "right", "yaw"}:
        return ()
    found: list[Miswired] = []
    for stage in (_clock, _beyond_battery, _dead, _hypotheses, _between_wheels, _of_yaw, _of_drives):
        here = stage(runs, nominal)
        found += here
        if any(one.sure < SURE for one in here):
            break  # later stages need data without this fault
        runs = [mended(run, here) for run in runs]
    return tuple(found)


def with_counts(found: Sequence[Miswired], guessed: Sequence[str]) -> tuple[tuple[Miswired, ...], tuple[str, ...]]:
    """Returns `found` and `guessed`, with guessed counts per turn replaced by counts that fit the stated lengths.

    Args:
        guessed: as in `Dataset.guessed`, such as "960 counts a turn".
    """
    base = next((one for one in guessed if one.endswith(COUNTS_A_TURN)), None)
    odd = next((one for one in found if one.is_open and one.sure >= SURE), None)
    if base is None or odd is None or odd.factor is None:
        return tuple(found), tuple(guessed)
    fits = f"{float(base.split()[0]) * odd.factor:.0f}{COUNTS_A_TURN}"
    text = f"{fits} fit, {base.split()[0]} do not: {odd.text.partition(':')[0]}"
    right = replace(odd, text=text, is_open=False)
    return tuple(right if one is odd else one for one in found), tuple(fits if one is base else one for one in guessed)


def taken_from(faults: Iterable[Miswired]) -> dict[str, Taken]:
    """Returns signal -> the measured channel that holds its values, and the factor, with all corrections combined."""
    found: dict[str, Taken] = {}
    for fault in faults:
        found |= {
            name: Taken(was.source, was.factor * one.factor)
            for name, one in fault.mend.items()
            for was in (found.get(one.source, Taken(one.source)),)
        }
    return found


def mended(run: Channels, faults: Iterable[Miswired]) -> Channels:
    """Returns a run in which all sure faults (`is_mended`) are corrected."""
    values = {"time": run.time, **run.inputs, **run.outputs}
    taken = taken_from(fault for fault in faults if fault.is_mended)
    right = values | {name: one.factor * values[one.source] for name, one in taken.items() if name in values}
    return Channels(right["time"], {n: right[n] for n in run.inputs}, {n: right[n] for n in run.outputs})


def _dead(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    return Motion(runs).dead()


def _hypotheses(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    return Motion(runs).hypotheses(nominal)


def _between_wheels(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    """Returns an encoder whose counts per turn contradict the other encoder and the yaw."""
    motion = Motion(runs)
    if (fit := motion.turning()) is None or abs(ratio := log(fit.gains[1] / fit.gains[0])) > log(UNIT_FITS):
        return []  # no fit; or one wheel is in another unit, which `contradictions` searches for
    expected = motion.geometry(nominal)
    apart = [0.0, 0.0] if expected is None else [abs(_apart_from_unit(gain / expected)[1]) for gain in fit.gains]
    odd = int(apart[1] > apart[0])
    name, by = motion.wheels[odd], exp(ratio if odd == 0 else -ratio)
    other = motion.wheels[1 - odd]
    text = f"{name} grows {by:.3g} times as far as {other} for the same turn of {motion.yaw}"
    sure = _beyond(abs(ratio), log(FREE), fit.sd)
    mend = {name: Taken(name, 1 / by)}
    return [Miswired("unit", (name,), text, sure, mend, by, is_open=True)] if sure > 0.9 else []


def _of_yaw(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    """Returns a yaw in another unit, and wheels whose counts or lengths contradict the yaw."""
    motion = Motion(runs)
    fit, expected = motion.turning(), motion.geometry(nominal)
    if fit is None or expected is None or motion.yaw is None:
        return []
    if abs(log(fit.gains[0] / fit.gains[1])) > log(UNIT_FITS):
        return []  # one wheel is in another unit, which `contradictions` searches for
    found: list[Miswired] = []
    unit, left = _apart_from_unit(float(np.sqrt(fit.gains[0] * fit.gains[1])) / expected)
    if unit != 1.0 and motion.is_odd_by(unit):
        return []  # the wheels are in another unit, which the audit finds
    if unit != 1.0:
        names = motion.with_it(motion.yaw)
        text = f"{motion.yaw} is {unit:.3g} times the yaw of the wheels, so it is in another unit"
        sure = _beyond(abs(log(unit)), log(UNIT_FITS), fit.sd)
        found.append(Miswired("unit", tuple(names), text, sure, {n: Taken(n, 1 / unit) for n in names}, unit))
    if (sure := _beyond(abs(left), log(FREE), fit.sd)) > 0.9:
        text = (
            f"{' and '.join(motion.wheels)} grow {exp(-left):.3g} times as far as {motion.yaw} says: the counts "
            "a turn, wheel_radius or half_track are wrong by this factor"
        )
        mend = {name: Taken(name, exp(left)) for name in motion.wheels}
        found.append(Miswired("unit", motion.wheels, text, sure, mend, exp(-left), is_open=True))
    return found


def _of_drives(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    """Returns the inputs of the stronger motor, if the two motors' gains differ by more than a weak motor explains."""
    motion = Motion(runs)
    fits = [fit for number in range(len(LAGS)) if (fit := motion.driven(number)) is not None]
    if not fits:
        return []
    fit = min(fits, key=lambda one: one.sd)
    ratio = log(fit.gains[0] / fit.gains[1])
    sure = _beyond(abs(ratio), log(_SIDES_FREE), fit.sd)
    is_unit = any(abs(abs(ratio) - abs(log(one))) < log(1.2) for one in _UNITS)  # the audit finds such a unit
    if sure < 0.9 or is_unit:
        return []
    weak, strong = ("right", "left") if ratio > 0 else ("left", "right")
    names = tuple(name for name in motion.inputs if name.endswith(strong))
    times = f"{exp(abs(ratio)):.3g} times"
    text = f"the {strong} motor moves {times} as far as the {weak} motor at the same drive: its full drive differs"
    return [Miswired("unit", names, text, sure, {}, exp(-abs(ratio)))]


def _apart_from_unit(ratio: float) -> tuple[float, float]:
    """Returns the factor between units that is nearest to a ratio (1: the same unit), and log(ratio / factor)."""
    if 1 / UNIT_FITS < ratio < UNIT_FITS:
        return 1.0, log(ratio)
    unit = min(_UNITS, key=lambda one: abs(log(ratio / one)))
    left = log(ratio / unit)
    return (unit, left) if abs(left) < log(UNIT_FITS) else (1.0, log(ratio))


def _beyond(size: float, limit: float, sd: float) -> float:
    """Returns the probability that a size with the standard error `sd` exceeds `limit`."""
    return 0.5 * (1.0 + erf((size - limit) / (sqrt(2.0) * max(sd, 0.02))))


def _clock(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    """Returns a clock in another unit: the samples are too far apart and the wheels turn too slowly, or the reverse."""
    step = float(np.median([np.median(np.diff(run.time)) for run in runs]))
    if _STEPS_S[0] <= step <= _STEPS_S[1]:
        return []
    by = next((f for f in (1e3, 1e6, 1e-3, 1e-6) if _STEPS_S[0] <= step / f <= _STEPS_S[1]), None)
    if by is None:
        return []
    sure = 0.99 if not _STEPS_S[0] / 10 < step < 4 * _STEPS_S[1] else 0.9
    for kind in ("angle", "travel"):
        for name in pair(f"wheel_{kind}"):
            fastest = [
                np.nanmax(np.abs(np.diff(run.outputs[name]) / np.diff(run.time)), initial=0.0)
                for run in runs
                if name in run.outputs
            ]
            if fastest and max(fastest) > 0.0:
                rates = log(max(fastest) / typical_motion(name))
                sure = 0.999 if abs(rates + log(by)) < abs(rates) else 0.0
    if sure == 0.0:
        return []
    text = (
        f"samples are {step:.3g} s apart: the time is stated in a unit {by:g} times too {'long' if by > 1 else 'short'}"
    )
    return [Miswired("clock", ("time",), text, sure, {"time": Taken("time", 1 / by)}, by)]


def _beyond_battery(runs: Sequence[Channels], nominal: Mapping[str, float]) -> list[Miswired]:
    """Returns voltage inputs far above the battery's voltage: the log states a PWM value as a voltage."""
    names = [name for name in runs[0].inputs if name.startswith("voltage")]
    levels = [
        v for run in runs if "battery_voltage" in run.outputs for v in [np.nanmedian(run.outputs["battery_voltage"])]
    ]
    battery = float(np.nanmedian(levels)) if levels else nominal.get("battery_voltage")
    if not names or battery is None or not battery > 0.0:
        return []
    largest = max(float(np.nanmax(np.abs(run.inputs[name]), initial=0.0)) for run in runs for name in names)
    if largest < 3.0 * battery:
        return []
    full = next((one for one in _FULL if one >= largest), largest)
    beyond = f"{' and '.join(names)} go up to {largest:.4g} V, and the battery has {battery:.3g} V"
    text = f"{beyond}: they look like a PWM of {full:g}"
    return [Miswired("unit", tuple(names), text, 1.0, {n: Taken(n, battery / full) for n in names}, full / battery)]
