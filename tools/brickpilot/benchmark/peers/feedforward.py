"""The peers kS/kV/kA: the voltage of a side is kS sgn(v) + kV v + kA dv/dt, as WPILib models a drivetrain."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.benchmark.peers.grid import on_grid, steps_for
from brickpilot.benchmark.peers.wheels import Drive, simulated_by_side
from brickpilot.benchmark.real_score import Predictions
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.holdout import Roles

Array = NDArray[np.float64]

_MOST_SAMPLES = 10_000  # of all runs, in the fit with delays
_MOVING = 0.02  # of the largest speed: WPILib leaves out samples that stand still


def with_delays(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the law with a delay of the command and of each channel, fitted by simulation.

    A long log is thinned first, by whole numbers of samples, because the fit simulates it some hundred times.
    """
    from brickpilot.benchmark.feedforward_fit import fit_feedforward

    every = 1 + sum(len(run.time) for run in dataset.runs) // _MOST_SAMPLES
    thinned = dataclasses.replace(dataset, runs=tuple(_thinned(run, every) for run in dataset.runs))
    found = fit_feedforward(thinned, roles.by_run).predictions
    return {
        run.name: {name: np.interp(run.time, few.time, values) for name, values in found[run.name].items()}
        for run, few in zip(dataset.runs, thinned.runs, strict=True)
    }


def _thinned(run: Run, every: int) -> Run:
    def few(signals: Mapping[str, Array]) -> dict[str, Array]:
        return {name: values[::every] for name, values in signals.items()}

    return dataclasses.replace(
        run, time=run.time[::every], inputs=few(run.inputs), outputs=few(run.outputs), raw_outputs=few(run.raw_outputs)
    )


def by_regression(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of WPILib's own fit: one least-squares regression of the acceleration, without delays.

    The regression is that of SysId: (v' - v) / dt on v, volts and sgn(v), over the samples that move.
    """
    return simulated_by_side(on_grid(dataset, steps_for(dataset)[0]), roles.fit(), _regressed)


def _regressed(drives: Sequence[Drive]) -> Callable[[Drive], Array]:
    speed = np.concatenate([drive.speed[:-1] for drive in drives])
    gained = np.concatenate([np.diff(drive.speed) / drive.step for drive in drives])
    volts = np.concatenate([drive.volts[:-1] for drive in drives])
    moving = np.abs(speed) > _MOVING * np.abs(speed).max(initial=0.0)
    columns = np.column_stack([speed, volts, np.sign(speed)])[moving]
    decay, drive_gain, friction = (float(one) for one in np.linalg.lstsq(columns, gained[moving], rcond=1e-10)[0])

    def simulate(drive: Drive) -> Array:
        return _free_run(drive, decay, drive_gain, max(-friction, 0.0))

    return simulate


def _free_run(drive: Drive, decay: float, drive_gain: float, friction: float) -> Array:
    """Returns the speed (n,), exact between changes of direction; friction holds a side that stands."""
    decay = min(decay, -1e-9)
    kept = np.exp(decay * drive.step)
    gain = (kept - 1.0) / decay
    found = np.empty(len(drive.volts))
    speed = float(drive.speed[0])
    for row, volts in enumerate(drive.volts):
        found[row] = speed
        push = drive_gain * float(volts)
        way = np.sign(speed) if speed != 0.0 else np.sign(push) * float(abs(push) > friction)
        after = kept * speed + gain * (push - friction * way)
        speed = 0.0 if way == 0.0 or (after * way < 0.0 and abs(push) <= friction) else after
    return found
