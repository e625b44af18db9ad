"""Compares measured runs with a model: each run is simulated from its own inputs, and the error is measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from brickpilot.data.agreement import SignalError, signal_error
from brickpilot.data.dataset import Dataset, OwnUnit, frame_text, own_units
from brickpilot.data.holdout import enough_to_fit
from brickpilot.data.motion import MOTOR_RATE_OF, check_window, window_length
from brickpilot.data.shown import Result
from brickpilot.data.signals import SUMMED
from brickpilot.errors import InputError
from brickpilot.fit.calibration import NOTHING_FREE, calibrate
from brickpilot.fit.descent import Progress
from brickpilot.fit.parameters import plan
from brickpilot.vehicle.compared_runs import Comparable, comparable, compared_signals, is_compared
from brickpilot.vehicle.headline import AHEAD, FREE_RUN, Headline, headline_of, simulated_at, track
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Array, Outputs

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Trace:
    """One signal of one run, for a plot: `simulated` and `measured` at `time`, (n,) each; NaN: nothing to draw."""

    time: Array
    simulated: Array
    measured: Array


@dataclass(frozen=True)
class RunComparison:
    """The errors of one run as integrals over time (eq. 20). The headline numbers are in `Comparison.headline`.

    Attributes:
        signals: measured signal -> its error over the whole run.
        windows: motor velocity -> its error over open-loop windows; empty without windows.
        traces: signal -> its trace, for plots.
    """

    name: str
    role: str
    signals: Mapping[str, SignalError]
    windows: Mapping[str, SignalError]
    traces: Mapping[str, Trace]


@dataclass(frozen=True)
class Comparison(Result):
    """The result of `compare`.

    Attributes:
        headline: how much of each signal the model explains.
        units: signal -> the unit in which the data set states it.
        frame: the coordinate frame of the data set, in words; empty for a motor.
        window_s: length of a motor's open-loop windows, s; 0: no windows.
        notes: sentences on what the program chose (roles, fitted parameters, signals left out) and on faults in the
            data set.
    """

    dataset: str
    model: Model
    runs: tuple[RunComparison, ...]
    headline: Headline
    units: Mapping[str, OwnUnit]
    frame: str
    window_s: float
    notes: tuple[str, ...]

    @property
    def horizon(self) -> str:
        """The name that the horizon of a motor's open-loop windows has in `headline`."""
        return horizon_name(self.window_s)

    def share(self, role: str, signal: str, *, windows: bool = False) -> float | None:
        """Returns the ratio of the error's norm to the signal's norm, over all runs of `role` ("fit" or "held_out").

        The ratio is 1 - `fit_percent` / 100; None if `fit_percent` has no value. See `data.agreement`.
        """
        return self.headline.of(signal, role, self.horizon if windows else FREE_RUN).share

    def to_frame(self) -> pandas.DataFrame:
        """Returns a row for each signal of each run at each horizon: what the model explains, and its error in SI.

        `horizon` is "free_run" or a length, as "1_s". `fit_percent` and `r2` are NaN for a signal that is zero.
        """
        import pandas

        rows = [
            {"run": run.name, "role": run.role, "signal": signal, "horizon": horizon, **found.to_json()}
            for run in self.runs
            for horizon in self.headline.horizons
            for signal in self.headline.signals
            if (found := self.headline.of_run(run.name, signal, horizon)).samples
        ]
        columns = ["run", "role", "signal", "horizon", "fit_percent", "r2", "rms_error", "rms_signal"]
        return pandas.DataFrame(rows, columns=columns)

    def to_json(self) -> dict[str, Any]:
        runs = []
        for run in self.runs:
            entry: dict[str, Any] = {"name": run.name, "role": run.role}
            entry["signals"] = {name: error.to_json() for name, error in run.signals.items()}
            entry["fit_percent"] = {
                horizon: {
                    signal: found.fit_percent
                    for signal in self.headline.signals
                    if (found := self.headline.of_run(run.name, signal, horizon)).samples
                }
                for horizon in self.headline.horizons
            }
            if run.windows:
                errors = {name: error.to_json() for name, error in run.windows.items()}
                entry["windows"] = {"window_s": self.window_s, "signals": errors}
            runs.append(entry)
        shared = {"dataset": self.dataset, "headline": self.headline.to_json()}
        return {**shared, "runs": runs, "notes": list(self.notes)}


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
        model: the model. None: the nominal values; those not stated as plain values are first fitted on the fit runs.
        window_s: length, s, of open-loop windows in which a motor's velocity is also compared. Each window restarts
            from the measured state, because the position sums up the velocity's error. 0: no windows. None: windows of
            1 s if all runs last at least 3 s.
        seed: the seed of the fit's random starts.

    Raises:
        InputError: the model is of another vehicle than the data, or gives none of the measured signals; `window_s` is
            not a number, negative, below `LEAST_WINDOW_S` or `LEAST_WINDOW_SAMPLES`, longer than every run, or given
            without a measured motor velocity; parameters have to be fitted but every run is held out.
        SimulationError: the plant diverges with this model.

    Example: a motor with a time constant of 0.15 s is compared with itself, and with a model of 20 % too much inertia:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> speed = 15 * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15))
    >>> step = pd.DataFrame({"time": time, "voltage": np.where(time >= 0.195, 5.0, 0.0), "speed": speed})
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "inductance": 0.0}
    >>> known |= {"wheel_inertia": 7.5e-4, "viscous_friction": 5e-4}
    >>> dataset = bp.Dataset.from_frames({"step": step}, vehicle="motor", nominal=known)
    >>> bp.compare(dataset).share("fit", "speed") < 1e-6    # the nominal values are exact
    True
    >>> heavy = bp.Model("heavy", "motor", "coupled", {**known, "wheel_inertia": 9e-4})
    >>> bp.compare(dataset, heavy).to_frame()[["run", "signal", "horizon", "fit_percent"]].round(1)
        run signal   horizon  fit_percent
    0  step  speed  free_run         97.1
    1  step  speed       1_s         97.1
    """
    if model is not None and model.vehicle != dataset.vehicle:
        raise InputError(
            f"the model is a {model.vehicle}, the data set {dataset.name} is of a {dataset.vehicle}", field="--model"
        )
    if window_s:
        check_window(dataset, window_s)
    model, remarks = (model, []) if model is not None else _nominal(dataset, seed, threads, progress)
    compared_signals(dataset, model)  # refuses a signal that is no measurement, before further work
    ready = comparable(dataset)
    notes = [ready.roles.note, *ready.measured.notes, *remarks]
    compared = compared_signals(ready.measured, model)
    notes.extend(compared.notes)
    if progress:
        progress(0, 1, "simulating")
    length = window_length(ready.measured, compared.names, window_s)
    found = _compared(ready, model, length, threads)
    if progress:
        progress(1, 1, "simulated")
    return dataclasses.replace(found, notes=tuple(dict.fromkeys([*notes, *found.notes])))


def horizon_name(length_s: float) -> str:
    """Returns the name of a horizon of `length_s` s in the headline numbers."""
    return f"{length_s:g}_s"


def _compared(ready: Comparable, model: Model, window_s: float, threads: int) -> Comparison:
    """Simulates the runs at each horizon, and returns the comparison with its notes on horizons."""
    lengths = {**AHEAD, **({horizon_name(window_s): window_s} if window_s else {})}
    compared = track(ready, model, lengths)
    simulated = simulated_at(compared, [model], threads=threads)[0]
    windows = next((one for one in compared.courses if window_s and one.horizon == horizon_name(window_s)), None)
    runs = []
    for number, run in enumerate(ready.measured.runs):
        outputs = simulated[FREE_RUN][run.name]
        measured = {name: values for name, values in run.outputs.items() if is_compared(name, outputs, model)}
        signals, traces = _errors(run.time, measured, outputs)
        errors: dict[str, SignalError] = {}
        if windows is not None and windows.horizon in simulated:
            own, within = compared.measured[run.name], windows.stretches[number].within
            rates = {name: own[name] for name in MOTOR_RATE_OF.values() if name in own}
            there = simulated[windows.horizon][run.name]
            errors, drawn = _errors(run.time, rates, {name: np.where(within, there[name], np.nan) for name in rates})
            traces |= {f"{name} in windows": one for name, one in drawn.items()}
        runs.append(RunComparison(run.name, ready.roles.by_run[run.name], signals, errors, traces))
    shown = dict.fromkeys([*compared.signals, *(name for run in ready.measured.runs for name in run.outputs)])
    return Comparison(
        dataset=ready.measured.name,
        model=model,
        runs=tuple(runs),
        headline=headline_of(compared, simulated),
        units=own_units(ready.measured, shown),
        frame=frame_text(ready.measured),
        window_s=window_s,
        notes=compared.notes,
    )


def _nominal(dataset: Dataset, seed: int, threads: int, progress: Progress | None) -> tuple[Model, list[str]]:
    """Returns the model of the nominal values, and notes. Values that are not stated as plain values are fitted."""
    stated = plan(dataset)
    if not stated.free:
        return stated.at(stated.start()), ["Nothing was fitted.", *stated.notes, NOTHING_FREE]
    some, note = enough_to_fit(dataset)
    fitted = calibrate(some, seed=seed, threads=threads, progress=progress)
    first = f"The data set does not fix {', '.join(fitted.parameters)}: fitted on the fit runs first."
    notes = list(fitted.notes if note is None else [note, *fitted.notes[1:]])  # `note` replaces the note on roles
    return fitted.model, [first, *notes]


def _errors(
    time: Array, measured: Mapping[str, Array], simulated: Outputs
) -> tuple[dict[str, SignalError], dict[str, Trace]]:
    """Returns the error of each measured signal, and its trace for a plot."""
    errors = {n: signal_error(time, simulated[n], values, relative=n in SUMMED) for n, values in measured.items()}
    return errors, {name: Trace(time, simulated[name], values) for name, values in measured.items()}
