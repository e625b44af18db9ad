"""Makes runs of a log's signals. A log with many manoeuvres is split at the rests between them, or at stated times."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.audit.view import stretches
from brickpilot.data.holdout import kind_of
from brickpilot.data.signals import RATE_OF, SIGNALS, of_motors
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector
from brickpilot.importers.mapping import Scaling, Signals
from brickpilot.importers.writer import NewRun

Spans = Sequence[tuple[float, float]] | None
"""The spans (from, to) in s of `--split FROM,TO`; empty: the option is not given; None: `--split rests`."""

_SHORTEST_REST_S = 0.3
_KEPT_S = 0.5  # s: a manoeuvre's run keeps this much of the rest before it and after it
_SPAN_S = 0.1  # s: a rate is computed over this span on each side of a sample
_PAUSE_S, _PAUSE_STEPS = 1.0, 20.0  # limits in s, and in 0.9 quantiles of the time steps: a pause is longer than both
_STILL = 0.05  # motion slower than this share of the log's fastest motion counts as rest


def parse_split(entries: Sequence[str]) -> Spans:
    """Reads the values of `--split`.

    Raises:
        InputError: an entry has another form, or `rests` is not the only entry.
    """
    if "rests" in entries:
        if len(entries) > 1:
            raise InputError("rests stands alone", field="--split")
        return None
    spans = []
    for entry in entries:
        try:
            start, end = (float(text) for text in entry.split(","))
        except ValueError:
            start = end = math.nan
        if not start < end:
            raise InputError("is neither rests nor FROM,TO in s", field=f"--split {entry}")
        spans.append((start, end))
    return spans


def runs_of(logs: Sequence[Signals], spans: Spans, names: Sequence[str]) -> tuple[list[NewRun], list[str]]:
    """Returns the runs of the logs, and notes; each note names its file.

    Args:
        logs: the logs' signals.
        spans: the result of `parse_split`.
        names: for each log, the name of its run if the log is not split. With several logs, the names of the runs of a
            split log begin with this name.

    Raises:
        InputError: a span has fewer than two rows; spans are given and a log's clock starts again; or a log has no
            manoeuvre.
    """
    runs, notes = list[NewRun](), list[str]()
    for log, name in zip(logs, names, strict=True):
        prefix = f"{name}_" if len(logs) > 1 else ""
        own, own_notes = _runs_of(log, spans, name, prefix)
        runs += own
        notes += [f"{log.file.name}: {note}" for note in (*log.notes, *own_notes)]
    return runs, notes


def _runs_of(log: Signals, spans: Spans, whole: str, prefix: str) -> tuple[list[NewRun], list[str]]:
    """Returns the runs of a log, and notes. `whole`: name of an unsplit log's run; `prefix`: start of other names."""
    scalings = {name: log.scalings.get(name, Scaling()) for name in log.columns}
    signals = {name: scalings[name].scale * cells + scalings[name].offset for name, cells in log.columns.items()}
    time = signals.pop("time") * si_factor(log.units["time"], "s")
    runs: list[NewRun] = []
    before: int | None = None
    paused = pauses(time)
    for part, rows in _parts(time, signals, sorted({*log.starts, *paused}), spans):
        pause = None if before is None else float(time[rows.start] - time[before])
        gap_s = None if pause is None or pause < 0.0 else round(pause, 6)
        cells = {name: values[rows] for name, values in log.columns.items()}
        runs.append(NewRun(f"{prefix}{part}" if part else whole, cells, gap_s))
        before = rows.stop - 1
    notes = []
    if paused and not spans:
        longest = max(float(time[row] - time[row - 1]) for row in paused)
        notes.append(
            f"pauses between its rows: {len(paused)}, of {longest:.3g} s at most; a new run begins behind each"
        )
    if spans is None:
        kept = sum(run.columns["time"].size for run in runs)
        notes.append(f"it is split at its rests into {len(runs)} runs, which hold {kept} of {time.size} rows")
    elif not spans and np.all(np.diff(time) > 0.0) and (count := len(manoeuvres(time, signals))) > 1:
        notes.append(f"it holds {count} manoeuvres with rests between them; --split rests makes a run of each")
    return runs, notes


def _parts(time: Vector, signals: Mapping[str, Vector], starts: Sequence[int], spans: Spans) -> list[tuple[str, slice]]:
    """Returns name and rows of each run of a log, in order; a run that is the whole log has no name.

    Args:
        time: (n,), in s.
        signals: inputs and outputs, NaN where blank.
        starts: rows at which a new run has to begin.
        spans: the result of `parse_split`.
    """
    if spans:
        return _stated(time, spans)
    bounds = [0, *starts, time.size]
    pieces = [slice(start, stop) for start, stop in pairwise(bounds) if stop - start >= 2]
    if spans is not None:
        whole = len(pieces) == 1 and pieces[0] == slice(0, time.size)
        return [("" if whole else f"part_{number}", piece) for number, piece in enumerate(pieces, 1)]
    counted: Counter[str] = Counter()
    parts = []
    for piece in pieces:
        for kind, rows in manoeuvres(time[piece], {name: values[piece] for name, values in signals.items()}):
            counted[kind] += 1
            parts.append((f"{kind}_{counted[kind]}", slice(piece.start + rows.start, piece.start + rows.stop)))
    if not parts:
        raise InputError("finds no manoeuvre: no input is ever other than 0", field="--split rests")
    return parts


def pauses(time: Vector) -> list[int]:
    """Returns the first row after each pause of the logger; in a pause the inputs are unknown. `time`: (n,), in s.

    In a log that has a row only where a signal changes, long time steps are usual, so they do not count as pauses.
    """
    steps = np.diff(time)
    usual = float(np.quantile(steps[steps > 0.0], 0.9)) if np.any(steps > 0.0) else math.inf
    return (np.flatnonzero(steps > max(_PAUSE_S, _PAUSE_STEPS * usual)) + 1).tolist()


def _stated(time: Vector, spans: Sequence[tuple[float, float]]) -> list[tuple[str, slice]]:
    if np.any(np.diff(time) <= 0.0):
        raise InputError("needs a log whose clock does not start again", field="--split FROM,TO")
    parts = []
    for number, (start, end) in enumerate(spans, 1):
        first, last = np.searchsorted(time, start), np.searchsorted(time, end, side="right")
        if last - first < 2:
            message = f"holds {last - first} rows of a log from {time[0]:.6g} to {time[-1]:.6g} s"
            raise InputError(message, field=f"--split {start:g},{end:g}")
        parts.append((f"part_{number}", slice(int(first), int(last))))
    return parts


def manoeuvres(time: Vector, signals: Mapping[str, Vector]) -> list[tuple[str, slice]]:
    """Returns kind and rows of each manoeuvre, with up to 0.5 s of the rest before it and after it.

    The kind is straight, spin or curve; for a motor, drive. In a rest, no input drives the vehicle and the vehicle
    hardly moves, for at least 0.3 s.

    Args:
        time: (n,), in s, strictly increasing.
        signals: inputs and outputs; NaN where blank.
    """
    inputs = {name: np.nan_to_num(values) for name, values in signals.items() if SIGNALS[name].kind == "input"}
    driven = np.any([values != 0.0 for values in inputs.values()], axis=0)
    busy = driven | _moves(time, signals, ~driven)
    rests = [slice(start, stop) for start, stop in stretches(~busy) if time[stop - 1] - time[start] >= _SHORTEST_REST_S]
    resting = np.zeros(time.size, dtype=bool)
    for rest in rests:
        resting[rest] = True
    half_track = catalogue.parameter("half_track").preset
    return [
        (
            kind_of(of_motors({name: values[busy_rows] for name, values in inputs.items()}, half_track)),
            _with_rest(time, busy_rows, rests),
        )
        for busy_rows in (slice(start, stop) for start, stop in stretches(~resting))
        if driven[busy_rows].any()
    ]


def _with_rest(time: Vector, busy: slice, rests: Sequence[slice]) -> slice:
    """Returns the rows of a manoeuvre with some of the rest before and after it; no two runs share a row."""
    first, last = busy.start, busy.stop
    for rest in rests:
        middle = (rest.start + rest.stop) // 2
        if rest.stop == busy.start:
            begins = int(np.searchsorted(time, time[busy.start] - _KEPT_S))
            first = max(begins, rest.start if rest.start == 0 else middle)
        if rest.start == busy.stop:
            ends = int(np.searchsorted(time, time[busy.stop - 1] + _KEPT_S, side="right"))
            last = min(ends, rest.stop if rest.stop == time.size else middle)
    return slice(first, last)


def _moves(time: Vector, signals: Mapping[str, Vector], undriven: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Returns for each row whether a wheel, the motor or the body moves; accelerations and currents are not used."""
    moves = np.zeros(time.size, dtype=bool)
    for name, values in signals.items():
        known = np.isfinite(values)
        if np.count_nonzero(known) < 2:
            continue
        if name in RATE_OF or name == "yaw_angle":
            rate = np.abs(_slope(time, np.interp(time, time[known], values[known])))
        elif name in RATE_OF.values() or name == "yaw_rate":
            filled = np.interp(time, time[known], values[known])
            offset = float(np.median(filled[undriven])) if undriven.any() else 0.0
            held = np.concatenate([[0.0], np.cumsum((filled[:-1] - offset) * np.diff(time))])
            rate = np.abs(_slope(time, held))
        else:
            continue
        moves |= rate > _STILL * float(np.quantile(rate, 0.995))
    return moves


def _slope(time: Vector, values: Vector) -> Vector:
    """Returns the mean slope over `_SPAN_S` on both sides of each sample."""
    before: Vector = np.interp(time - _SPAN_S, time, values)
    after: Vector = np.interp(time + _SPAN_S, time, values)
    span: Vector = np.minimum(time + _SPAN_S, time[-1]) - np.maximum(time - _SPAN_S, time[0])
    return (after - before) / span
