"""Finds channels whose sign or unit contradicts the nominal model, for data sets with only one channel of a kind.

A nominal value may be wrong and an effect may be missing. So only gross contradictions count: a motion whose sign is
opposite to the model's, or whose size only another unit explains. Friction may make a measured motion smaller than the
simulated motion. So a smaller motion counts only if (measured / simulated) is about the same in all moving runs. If all
moving runs have the same fault, the runs that hardly move are assumed to have this fault, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from types import MappingProxyType

import numpy as np

from brickpilot.data.audit.fault import FACTORS, Fault, channel_note, usual_factors
from brickpilot.data.audit.view import EQUAL, LEAST_SAMPLES, Vector, Windows, cut, ratio_of
from brickpilot.data.dataset import Dataset, Run

_LEAST = 9.0  # smaller factors between two units are ignored
_FITS = (0.45, 1.6)  # a unit explains a ratio if (ratio / its factor) is within these limits, as the model is inexact
_MOVES = 0.3  # a run is moving if its simulated motion is at least this share of the largest of all runs
_ALIKE = 2.0  # limit on (largest / smallest) ratio of runs that share a fault, if their median ratio is above 1
_ALIKE_SMALL = 1.3  # the same limit, if their median ratio is 1 or less; a ratio is (measured / simulated)


@dataclass(frozen=True)
class _Ratio:
    """`value`: ratio of measured to simulated motion of one signal in one run; `level`: rms of the simulated rate."""

    run: Run
    value: float
    level: float


def contradictions(dataset: Dataset, simulated: Mapping[str, Mapping[str, Vector]]) -> tuple[Fault, ...]:
    """Returns the channels of each run whose sign or unit contradicts the nominal model, as faults "sign" and "unit".

    The unit of a signal is tested only if the data set states the values on which the signal's size depends. Fitted
    values would adapt to any unit, and presets may be wrong.

    Args:
        dataset: as `reading.read` gives it.
        simulated: run -> signal -> (n,) values that the nominal model gives for the run's inputs at the run's times, in
            SI and the paper's frame. Runs and signals without an entry are not tested.
    """
    found: list[Fault] = []
    for signal in dict.fromkeys(name for run in dataset.runs for name in run.outputs if name != "battery_voltage"):
        ratios = [
            ratio
            for run in dataset.runs
            if signal in run.outputs and signal in simulated.get(run.name, {})
            if (ratio := _ratio(run, signal, simulated[run.name][signal])) is not None
        ]
        if ratios:
            hardest = max(one.level for one in ratios)
            moving = [one for one in ratios if one.level >= _MOVES * hardest]
            wrong = _reversed(signal, moving)
            if not wrong and _is_stated(dataset, signal):
                wrong = _in_other_units(signal, moving)
            if len(wrong) == len(moving) > 1 and len(set(wrong.values())) == 1:
                factor = next(iter(wrong.values()))
                wrong = {run.name: factor for run in dataset.runs if np.isfinite(run.outputs.get(signal, ())).any()}
            found += [
                Fault(run.name, signal, "sign" if by == -1.0 else "unit", float(run.time[0]), float(run.time[-1]), by)
                for run in dataset.runs
                if (by := wrong.get(run.name)) is not None
            ]
    order = {run.name: number for number, run in enumerate(dataset.runs)}
    return tuple(sorted(found, key=lambda one: (order[one.run], one.signal)))


def leave_out(dataset: Dataset, faults: Iterable[Fault]) -> Dataset:
    """Returns the data set with the faulty channels blanked, and with the faults and their notes added."""
    listed = list(faults)
    wrong = {(fault.run, fault.signal) for fault in listed}
    runs = tuple(replace(run, outputs=_without(run, wrong)) for run in dataset.runs)
    notes: list[str] = []

    def kind(fault: Fault) -> tuple[str, float]:
        return fault.signal, fault.factor or 0.0

    for (signal, factor), group in groupby(sorted(listed, key=kind), key=kind):
        named = [fault.run for fault in group]
        notes.append(channel_note([signal], factor, named, len(runs), ["the nominal model"]))
    return replace(dataset, runs=runs, faults=(*dataset.faults, *listed), notes=(*dataset.notes, *notes))


def _without(run: Run, wrong: set[tuple[str, str]]) -> Mapping[str, Vector]:
    outputs = dict(run.outputs)
    for name in outputs:
        if (run.name, name) in wrong:
            outputs[name] = np.full_like(outputs[name], np.nan)
            outputs[name].setflags(write=False)
    return MappingProxyType(outputs)


def _is_stated(dataset: Dataset, signal: str) -> bool:
    """Whether the data set states the nominal values on which a signal's steady size depends."""
    needed = {"resistance"} if signal.startswith("current") else {"emf_constant"}
    if signal in {"position", "velocity"} and "force_per_volt" in dataset.nominal:
        needed = {"mass"}
    elif signal.startswith(("wheel_travel", "wheel_velocity", "accel_", "yaw_")) or signal in {"position", "velocity"}:
        needed |= {"wheel_radius"}
    if signal.startswith("yaw_") or signal == "accel_sway":
        needed |= {"half_track"}
    return needed <= dataset.nominal.keys()


def _reversed(signal: str, ratios: Sequence[_Ratio]) -> dict[str, float]:
    """Returns run -> -1 for reversed signals.

    A current counts only if it is reversed in all runs, because a motor may brake on a slope.
    """
    found = {one.run.name: -1.0 for one in ratios if 1 / EQUAL < -one.value < EQUAL}
    return {} if signal.startswith("current") and len(found) < max(len(ratios), 2) else found


def _in_other_units(signal: str, ratios: Sequence[_Ratio]) -> dict[str, float]:
    """Returns run -> signed factor for signals in another unit."""
    values = np.array([one.value for one in ratios])
    sizes = np.abs(values)
    middle = float(np.median(sizes))
    if len(ratios) > 1 and abs(np.sum(np.sign(values))) == len(ratios):
        alike = _ALIKE if middle > 1.0 else _ALIKE_SMALL
        shared = _gross(signal, middle) if sizes.max() < alike * sizes.min() else None
        if shared is not None:
            return {one.run.name: float(np.copysign(shared, one.value)) for one in ratios}
    return {
        one.run.name: float(np.copysign(factor, one.value))
        for one in ratios
        if abs(one.value) > 1.0 and (factor := _gross(signal, abs(one.value))) is not None
    }


def _gross(signal: str, ratio: float) -> float | None:
    """Returns the unit's factor that is nearest to a ratio; None: no factor is near.

    Units that are often confused with the signal's own unit are tried first.
    """
    for listed in (usual_factors(signal), FACTORS):
        factors = [by if ratio > 1.0 else 1 / by for by in listed if by > _LEAST]
        near = [by for by in factors if _FITS[0] < ratio / by < _FITS[1]]
        if near:
            return min(near, key=lambda by: abs(np.log(ratio / by)))
    return None


def _ratio(run: Run, signal: str, simulated: Vector) -> _Ratio | None:
    """Returns the ratio of measured to simulated motion; None: these motions are not correlated, or nothing moves."""
    if len(run.time) < LEAST_SAMPLES or not np.isfinite(run.outputs[signal]).any():
        return None
    measured, model = (cut(run.time, {signal: values}) for values in (run.outputs[signal], simulated))
    y, x = _motion(measured, signal), _motion(model, signal)
    value = ratio_of(y, x)
    return None if value is None else _Ratio(run, value, model.rms(np.where(np.isfinite(y), x, np.nan)))


def _motion(windows: Windows, signal: str) -> Vector:
    """Returns the motion in each window. The mean of an acceleration is removed, because a bias may cause it."""
    moved = windows.of(signal)
    return windows.unbiased(moved) if signal.startswith("accel_") else moved
