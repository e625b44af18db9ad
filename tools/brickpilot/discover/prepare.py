"""The first stage: makes a data set ready for fits."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data import holdout
from brickpilot.data.audit import against_model
from brickpilot.data.dataset import Dataset, Nominal, motor_inputs
from brickpilot.discover import gates, harmonics
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.default_sd import with_default_sds
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.windows import cut_into_windows, run_of, wheel_angles
from brickpilot.errors import InputError
from brickpilot.fit import parameters
from brickpilot.fit.comparable import Comparable, contradictions, started
from brickpilot.fit.parameters import Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_MOTOR_WINDOW_S = 1.0
_WINDOW_S = 0.6  # a wheel turns once or twice in it
_SEARCHED_WINDOWS = 80  # at most; all windows are fitted after the search


@dataclass(frozen=True)
class Prepared:
    """A data set ready for fits. All later stages work on it.

    Attributes:
        measured: the data set as read, without channels that contradict the model.
        dataset: `measured` with an sd on every nominal value and with averaged start states.
        plain: the same runs as `compare` and `calibrate` take them, without what was estimated of them or given by a
            model: the headline numbers are of these.
        compared: the runs that are simulated and compared: those of `dataset`, or windows of them.
        roles: which runs are fitted and which are held out.
        plan: the nominal parameters that are fitted.
        coarse: the residual of the fit runs on a coarse time grid, for the search.
        fine: the residual of the fit runs at the measured samples.
        excitation: what the runs excite.
        seed: seed of random starts.
        jobs: number of fits at the same time.
        deadline: of the whole discovery.
    """

    measured: Dataset
    dataset: Dataset
    plain: Comparable
    compared: Dataset
    roles: holdout.Roles
    plan: Plan
    coarse: BinnedOutputError
    fine: BinnedOutputError
    excitation: Excitation
    seed: int
    jobs: int
    deadline: Deadline

    def until(self, share: float) -> Deadline:
        """Returns the deadline of a stage that has to be done after this share of the budget."""
        return self.deadline.until(share)

    def held_out(self) -> BinnedOutputError | None:
        """Returns the residual of the held-out runs with the scales of the fit runs; None if no run is held out."""
        names = _tested(self.compared, self.roles)
        if not names:
            return None
        samples = part(self.compared, self.roles, "held_out")
        error = BinnedOutputError(self.compared, self.plan, names, threads=self.jobs, samples=samples)
        error.adopt_scales(self.fine)
        return error

    def part(self, compared: Dataset, role: str) -> Dataset:
        """Returns a data set of the same runs without the samples that have another role."""
        return part(compared, self.roles, role)

    def all_runs(self, plan: Plan) -> BinnedOutputError:
        """Returns the residual of all runs with the scales of the fit runs."""
        names = [run.name for run in self.compared.runs]
        error = BinnedOutputError(self.compared, plan, names, threads=self.jobs)
        error.adopt_scales(self.fine)
        return error


def prepare(dataset: Dataset, model: Model | None, *, seed: int, jobs: int, deadline: Deadline = NO_LIMIT) -> Prepared:
    """Leaves out contradictory channels, assigns roles, and sets up the residuals.

    Raises:
        InputError: no measured signal is one that the model gives, every run is held out, or `model` is of another
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
    ready = started(stated, inputs)
    plan = parameters.plan(ready)
    windows = cut_into_windows(ready, inputs, _MOTOR_WINDOW_S) if ready.vehicle == "motor" else None
    compared = ready if windows is None else windows
    fitted, fit_runs = part(compared, roles, "fit"), _with_role(compared, roles, "fit")
    return Prepared(
        measured=measured,
        dataset=ready,
        plain=_plain(measured, ready, roles, given=model is not None),
        compared=compared,
        roles=roles,
        plan=plan,
        coarse=BinnedOutputError(compared, plan, fit_runs, coarse=True, threads=jobs, samples=fitted),
        fine=BinnedOutputError(compared, plan, fit_runs, threads=jobs, samples=fitted),
        excitation=_excitation(stated, ready, inputs, windowed=windows is not None),
        seed=seed,
        jobs=jobs,
        deadline=deadline,
    )


def _plain(measured: Dataset, ready: Dataset, roles: holdout.Roles, *, given: bool) -> Comparable:
    """Returns the runs for the headline numbers; those of `ready` unless it starts from a given model."""
    if given:
        ready = started(measured, {run.name: motor_inputs(run, measured) for run in measured.runs})
    return Comparable(measured, ready, roles)


def prepare_windows(prepared: Prepared) -> Prepared | None:
    """Returns the same data cut into short windows.

    None if they are in windows already, no wheel was measured, or the samples are too far apart for a window.
    """
    if prepared.compared is not prepared.dataset:
        return None
    ready = prepared.dataset
    windows = cut_into_windows(ready, {run.name: motor_inputs(run, ready) for run in ready.runs}, _WINDOW_S)
    if windows is None:
        return None
    fitted, fit_windows = part(windows, prepared.roles, "fit"), _with_role(windows, prepared.roles, "fit")
    if not fit_windows:
        return None
    some = fit_windows[:: -(-len(fit_windows) // _SEARCHED_WINDOWS)]
    return dataclasses.replace(
        prepared,
        compared=windows,
        coarse=BinnedOutputError(windows, prepared.plan, some, coarse=True, threads=prepared.jobs, samples=fitted),
        fine=BinnedOutputError(windows, prepared.plan, fit_windows, threads=prepared.jobs, samples=fitted),
        excitation=dataclasses.replace(prepared.excitation, windowed=True),
    )


def _with_role(compared: Dataset, roles: holdout.Roles, role: str) -> list[str]:
    """Returns the names of the runs, or windows of runs, that have a role."""
    return [run.name for run in compared.runs if roles.by_run[run_of(run.name)] == role]


def _tested(compared: Dataset, roles: holdout.Roles) -> list[str]:
    """Returns the names of the runs, or windows of runs, of which samples are held out."""
    tested = set(roles.tested())
    return [run.name for run in compared.runs if run_of(run.name) in tested]


def part(compared: Dataset, roles: holdout.Roles, role: str) -> Dataset:
    """Returns the data set without the samples that have another role, where a run holds both."""
    if not roles.stretches:
        return compared
    runs = tuple(roles.samples(run, role, run_of(run.name)) for run in compared.runs)
    return dataclasses.replace(compared, runs=runs)


def _starting_from(dataset: Dataset, model: Model) -> Dataset:
    """Returns `dataset` with the values and effects of `model` as what is known. Stated sds stay.

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
        effect: {
            name: Nominal(value, abs(value) * gates.SD_SHARE_OF_A_MODELS_EFFECT or None)
            for name, value in table.items()
        }
        for effect, table in model.effects.items()
    }
    return dataclasses.replace(dataset, nominal=nominal, nominal_effects={**dataset.nominal_effects, **effects})


def _excitation(stated: Dataset, ready: Dataset, inputs: Mapping[str, Array], *, windowed: bool) -> Excitation:
    largest = {"voltage": max(float(np.nanmax(np.abs(values), initial=0.0)) for values in inputs.values())}
    for name in dict.fromkeys(name for run in ready.runs for name in run.outputs):
        values = [run.outputs[name] for run in ready.runs if name in run.outputs]
        largest[name] = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in values)
    return Excitation(
        largest=largest,
        orders=harmonics.orders(stated),
        least_order=_least_order(stated),
        wheels_measured=all(wheel_angles(run) is not None for run in ready.runs),
        windowed=windowed,
    )


def _least_order(dataset: Dataset) -> float:
    """Returns the lowest order that counts as periodic: per turn, or in rad/m where the drive commands a force."""
    travels = [
        np.ptp(run.outputs["position"][np.isfinite(run.outputs["position"])])
        for run in dataset.runs
        if "position" in run.outputs
    ]
    if "force_per_volt" not in dataset.nominal or not travels:
        return gates.LEAST_PERIODS_PER_TURN
    return 2 * np.pi * gates.LEAST_PERIODS_OVER_TRAVEL / max(float(max(travels)), 1e-9)
