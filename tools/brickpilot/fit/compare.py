"""Compares measured runs with a model: each run is simulated from its own inputs, and the error is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import brickpilot
from brickpilot.data import holdout
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.ils import SignalError, pooled, signal_error
from brickpilot.data.signals import SUMMED
from brickpilot.errors import InputError
from brickpilot.fit.calibrate import Calibration, calibrate
from brickpilot.fit.compared import compared_signals, is_compared
from brickpilot.fit.rates import MOTOR_RATE_OF, measured_rates
from brickpilot.fit.replay import Array, Outputs, Replay, Window
from brickpilot.vehicle.model import Model

if TYPE_CHECKING:
    import pandas

Progress = Callable[[int, int, str], None]

WINDOW_S = 1.0
"""s: default length of the open-loop windows in which a motor's velocity is compared."""

LEAST_WINDOW_S, LEAST_WINDOW_SAMPLES = 1e-3, 10
"""No window is shorter than either. Samples count by the median step of the run with the longest steps."""


@dataclass(frozen=True)
class Trace:
    """One signal of one run, for a plot: `simulated` and `measured` at `time`, (n,) each; NaN: nothing to draw."""

    time: Array
    simulated: Array
    measured: Array


@dataclass(frozen=True)
class RunComparison:
    """The errors of one run.

    Attributes:
        signals: by measured signal, over the whole run.
        windows: by rate, over open-loop windows; empty where there are none.
        traces: by signal, for plots.
    """

    name: str
    role: str
    signals: Mapping[str, SignalError]
    windows: Mapping[str, SignalError]
    traces: Mapping[str, Trace]


@dataclass(frozen=True)
class Comparison:
    """The result of `compare`.

    Attributes:
        window_s: length of the open-loop windows, s; 0 where none were made.
        notes: sentences on what the program chose (roles, fitted parameters, signals left out) and on faults in the
            data set.
    """

    dataset: str
    model: Model
    runs: tuple[RunComparison, ...]
    window_s: float
    notes: tuple[str, ...]

    def share(self, role: str, signal: str, *, windows: bool = False) -> float | None:
        """Returns rms error over rms signal of all runs of `role` ("fit" or "held_out"); None where there is none."""
        found = [(run.windows if windows else run.signals) for run in self.runs if run.role == role]
        return pooled(errors[signal] for errors in found if signal in errors).share

    def to_frame(self) -> pandas.DataFrame:
        """Returns a row for each signal of each run: rms of error and signal in SI, and the one over the other.

        `window_s` is the length of the open-loop windows, 0 for the whole run.
        """
        import pandas

        rows = [
            {
                "run": run.name,
                "role": run.role,
                "signal": name,
                "window_s": window_s,
                "rms_error": error.rms_error,
                "rms_signal": error.rms_signal,
                "share": error.share,
            }
            for run in self.runs
            for window_s, errors in ((0.0, run.signals), (self.window_s, run.windows))
            for name, error in errors.items()
        ]
        return pandas.DataFrame(rows)

    def _repr_html_(self) -> str:
        """Returns the table that a notebook shows; the pages' room makes it, which this one must not know."""
        return brickpilot.to_html(self)

    def to_json(self) -> dict[str, Any]:
        runs = []
        for run in self.runs:
            entry: dict[str, Any] = {"name": run.name, "role": run.role}
            entry["signals"] = {name: error.to_json() for name, error in run.signals.items()}
            if run.windows:
                errors = {name: error.to_json() for name, error in run.windows.items()}
                entry["windows"] = {"window_s": self.window_s, "signals": errors}
            runs.append(entry)
        return {"dataset": self.dataset, "runs": runs, "notes": list(self.notes)}


def compare(
    dataset: Dataset,
    model: Model | None = None,
    *,
    window_s: float | None = None,
    seed: int = 0,
    threads: int = 2,
    progress: Progress | None = None,
) -> Comparison:
    """Simulates every run open loop from its own inputs.

    Args:
        model: None: the data set's nominal values; parameters that they lack are first fitted on the fit runs.
        window_s: s; a motor's velocity is also compared in open-loop windows of this length, each restarted from the
            measured state, because the position sums up the velocity's error. 0: no windows; None: 1 s, for runs at
            least three times as long.
        seed: of the fit's random starts.

    Raises:
        InputError: the model is of another vehicle than the data; nothing was measured that it gives; `window_s` is
            not a number, negative, below `LEAST_WINDOW_S` or `LEAST_WINDOW_SAMPLES`, longer than every run, or there is
            no motor with a velocity to compare; parameters have to be fitted but every run is held out.
        SimulationError: the plant diverges with this model.
    """
    if model is not None and model.vehicle != dataset.vehicle:
        raise InputError(
            f"the model is a {model.vehicle}, the data set {dataset.name} is of a {dataset.vehicle}", field="--model"
        )
    if window_s:
        _check_window(dataset, window_s)
    replay = Replay(dataset)
    roles = holdout.assign(dataset, replay.inputs)
    notes = [roles.note, *dataset.notes]
    if model is None:
        fitted = calibrate(dataset, seed=seed, threads=threads, progress=progress)
        model = fitted.model
        notes += _fit_notes(fitted)
    compared = compared_signals(dataset, model)
    notes.extend(compared.notes)
    if progress:
        progress(0, 1, "simulating")
    outputs = replay.simulate([model], threads=threads)[0]
    length = _window_s(dataset, compared.names, window_s)
    windows = replay.windows(model, length, threads=threads) if length else {}
    runs = [
        _run(run, model, roles.by_run[run.name], outputs[run.name], windows.get(run.name, [])) for run in dataset.runs
    ]
    if progress:
        progress(1, 1, "simulated")
    return Comparison(dataset.name, model, tuple(runs), length, tuple(dict.fromkeys(notes)))


def _fit_notes(fitted: Calibration) -> list[str]:
    free = ", ".join(fitted.parameters)
    first = f"The data set does not fix {free}: fitted on the fit runs first." if free else "Nothing was fitted."
    return [first, *fitted.notes]


def _least_window_s(dataset: Dataset) -> float:
    coarsest = max(float(np.median(np.diff(run.time))) for run in dataset.runs)
    return max(LEAST_WINDOW_S, LEAST_WINDOW_SAMPLES * coarsest)


def _check_window(dataset: Dataset, asked: float) -> None:
    if dataset.vehicle != "motor":
        raise InputError("windows need a data set of a motor", field="--window")
    least = _least_window_s(dataset)
    longest = max(float(run.time[-1] - run.time[0]) for run in dataset.runs)
    if not (1 - 1e-6) * least <= asked <= longest:
        raise InputError(
            f"{asked:g} s is not within {least:g} s, the least of {LEAST_WINDOW_SAMPLES} samples and 1 ms, "
            f"and {longest:g} s, the longest run; 0: no windows",
            field="--window",
        )


def _window_s(dataset: Dataset, names: Sequence[str], asked: float | None) -> float:
    moves = any(name in names for pair in MOTOR_RATE_OF.items() for name in pair)
    if asked and not moves:
        raise InputError("windows need a velocity or a position that the model gives", field="--window")
    if asked is not None:
        return asked
    shortest = min(float(run.time[-1] - run.time[0]) for run in dataset.runs)
    return WINDOW_S if moves and shortest >= 3 * WINDOW_S >= 3 * _least_window_s(dataset) else 0.0


def _run(run: Run, model: Model, role: str, outputs: Outputs, windows: list[Window]) -> RunComparison:
    errors, traces = {}, {}
    for name, measured in run.outputs.items():
        if is_compared(name, outputs, model):
            errors[name] = signal_error(run.time, outputs[name], measured, relative=name in SUMMED)
            traces[name] = Trace(run.time, outputs[name], measured)
    in_windows = {}
    for rate, measured in (measured_rates(run) if windows else {}).items():
        if rate not in outputs:
            continue
        spans = [(w.samples, w.outputs[rate]) for w in windows]
        in_windows[rate] = pooled(signal_error(run.time[s], simulated, measured[s]) for s, simulated in spans)
        traces[f"{rate} in windows"] = _joined(run.time, measured, spans)
    return RunComparison(run.name, role, errors, in_windows, traces)


def _joined(time: Array, measured: Array, spans: list[tuple[slice, Array]]) -> Trace:
    simulated = np.full_like(time, np.nan)
    for samples, values in spans:
        simulated[samples] = values
    return Trace(time, simulated, measured)
