"""Finds faults in measured outputs before any fit; no model is needed.

Single samples may be clipped, frozen, lost, or swapped with another column. A whole channel may have a reversed sign or
another unit. A clock may drift or jump. A fault is reported only if a moving body with sensor noise and quantisation
cannot have caused the samples. In doubt a sample is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.data.audit import stuck
from brickpilot.data.audit.contradictions import contradictions
from brickpilot.data.audit.fault import Fault, Kind, channel_note, collision_note, range_note, rows_note
from brickpilot.data.audit.jumps import jumps
from brickpilot.data.audit.run_clocks import clock_faults, delay_note, delays
from brickpilot.data.audit.stuck import held, held_note
from brickpilot.data.audit.view import Channels, Mask, RunView, Vector, driven_by, integral, stretches
from brickpilot.data.description import Signal
from brickpilot.data.signals import RATE_OF, Frame

__all__ = ["Audited", "Fault", "audit"]

_WITHIN_S = 0.1  # s: a collision stops a vehicle within this time; friction, a weak battery and a slope need longer
_SETTLED_S = 0.3  # s: within this time after a change of command, the command itself may change the speed
_CHANGE = 0.05  # share of the largest command: smaller changes of a command are ignored
_FAST = 0.4  # share of the fastest motion of any run: a slower wheel shows no collision, as friction may stop it
_LOST = 0.5  # least share of the speed that a vehicle loses in a collision; a rough floor takes less
_SMOOTH_S = 0.02  # s: the span over which a rate is averaged, or a sum (angle or travel) is differenced
_STEPS = 4.0  # in resolutions: a coarse channel may show a smaller loss of speed without a collision
_AFTER_S = 0.03  # s: least time for which the speed stays low after a collision


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
    runs: Sequence[Channels], signals: Mapping[str, Signal], frame: Frame, nominal: Mapping[str, float] | None = None
) -> Audited:
    """Finds the faults of all runs.

    Args:
        runs: in the data set's order. The resolution of a signal is estimated from all runs together.
        signals: signal -> its description in the data set.
        frame: the frame of the data set's files.
        nominal: wheel_radius, half_track (m) and battery_voltage (V), as far as these are known.
    """
    resolution = {name: _resolution(name, runs, signals) for name in runs[0].outputs} if runs else {}
    search = _Search([_view(run, resolution) for run in runs])
    search.damaged_rows(signals, frame)
    search.wrong_channels(nominal or {})
    search.beyond_range(signals)
    search.wrong_clocks()
    search.collisions()
    search.keep_samples()
    if late := delays(search.views):
        search.notes.append(delay_note(late))
    order = {run.name: number for number, run in enumerate(runs)}
    faults = sorted(search.faults, key=lambda one: (order[one.run], one.from_s, one.signal))
    return Audited({view.name: view.outputs for view in search.views}, tuple(faults), tuple(search.notes))


def _view(run: Channels, resolution: Mapping[str, float]) -> RunView:
    outputs = {name: values.copy() for name, values in run.outputs.items()}
    return RunView(run.time, run.inputs, outputs, run.name, resolution, held(run.time, run.outputs, resolution))


def _resolution(name: str, runs: Sequence[Channels], signals: Mapping[str, Signal]) -> float:
    """Returns the stated resolution of a signal, or else its smallest step in any run; 0: the signal never changes."""
    if (stated := signals[name].resolution) is not None:
        return stated
    values = np.unique(np.concatenate([run.outputs[name] for run in runs]))
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * np.max(np.abs(values), initial=0.0)]
    return float(steps.min()) if steps.size else 0.0


class _Search:
    """The runs under audit, with the faults and notes that are found. Each method sets damaged samples to NaN."""

    def __init__(self, views: Sequence[RunView]) -> None:
        self.views = views
        self.faults: list[Fault] = []
        self.notes: list[str] = []

    def damaged_rows(self, signals: Mapping[str, Signal], frame: Frame) -> None:
        """Finds damaged samples."""
        damage = [jumps(view, signals, frame) for view in self.views]
        across = stuck.AcrossRuns(self.views)
        for view, masks in zip(self.views, damage, strict=True):
            masks["clipped"] = {name: stuck.clipped(view, name, signals[name].range) for name in view.outputs}
            view.blank(masks["clipped"])
            masks["frozen"] = {}
            for name in view.outputs:
                masks["frozen"][name], at_end = stuck.frozen(view, name, across)
                masks["clipped"][name] |= at_end
            for kind, by_signal in masks.items():
                for name, mask in by_signal.items():
                    self._report_rows(view, name, kind, mask)
        for view, masks in zip(self.views, damage, strict=True):
            view.blank(masks["clipped"])
            view.blank(masks["frozen"])
            for name, one in view.held.items():
                one.blank_repeats(view.outputs[name])

    def wrong_channels(self, nominal: Mapping[str, float]) -> None:
        """Finds channels that are wrong as a whole. If an input or the time is wrong, the whole run is blanked."""
        for one in contradictions(self.views, nominal):
            inputs = self.views[0].inputs
            signals = _columns(one.names, inputs)
            runs = [self.views[number] for number in one.runs]
            named = [run.name for run in runs]
            self.notes.append(channel_note(signals, one.factor, named, len(self.views), _columns(one.against, inputs)))
            for name in signals:
                kind: Kind = "sign" if one.factor == -1.0 else "clock" if name == "time" else "unit"
                for view in runs:
                    if name not in view.outputs or _is_known(view, name):
                        self._leave_out(view, name, kind, one.factor)

    def beyond_range(self, signals: Mapping[str, Signal]) -> None:
        """Finds channels beyond their stated range, if no earlier step has found their fault.

        A channel that is beyond its range in most runs counts as wrong in all runs, because the motion in the other
        runs may only be too small to exceed the range.
        """
        for name, signal in signals.items():
            known = [view for view in self.views if name in view.outputs and _is_known(view, name)]
            wrong = [view for view in known if stuck.leaves(view.outputs[name], signal.range)]
            if 2 * len(wrong) > len(known):
                wrong = known
            for view in wrong:
                self._leave_out(view, name, "unit")
            if wrong:
                self.notes.append(range_note(name, [view.name for view in wrong], len(self.views)))

    def wrong_clocks(self) -> None:
        """Finds runs whose clock is wrong from some row on."""
        for one in clock_faults(self.views):
            view = self.views[one.run]
            if any(np.isfinite(values[one.start :]).any() for values in view.outputs.values()):
                self._leave_out(view, "time", "clock", one.factor, one.start)
                start = float(view.time[one.start])
                self.notes.append(f"run {view.name}: its clock {one.evidence}; left out from {start:.6g} s on")

    def collisions(self) -> None:
        """Finds the first collision of each run, and leaves out all samples after it.

        In a collision, a fast vehicle loses speed although its command does not change. The motion after a collision
        depends on the obstacle, which was not measured. Two kinds of runs are skipped: runs without a measured wheel or
        shaft, and runs with a wrong clock, because a clock's jump looks like a collision.
        """
        wrong_clocks = {one.run for one in self.faults if one.kind == "clock"}
        rates = [_rates(view) for view in self.views]
        names = dict.fromkeys(name for each in rates for name in each)
        fastest = {name: max(float(np.max(np.abs(each[name]))) for each in rates if name in each) for name in names}
        for view, each in zip(self.views, rates, strict=True):
            last = {name: row for name in each if (row := _loss(view, name, each[name], fastest[name])) is not None}
            sides = {driven_by(name) for name in last}
            if view.name in wrong_clocks or not ("shaft" in sides or {"left", "right"} <= sides):
                continue
            start = min(last.values()) + 1
            for name in last:
                self._leave_out(view, name, "collision", start=start)
            for values in view.outputs.values():
                values[start:] = np.nan
            self.notes.append(collision_note(view.name, tuple(last), float(view.time[start] - view.time[0])))

    def keep_samples(self) -> None:
        """Blanks the rows that repeat a held sample; adds one note for all runs with the same held channels."""
        alike: dict[tuple[str, ...], list[RunView]] = {}
        for view in self.views:
            for name, one in view.held.items():
                view.outputs[name][~one.fresh] = np.nan
            if view.held:
                alike.setdefault(tuple(view.held), []).append(view)
        for names, views in alike.items():
            beats = {name: float(np.median([view.held[name].beat for view in views])) for name in names}
            row = float(np.median([view.interval for view in views]))
            self.notes.append(held_note([view.name for view in views], len(self.views), beats, row))

    def _report_rows(self, view: RunView, name: str, kind: Kind, mask: Mask) -> None:
        time = view.time
        spans = [(float(time[start]), float(time[stop - 1])) for start, stop in stretches(mask)]
        found = [Fault(view.name, name, kind, *span) for span in spans]
        self.faults += found
        if found:
            self.notes.append(rows_note(found, int(np.count_nonzero(mask)), len(mask), float(time[0])))

    def _leave_out(self, view: RunView, name: str, kind: Kind, factor: float | None = None, start: int = 0) -> None:
        """Reports a fault and blanks the channel from row `start` on; for an input or the time, blanks all channels."""
        self.faults.append(Fault(view.name, name, kind, float(view.time[start]), float(view.time[-1]), factor))
        for blanked in [name] if name in view.outputs else view.outputs:
            view.outputs[blanked][start:] = np.nan


def _columns(names: Sequence[str], inputs: Mapping[str, Vector]) -> tuple[str, ...]:
    """Returns the data set's signals for the channels `names`; for a drive, the inputs of its motors."""
    found: dict[str, None] = {}
    for name in names:
        _, is_drive, side = name.partition("drive_")
        own = [one for one in inputs if one.endswith(f"_{side}")] or list(inputs)
        found |= dict.fromkeys(own if is_drive else [name])
    return tuple(found)


def _is_known(view: RunView, name: str) -> bool:
    return bool(np.isfinite(view.outputs[name]).any())


def _rates(view: RunView) -> dict[str, Vector]:
    """Returns the rates of wheels or shaft, averaged over `_SMOOTH_S`."""
    found: dict[str, Vector] = {}
    for name in view.outputs:
        known = np.isfinite(view.outputs[name])
        if name not in {*RATE_OF, *RATE_OF.values()} or np.count_nonzero(known) < 2 or view.interval > _WITHIN_S / 4:
            continue
        values = np.interp(view.time, view.time[known], view.outputs[name][known])
        sums = values if name in RATE_OF else integral(view.time, values)
        half, rows = max(1, round(_SMOOTH_S / view.interval) // 2), np.arange(len(sums))
        late, early = np.minimum(rows + half, len(sums) - 1), np.maximum(rows - half, 0)
        found[name] = (sums[late] - sums[early]) / (view.time[late] - view.time[early])
    return found


def _loss(view: RunView, name: str, rate: Vector, fastest: float) -> int | None:
    """Returns the last sample before the first sudden loss of speed at a constant command; None: no such loss."""
    within, after = (max(1, round(seconds / view.interval)) for seconds in (_WITHIN_S, _AFTER_S))
    count = len(rate) - within - after
    if count < 1 or fastest == 0.0:
        return None
    before = rate[:count]
    left = np.max([rate[within + k : within + k + count] * np.sign(before) for k in range(after)], axis=0)
    settled = _settled(view, name)
    step = view.resolution[name] / (_SMOOTH_S if name in RATE_OF else 1.0)
    lost = np.maximum(_LOST * np.abs(before), _STEPS * step)
    hit = (np.abs(before) > _FAST * fastest) & (np.abs(before) - left > lost)
    hit &= settled[:count] & settled[within + after : within + after + count]
    return int(np.argmax(hit)) if hit.any() else None


def _settled(view: RunView, name: str) -> Mask:
    """Returns the samples at which the channel's drive is not 0 and no command has changed for `_SETTLED_S`."""
    settled = np.ones(len(view.time), dtype=bool)
    rows = max(1, round(_SETTLED_S / view.interval))
    for drive in (drive for which, drive in view.drives.items() if which != "yaw"):
        past = np.lib.stride_tricks.sliding_window_view(np.pad(drive, (rows, 0), mode="edge"), rows + 1)
        settled &= np.ptp(past, axis=1) <= _CHANGE * float(np.max(np.abs(drive)))
    return np.asarray(settled & (view.drives[driven_by(name)] != 0.0))
