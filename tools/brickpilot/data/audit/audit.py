"""Finds faults in measured outputs before anything is fitted to them; no model is needed.

Single samples may be clipped, frozen, lost, or swapped with another column. A whole channel may have a reversed sign or
another unit (`channels`). A clock may drift or jump (`clock`). A fault is reported only where a moving body with sensor
noise and quantisation cannot have made the samples; in doubt a sample is kept.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit import stuck
from brickpilot.data.audit.blame import Contradiction
from brickpilot.data.audit.collisions import collisions
from brickpilot.data.audit.contradictions import contradictions
from brickpilot.data.audit.delays import delay_note, delays
from brickpilot.data.audit.fault import Fault, Kind, channel_note, collision_note, range_note, rows_note
from brickpilot.data.audit.held import held, held_note
from brickpilot.data.audit.jumps import blank, jumps
from brickpilot.data.audit.run_clocks import clock_faults
from brickpilot.data.audit.view import AcrossRuns, RunView, stretches
from brickpilot.data.description import Signal
from brickpilot.data.signals import Frame

__all__ = ["Audited", "Fault", "MeasuredRun", "audit"]

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TYPICAL_BATTERY, _HIGHEST_BATTERY = 9.0, 500.0  # V


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One measured run, in SI: (n,) each, NaN where blank."""

    name: str
    time: Vector
    inputs: Mapping[str, Vector]
    outputs: Mapping[str, Vector]


@dataclass(frozen=True)
class Audited:
    """The result of the audit.

    Attributes:
        outputs: run -> signal -> values, NaN where damaged.
        faults: ordered by run, then by time.
        notes: one sentence for each group of faults.
    """

    outputs: Mapping[str, Mapping[str, Vector]]
    faults: tuple[Fault, ...]
    notes: tuple[str, ...]


def audit(
    runs: Sequence[MeasuredRun], signals: Mapping[str, Signal], frame: Frame, nominal: Mapping[str, float] | None = None
) -> Audited:
    """Finds the faults of all runs.

    Args:
        runs: in the data set's order. The resolution of a signal is taken from all of them together.
        signals: as the data set describes them.
        frame: of the data set's files.
        nominal: wheel_radius, half_track (m) and battery_voltage (V), as far as they are known.
    """
    resolution = {name: _resolution(name, runs, signals) for name in runs[0].outputs} if runs else {}
    views = [_view(run, resolution) for run in runs]
    faults, notes = _damaged_rows(runs, views, signals, frame)
    for found, its_notes in (
        _wrong_channels(runs, views, nominal or {}),
        _beyond_range(runs, views, signals),
        clocks := _wrong_clocks(runs, views),
        _after_collisions(runs, views, {one.run for one in clocks[0]}),
    ):
        faults += found
        notes += its_notes
    notes += _keep_samples(runs, views)
    if late := delays(views):
        notes.append(delay_note(late))
    outputs = {run.name: dict(view.outputs) for run, view in zip(runs, views, strict=True)}
    order = {run.name: number for number, run in enumerate(runs)}
    faults.sort(key=lambda one: (order[one.run], one.from_s, one.signal))
    return Audited(outputs, tuple(faults), tuple(notes))


def _view(run: MeasuredRun, resolution: Mapping[str, float]) -> RunView:
    outputs = {name: values.copy() for name, values in run.outputs.items()}
    return RunView(run.time, run.inputs, outputs, resolution, held(run.time, run.outputs, resolution))


def _keep_samples(runs: Sequence[MeasuredRun], views: Sequence[RunView]) -> list[str]:
    """Blanks the rows that repeat a held sample; returns one note for all runs with the same channels."""
    alike: dict[tuple[str, ...], list[int]] = {}
    for number, view in enumerate(views):
        for name, one in view.held.items():
            view.outputs[name][~one.fresh] = np.nan
        if view.held:
            alike.setdefault(tuple(view.held), []).append(number)
    return [
        held_note(
            [runs[k].name for k in numbers],
            len(runs),
            {name: float(np.median([views[k].held[name].beat for k in numbers])) for name in names},
            float(np.median([views[k].interval for k in numbers])),
        )
        for names, numbers in alike.items()
    ]


def _damaged_rows(
    runs: Sequence[MeasuredRun], views: Sequence[RunView], signals: Mapping[str, Signal], frame: Frame
) -> tuple[list[Fault], list[str]]:
    """Finds damaged samples and blanks them in `views`; returns the faults and their notes."""
    faults: list[Fault] = []
    notes: list[str] = []
    damage: list[dict[Kind, dict[str, Mask]]] = []
    for view in views:
        swapped, dropout = jumps(view, signals, frame)
        damage.append({"swapped": swapped, "dropout": dropout})
    across = AcrossRuns(views)
    for run, view, masks in zip(runs, views, damage, strict=True):
        masks["clipped"] = {name: _clipped(view, name, signals) for name in view.outputs}
        blank(view, masks["clipped"])
        masks["frozen"] = {name: stuck.frozen(view, name, across) for name in view.outputs}
        for name, stands in masks["frozen"].items():
            at_end = stuck.at_extreme(view, name, stands)
            masks["clipped"][name] |= at_end
            stands &= ~at_end
        for kind, by_signal in masks.items():
            for name, mask in by_signal.items():
                found = [Fault(run.name, name, kind, *span) for span in _spans(run.time, mask)]
                faults.extend(found)
                if found:
                    notes.append(rows_note(found, int(np.count_nonzero(mask)), len(mask), float(run.time[0])))
    for view, masks in zip(views, damage, strict=True):
        blank(view, masks["clipped"])
        blank(view, masks["frozen"])
        for name, one in view.held.items():
            one.blank_repeats(view.outputs[name])
    return faults, notes


def _clipped(view: RunView, name: str, signals: Mapping[str, Signal]) -> Mask:
    """Returns the clipped samples. A channel beyond its stated range has none: it may be in another unit."""
    stated = signals[name].range
    if stuck.leaves(view.outputs[name], stated):
        return np.zeros(len(view.time), dtype=bool)
    return stuck.clipped(view, name, stated)


def _beyond_range(
    runs: Sequence[MeasuredRun], views: Sequence[RunView], signals: Mapping[str, Signal]
) -> tuple[list[Fault], list[str]]:
    """Finds channels beyond their stated range that nothing else explains, and blanks them in `views`.

    If a channel is beyond its range in most runs, it is wrong in the other runs, too, where less moves.
    """
    faults: list[Fault] = []
    notes: list[str] = []
    for name, signal in signals.items():
        known = [k for k, one in enumerate(views) if _known(one, name)]
        wrong = [k for k in known if stuck.leaves(views[k].outputs[name], signal.range)]
        if 2 * len(wrong) > len(known):
            wrong = known
        for k in wrong:
            time = runs[k].time
            faults.append(Fault(runs[k].name, name, "unit", float(time[0]), float(time[-1])))
            views[k].outputs[name][:] = np.nan
        if wrong:
            notes.append(range_note(name, [runs[k].name for k in wrong], len(runs)))
    return faults, notes


def _wrong_channels(
    runs: Sequence[MeasuredRun], views: Sequence[RunView], nominal: Mapping[str, float]
) -> tuple[list[Fault], list[str]]:
    """Finds whole channels that are wrong, and blanks them in `views`.

    If an input or the time is wrong, all channels of that run are blanked.
    """
    found = contradictions(
        views, wheel_radius=nominal.get("wheel_radius"), half_track=nominal.get("half_track")
    ) + _wrong_batteries(views, nominal.get("battery_voltage"))
    faults: list[Fault] = []
    notes: list[str] = []
    for one in found:
        signals = _columns(one.names, runs[0].inputs)
        named = [runs[number].name for number in one.runs]
        notes.append(channel_note(signals, one.factor, named, len(runs), _columns(one.against, runs[0].inputs)))
        for number in one.runs:
            run, view = runs[number], views[number]
            for name in signals:
                if name in view.outputs and not np.isfinite(view.outputs[name]).any():
                    continue
                kind: Kind = "sign" if one.factor == -1.0 else "clock" if name == "time" else "unit"
                span = float(run.time[0]), float(run.time[-1])
                faults.append(Fault(run.name, name, kind, *span, one.factor))
                for blanked in [name] if name in view.outputs else view.outputs:
                    view.outputs[blanked][:] = np.nan
    return faults, notes


def _columns(names: Sequence[str], inputs: Mapping[str, Vector]) -> tuple[str, ...]:
    """Returns the signals of the data set for channels; for a drive its inputs."""
    found: dict[str, None] = {}
    for name in names:
        _, is_drive, side = name.partition("drive_")
        own = [one for one in inputs if one.endswith(f"_{side}")] or list(inputs)
        found |= dict.fromkeys(own if is_drive else [name])
    return tuple(found)


def _wrong_batteries(views: Sequence[RunView], nominal: float | None) -> list[Contradiction]:
    """Finds runs whose battery voltage is 100 or 1000 times off.

    The voltage is compared with the stated one, with the other runs, or with that of a typical battery.
    """
    name = "battery_voltage"
    levels = {k: float(np.nanmedian(one.outputs[name])) for k, one in enumerate(views) if _known(one, name)}
    odd: dict[float, list[int]] = {}
    for number, level in levels.items():
        others = [other for k, other in levels.items() if k != number]
        usual = nominal if nominal is not None else float(np.median(others)) if len(others) > 1 else _TYPICAL_BATTERY
        if nominal is None and usual > _HIGHEST_BATTERY:
            usual = _TYPICAL_BATTERY
        factor = next((f for by in (1000.0, 100.0) for f in (by, 1 / by) if 1 / 3 < abs(level) / usual / f < 3.0), None)
        if level < 0.0:
            factor = -1.0
        if usual > 0.0 and factor is not None:
            odd.setdefault(factor, []).append(number)
    return [Contradiction((name,), factor, tuple(runs), ()) for factor, runs in odd.items()]


def _known(view: RunView, name: str) -> bool:
    return name in view.outputs and bool(np.isfinite(view.outputs[name]).any())


def _wrong_clocks(runs: Sequence[MeasuredRun], views: Sequence[RunView]) -> tuple[list[Fault], list[str]]:
    """Finds runs whose clock is wrong, and blanks all channels after the fault."""
    faults: list[Fault] = []
    notes: list[str] = []
    for one in clock_faults(views):
        run, view = runs[one.run], views[one.run]
        if not any(np.isfinite(values[one.start :]).any() for values in view.outputs.values()):
            continue
        start, end = float(run.time[one.start]), float(run.time[-1])
        faults.append(Fault(run.name, "time", "clock", start, end, one.factor))
        for values in view.outputs.values():
            values[one.start :] = np.nan
        notes.append(f"run {run.name}: its clock {one.evidence}; left out from {start:.6g} s on")
    return faults, notes


def _after_collisions(
    runs: Sequence[MeasuredRun], views: Sequence[RunView], wrong_clocks: Collection[str]
) -> tuple[list[Fault], list[str]]:
    """Finds runs with a collision, and blanks all channels after it. A clock that jumps looks like a collision."""
    faults: list[Fault] = []
    notes: list[str] = []
    for one in collisions(views):
        run, view = runs[one.run], views[one.run]
        if run.name in wrong_clocks:
            continue
        first, last = float(run.time[one.row + 1]), float(run.time[-1])
        faults += [Fault(run.name, name, "collision", first, last) for name in one.names]
        for values in view.outputs.values():
            values[one.row + 1 :] = np.nan
        notes.append(collision_note(run.name, one.names, first - float(run.time[0])))
    return faults, notes


def _spans(time: Vector, mask: Mask) -> list[tuple[float, float]]:
    return [(float(time[start]), float(time[stop - 1])) for start, stop in stretches(mask)]


def _resolution(name: str, runs: Sequence[MeasuredRun], signals: Mapping[str, Signal]) -> float:
    """Returns the stated step of a signal, or else its smallest step in any run; 0: it never changes."""
    if (stated := signals[name].resolution) is not None:
        return stated
    values = np.unique(np.concatenate([run.outputs[name] for run in runs]))
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * np.max(np.abs(values), initial=0.0)]
    return float(steps.min()) if steps.size else 0.0
