"""The first stage: makes a data set ready for fits, and seals the held-out data.

Later stages get only the inputs of a held-out run or stretch. They need these inputs because heat and charge carry over
from run to run. `prepare` also returns a `Sealed`, which keeps the measured values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data import holdout, periods
from brickpilot.data.audit import against_model
from brickpilot.data.dataset import Dataset, Nominal, Run, motor_inputs
from brickpilot.data.feedback import Loop, follows_outputs
from brickpilot.data.motion import cut_into_windows, run_of
from brickpilot.discover import numbers
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.explanation import FINE, Explanation, fit
from brickpilot.discover.parts import Excitation
from brickpilot.discover.seal import Sealed
from brickpilot.errors import InputError
from brickpilot.fit import parameters
from brickpilot.fit.descent import counted, search
from brickpilot.fit.parameters import Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual, of_bins
from brickpilot.fit.robust import noise_model, whitening
from brickpilot.vehicle.compared_runs import Comparable, contradictions, started
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay

Array = NDArray[np.float64]

_MOTOR_WINDOW_S = 1.0  # length of a window of a motor's run, s
_WINDOW_S = 0.6  # length of a window of another vehicle's run, s: a wheel turns once or twice in it
_NOISE_ROUNDS = 2  # rounds in which noise model and nominal model are fitted in turn
_HIGHEST_ORDER = 8  # highest order of a noise model, in bins; it spans a quarter of a second
_SEARCHED_WINDOWS = 80  # largest number of windows in the search; the fits after the search use all windows
_PERIODS_PER_TURN, _PERIODS_OVER_TRAVEL = 0.9, 1.5  # a periodic effect has at least so many periods

SD_SHARE = {
    "mass": numbers.RULER,
    "half_track": numbers.RULER,
    "wheel_radius": numbers.RULER,
    "resistance": numbers.BENCH,
    "torque_constant": numbers.BENCH,
    "emf_constant": numbers.BENCH,
    "battery_voltage": numbers.RULER,
    "yaw_inertia": numbers.ESTIMATE,
    "wheel_inertia": numbers.ESTIMATE,
    "inductance": numbers.ESTIMATE,
    "viscous_friction": numbers.GUESS,
    "rolling_friction": numbers.GUESS,
    "drag_area": numbers.GUESS,
}
"""Nominal parameter -> its sd, as a share, if none is stated. Not listed: physical constants and a force per volt."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A data set ready for fits. All stages up to the verdict work on it.

    Attributes:
        dataset: the fit runs, with averaged start states and an sd on every nominal value; held-out data keep only
            inputs.
        measured: the fit runs as measured; for a motor, `dataset` has the velocity in place of the position.
        compared: the runs that are compared with their simulation: the runs of `dataset`, or windows of these runs.
        windows: the fit runs cut into short windows; None if no wheel was measured.
        roles: which runs are fitted and which are held out.
        plan: the nominal parameters that are fitted.
        coarse: the residual of the fit runs on a coarse time grid, for the search.
        fine: the residual of the fit runs at the measured samples.
        excitation: the largest commands and readings of the runs, and their periodic motion.
        seed: seed of random starts.
        jobs: number of fits at the same time.
        deadline: the deadline of the whole discovery.
        loop: the feedback loop by which commands follow a measured output; None: no loop was found or looked for.
        innovations: whether residuals are innovations (less what their past predicts), as the loop biases free runs.
    """

    dataset: Dataset
    measured: Dataset
    compared: Dataset
    windows: Dataset | None
    roles: holdout.Roles
    plan: Plan
    coarse: Residual
    fine: Residual
    excitation: Excitation
    seed: int
    jobs: int
    deadline: Deadline
    loop: Loop | None = None
    innovations: bool = False

    @property
    def windowed(self) -> bool:
        """Whether windows of runs are compared."""
        return self.compared is not self.dataset


def prepare(
    dataset: Dataset, model: Model | None, *, seed: int, jobs: int, deadline: Deadline = NO_LIMIT
) -> tuple[Prepared, Sealed]:
    """Leaves out channels that contradict the model, assigns roles, seals held-out data, and sets up the residuals.

    Raises:
        InputError: the model gives none of the measured signals, every run is held out, or `model` is of another
            vehicle.
    """
    stated = dataset if model is None else _starting_from(dataset, model)
    wrong = contradictions(stated)
    measured = against_model.leave_out(dataset, wrong)
    stated = with_default_sds(against_model.leave_out(stated, wrong))
    inputs = {run.name: motor_inputs(run, stated) for run in stated.runs}
    roles = holdout.assign(stated, inputs, stretches=True)
    if not roles.fit():
        raise InputError("every run is held out: there is none to fit", file=measured.path, field="runs.role")
    whole = started(stated, inputs)
    ready = _blind(whole, roles)
    plan = parameters.plan(ready)
    is_motor = ready.vehicle == "motor"
    windows = _windows(whole, roles, inputs, _MOTOR_WINDOW_S if is_motor else _WINDOW_S)
    windowed = is_motor and windows is not None
    excitation = _excitation(_blind(stated, roles), ready, inputs, windowed=windowed)
    plain = whole  # the data in the form that `compare` and `calibrate` use
    if model is not None:
        plain = started(measured, {run.name: motor_inputs(run, measured) for run in measured.runs})
    sealed = Sealed(whole, Comparable(measured, plain, roles))
    compared = windows if windowed and windows is not None else ready
    coarse, fine = _residuals(ready, compared, plan, jobs)
    prepared = Prepared(
        dataset=ready,
        measured=_blind(measured, roles),
        compared=compared,
        windows=None if is_motor else windows,
        roles=roles,
        plan=plan,
        coarse=coarse,
        fine=fine,
        excitation=excitation,
        seed=seed,
        jobs=jobs,
        deadline=deadline,
    )
    return prepared, sealed


def prepare_windows(prepared: Prepared) -> Prepared | None:
    """Returns the same data in short windows. A window starts from the measured state, so the wheels' phase is right.

    Returns None if the data are in windows already, no wheel was measured, or a window would hold too few samples.
    """
    windows = prepared.windows
    if windows is None or not any(run.outputs for run in windows.runs):
        return None
    coarse, fine = _residuals(prepared.dataset, windows, prepared.plan, prepared.jobs)
    excitation = dataclasses.replace(prepared.excitation, windowed=True)
    return dataclasses.replace(
        prepared, compared=windows, windows=None, coarse=coarse, fine=fine, excitation=excitation
    )


def _residuals(ready: Dataset, compared: Dataset, plan: Plan, jobs: int) -> tuple[Residual, Residual]:
    """Returns the residual of the fit runs on a coarse time grid, and at the measured samples."""
    names = [run.name for run in compared.runs if run.outputs]
    some = names[:: -(-len(names) // _SEARCHED_WINDOWS)] if compared is not ready else names
    coarse, fine = (
        of_bins(compared, plan.model, of, width_s=numbers.BIN_S, coarse=is_coarse, threads=jobs)
        for of, is_coarse in ((some, True), (names, False))
    )
    if compared is not ready:
        coarse, fine = (_with_whole_inputs(one, ready) for one in (coarse, fine))
    return coarse, fine


def _with_whole_inputs(data: Residual, ready: Dataset) -> Residual:
    """Returns the residual of windows with the inputs of whole runs: a delay moves earlier inputs into a window."""
    whole = {run.name: (run.time, motor_inputs(run, ready)) for run in ready.runs}
    of = {run.name: whole[run_of(run.name)] for run in data.replay.dataset.runs}
    return data.with_inputs(dataclasses.replace(data.replay, whole=of))


def calibrate(prepared: Prepared) -> tuple[Prepared, Explanation]:
    """Returns the prepared data with final weights, and the calibrated nominal model.

    The model is fitted from several starts if some nominal value is not stated. The error of the rough fit changes from
    bin to bin; the noise floors of both residuals, coarse and fine, rise to the size of these changes.

    Raises:
        InputError: the plant diverges with the nominal values.
    """
    plan, problem = prepared.plan, Problem(prepared.coarse, prepared.plan)
    start = plan.start()
    if any(one.known is None for one in plan.free):
        start, _ = search(problem, np.random.default_rng(prepared.seed), counted(None, 1))
    rough = fit(problem, (), plan, start, FINE)
    if rough is None:
        raise InputError(
            "the plant diverges with these values: are units and nominal values right?",
            file=prepared.dataset.path,
            field="nominal",
        )
    coarse = prepared.coarse.with_raised_floors(rough.model)
    ready = dataclasses.replace(prepared, coarse=coarse, fine=prepared.fine.weighed_like(coarse))
    return ready, fit(Problem(coarse, plan), (), plan, rough.point, FINE) or rough


def in_closed_loop(prepared: Prepared, nominal: Explanation, best: Explanation | None) -> tuple[Prepared, Explanation]:
    """Returns the data and the nominal model, corrected for a feedback loop if the loop biases free runs.

    In a loop, a simulation from the commands alone is biased if the noise is correlated in time: the commands follow
    past noise, and so predict later noise. There is no bias if the noise is white (Ljung 1999, sec. 13.4), or if the
    loop has little influence on the commands. Otherwise a noise model removes what the residual's past predicts. All
    later stages use the rest, the innovations (the direct method). Noise model and nominal model are fitted in turn.

    Args:
        best: the explanation whose residual counts as noise, in the output that the commands follow. None: not known;
            then only a periodic disturbance counts as noise, if it has more than a fifth of the residual's power.
    """
    fitted, plain = tuple(run for run in prepared.dataset.runs if run.outputs), prepared.coarse
    loop = prepared.loop or follows_outputs(dataclasses.replace(prepared.dataset, runs=fitted), numbers.STRICT)
    prepared = dataclasses.replace(prepared, loop=loop)
    if loop is None or loop.gain <= numbers.SHARED_REST:
        return prepared, nominal
    if best is None:
        memory = own.share if (own := disturbances(prepared, nominal.model).get(loop.output)) else 0.0
    else:
        memory = _memory(plain.parts(plain.error(best.model), loop.output))
    if memory <= numbers.SHARED_REST:
        return prepared, nominal
    known = best or nominal
    for _ in range(_NOISE_ROUNDS):
        left = plain.error(known.model)
        models = {one: noise_model(plain.parts(left, one), _HIGHEST_ORDER) for one in plain.signals}
        coarse, fine = (_innovations(one, models) for one in (plain, prepared.fine))
        known = fit(Problem(coarse, known.plan), known.parts, known.plan, known.point, FINE) or known
    nominal = fit(Problem(coarse, nominal.plan), nominal.parts, nominal.plan, nominal.point, FINE) or nominal
    return dataclasses.replace(prepared, coarse=coarse, fine=fine, innovations=True), nominal


def disturbances(prepared: Prepared, model: Model) -> dict[str, periods.Period]:
    """Returns signal -> the periodic disturbance in its residual of free runs; {} without a feedback loop.

    Without a loop, the search would mistake periods of the commands for a disturbance.
    """
    if prepared.loop is None:
        return {}
    runs = [run for run in prepared.dataset.runs if run.outputs]
    simulated = Replay(prepared.dataset).simulate([model], threads=prepared.jobs)[0]
    made = {
        signal: periods.own_period(
            [(run.time, run.outputs[signal] - simulated[run.name][signal]) for run in runs if signal in run.outputs],
            numbers.STRICT,
        )
        for signal in prepared.fine.signals
        if all(signal in simulated[run.name] for run in runs)
    }
    return {signal: one for signal, one in made.items() if one is not None}


def _memory(left: Sequence[Array]) -> float:
    """Returns the share, 0..1, of a signal's squared residual that past residuals predict; 1 if the residual is 0."""
    parts, model = [one - one.mean() for one in left], noise_model(left, _HIGHEST_ORDER)
    new = sum(float(np.sum((whitening(model, len(one)) @ one) ** 2)) for one in parts)
    return 1 - new / max(sum(float(one @ one) for one in parts), 1e-300)


def _innovations(data: Residual, models: Mapping[str, Array]) -> Residual:
    """Returns the innovations: what the noise models do not predict. `models`: signal -> its noise model (order,)."""
    filters = {
        (block.run, block.signal): whitening(models.get(block.signal, np.empty(0)), len(block.measured))
        for block in data.blocks
    }
    return data.coloured(filters)


def with_default_sds(dataset: Dataset) -> Dataset:
    """Returns the data set with the usual sd on every nominal value that was stated without an sd.

    No value is known exactly, and a wrong nominal value is not an effect. So all nominal values are fitted.
    """
    nominal = {
        name: Nominal(known.value, abs(known.value) * SD_SHARE[name])
        if known.sd is None and known.value != 0 and name in SD_SHARE
        else known
        for name, known in dataset.nominal.items()
    }
    return dataclasses.replace(dataset, nominal=nominal)


def _blind(dataset: Dataset, roles: holdout.Roles) -> Dataset:
    """Returns the data set without any measured value that is held out."""

    runs = (
        _inputs_of(run)
        if roles.by_run[run.name] == "held_out"
        else dataclasses.replace(roles.samples(run, "fit"), raw_outputs={})
        for run in dataset.runs
    )
    return dataclasses.replace(dataset, runs=tuple(runs))


def _inputs_of(run: Run) -> Run:
    """Returns a run with its inputs, without measured values."""
    return dataclasses.replace(run, outputs={}, raw_outputs={})


def _windows(whole: Dataset, roles: holdout.Roles, inputs: Mapping[str, Array], length_s: float) -> Dataset | None:
    """Returns the fit runs cut into windows. A window that reaches into a held-out stretch keeps only its inputs."""
    runs = tuple(run if roles.by_run.get(run.name) == "fit" else _inputs_of(run) for run in whole.runs)
    cut = cut_into_windows(dataclasses.replace(whole, runs=runs), inputs, length_s)
    if cut is None:
        return None

    def is_held_out(run: Run) -> bool:
        stretch = roles.stretches.get(run_of(run.name))
        return stretch is not None and bool(run.time[-1] >= stretch[0] and run.time[0] <= stretch[1])

    return dataclasses.replace(cut, runs=tuple(_inputs_of(run) if is_held_out(run) else run for run in cut.runs))


def _starting_from(dataset: Dataset, model: Model) -> Dataset:
    """Returns `dataset` with the values and effects of `model` as its nominal values and effects. Stated sds stay.

    Raises:
        InputError: the model is of another vehicle.
    """
    if model.vehicle != dataset.vehicle:
        raise InputError(
            f"is of a {model.vehicle}, the data set of a {dataset.vehicle}", file=model.name, field="vehicle"
        )
    nominal = {
        name: Nominal(value, dataset.nominal[name].sd if name in dataset.nominal else None)
        for name, value in model.parameters.items()
        if name in dataset.nominal or value != catalogue.presets(model.vehicle)[name]
    }
    effects = {
        effect: {name: Nominal(value, abs(value) * numbers.ESTIMATE or None) for name, value in table.items()}
        for effect, table in model.effects.items()
    }
    return dataclasses.replace(dataset, nominal=nominal, nominal_effects={**dataset.nominal_effects, **effects})


def _excitation(stated: Dataset, ready: Dataset, inputs: Mapping[str, Array], *, windowed: bool) -> Excitation:
    fitted = [run for run in ready.runs if run.outputs]
    largest = {"voltage": max(float(np.nanmax(np.abs(values), initial=0.0)) for values in inputs.values())}
    for name in dict.fromkeys(name for run in fitted for name in run.outputs):
        values = [run.outputs[name] for run in fitted if name in run.outputs]
        largest[name] = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in values)
    return Excitation(largest, periods.orders(stated), _least_order(stated), windowed)


def _least_order(dataset: Dataset) -> float:
    """Returns the lowest order of a periodic effect: periods per turn, or rad/m if the drive commands a force."""
    travels = [
        np.ptp(run.outputs["position"][np.isfinite(run.outputs["position"])])
        for run in dataset.runs
        if "position" in run.outputs
    ]
    if "force_per_volt" not in dataset.nominal or not travels:
        return _PERIODS_PER_TURN
    return 2 * np.pi * _PERIODS_OVER_TRAVEL / max(float(max(travels)), 1e-9)
