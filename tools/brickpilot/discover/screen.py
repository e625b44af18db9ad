"""Screens parts: estimates how well each part could explain the residual, from few simulations and without a fit.

A simulation shows the signature of a part: how the part changes the residual. A projection removes from residual and
signature all that the free parameters of the model can explain (a score test, Rao 1948).
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import ParameterInfo
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.explanation import before
from brickpilot.discover.parts import (
    Excitation,
    Part,
    RunPart,
    is_signed,
    limit_of,
    scale_of,
    scanned_parameter,
    switch_settings,
)
from brickpilot.fit.parameters import Plan
from brickpilot.fit.problem import Problem, Projection
from brickpilot.fit.residual import Residual
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import RUN_KINDS

Array = NDArray[np.float64]

Values = Mapping[str, float]

_INVISIBLE = 1e-3  # limit, in scales: a signature that is smaller at all values counts as invisible

# The sizes below are shares of the preset, scaled to the vehicle.
_SMALL = 0.1  # size at which effects that are smooth in their size are tried
_SIZES = (0.03, 0.2, 1.0, 3.0)  # sizes at which effects that are not smooth are tried
_LIMIT_SHARES = (0.95, 0.85, 0.7, 0.5)  # shares of the largest command or reading at which a limit is tried
_LONGEST_STEP = 20.0  # largest amplitude, in sizes of the probe, to which a signature is extrapolated
_LEAST_STEP, _LARGEST_STEP = 0.1, 2.0  # range of the amplitude if its sign is fixed

_USUAL_ORDERS = (1.0, 2.0, 4.0, 6.0, 8.0, 12.0)  # periods per turn, tried together with the orders that the wheels show
_PHASES = ((0.0, 0.0), (np.pi / 2, 0.0), (0.0, np.pi), (np.pi / 2, np.pi))  # (phase, phase_difference): span all phases
_WHEELS = np.array([[1, 1j, 1j, -1], [1, 1j, -1j, 1]])  # phasors of the left and the right wheel at these phases
_LARGE = (1.0, 3.0)  # at these sizes, a periodic effect is not linear: it stops the wheels or throws them over a peak
_PHASES_A_WHEEL = 6
_GRID_OF_PHASES = tuple(
    (math.remainder((left + right) * np.pi / _PHASES_A_WHEEL, math.tau), (left - right) * math.tau / _PHASES_A_WHEEL)
    for left in range(_PHASES_A_WHEEL)
    for right in range(_PHASES_A_WHEEL)
)


@dataclass(frozen=True)
class Trial:
    """The screen's estimate for one part with one start size.

    Attributes:
        values: parameter -> the value from which a fit of the part starts.
        left: half the sum of the squares, of residual and priors, that the model with the part leaves.
        gain: how much the part decreases half the sum of the squared residuals of the data.
        prior_gain: how much the part decreases half the sum of the squares of the priors.
    """

    part: Part
    values: Mapping[str, float]
    left: float
    gain: float = 0.0
    prior_gain: float = 0.0

    @classmethod
    def of(cls, part: Part, values: Mapping[str, float], before: Array, after: Array, count: int) -> Trial:
        """Returns a trial from the residuals without and with the part, (`count` values + parameters,) each."""
        gains = (before**2 - after**2) / 2
        return cls(part, values, float(np.sum(after**2)) / 2, float(gains[:count].sum()), float(gains[count:].sum()))


def screen(
    problem: Problem,
    point: Array,
    chosen: Sequence[Part],
    *,
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> list[Trial]:
    """Returns the trials of all parts at all their sizes, the best first; a part without visible effect has no trial.

    Args:
        problem: the plan of the model, with the model's sensitivities at `point`.
        point: the end of the fit of this plan.
        excitation: the largest commands and readings of the runs, and their periodic motion.
        deadline: the time after which no further part is screened.
    """
    here = _Here.of(problem, point)

    def trials_of(part: Part) -> list[Trial]:
        probed = here.probed(part, excitation)
        if isinstance(part, RunPart) and probed:
            probed = [_of_runs(part, probed, here.residual)]
        return [here.trial(*one) for one in probed]

    found = before(deadline, trials_of, chosen, problem.data.threads)
    return sorted((trial for trials in found if trials for trial in trials), key=lambda one: one.left)


def _of_runs(part: RunPart, tried: Sequence[tuple[Probe, Array]], residual: Array) -> tuple[Probe, Array]:
    """Combines the probes of a part, each at one value for all runs, into one with the best tried value of each run.

    A small value, such as a slightly late start, may change nothing visible, so that no fit can start from this value.
    """
    signatures = np.array([one for _, one in tried])
    along = np.maximum(residual @ signatures, 0.0)
    best = np.argmax(along**2 / np.maximum(np.sum(signatures**2, axis=1), 1e-300), axis=0)
    values = {run: tried[k][0].values[0][run] for run, k in zip(part.free, best.tolist(), strict=True)}
    return Probe(part, (values,) * len(best), True, part.free), signatures[best, :, np.arange(len(best))].T


def signature_strengths(
    problem: Problem, point: Array, chosen: Sequence[Part], *, excitation: Excitation
) -> list[tuple[Part, Mapping[str, float], Array]]:
    """Returns parts with one free size: part, values, and (signals,) half the squared signature in squared floors.

    The arguments are those of `screen`. Parts with a scanned parameter are left out: their signature at one size does
    not give their signature at another size.
    """
    few = [one for one in chosen if len(one.free) == 1 and scanned_parameter(one) is None]
    here, data = _Here.of(problem, point), problem.data
    in_floors = 1 / (data.weight() * data.by_signal({one: data.floor(one) for one in data.signals}))
    found = []
    for probe, signature in (one for part in few for one in here.probed(part, excitation)):
        squares = (signature[: len(in_floors), 0] * in_floors) ** 2 / 2
        strength = [np.concatenate(data.parts(squares, name)).sum() for name in data.signals]
        found.append((probe.part, probe.values[0], np.array(strength)))
    return found


@dataclass(frozen=True)
class _Here:
    """The fitted model to which the screened parts are added.

    Attributes:
        scaled: (values,) the residual of the model, in scales.
        residual: (rows,) the projected residual.
    """

    data: Residual
    plan: Plan
    projection: Projection
    scaled: Array
    residual: Array

    @classmethod
    def of(cls, problem: Problem, point: Array) -> _Here:
        plan = dataclasses.replace(problem.plan, model=problem.plan.at(point))
        scaled, projection = problem.data.scaled(plan.model), Projection(problem, point)
        return cls(problem.data.on_threads(1), plan, projection, scaled, projection.remainder(scaled))

    def probed(self, part: Part, excitation: Excitation) -> list[tuple[Probe, Array]]:
        """Returns each visible probe of a part with its projected signatures (rows, simulations)."""
        probes = probes_of(part, self.plan.model, excitation)
        models = [part.starting(self.plan, values).model for probe in probes for values in probe.values]
        simulated = self.data.scaled_by(models)
        found: list[tuple[Probe, Array]] = []
        for probe in probes:
            changes = np.array([self.scaled - next(simulated) for _ in probe.values])
            if not np.isfinite(changes).all() or np.abs(changes).max() < _INVISIBLE:
                continue
            if isinstance(part, RunPart):  # one simulation changes all runs, each by its own value
                changes = np.array([np.where(self.data.rows_of(run), changes[0], 0.0) for run in part.free])
                if np.abs(changes).max(axis=1).min() < _INVISIBLE:
                    continue
            found.append((probe, self.projection.signatures(changes)))
        return found

    def trial(self, probe: Probe, signatures: Array) -> Trial:
        """Returns a probe's trial: amplitudes of its signatures (rows, simulations) are fitted to the residual."""
        amplitudes = _fit_amplitudes(probe, signatures, self.residual)
        after = self.residual - signatures @ amplitudes
        values = _values_at(probe, amplitudes.tolist())
        return Trial.of(probe.part, values, self.residual, after, len(self.data.measured))


@dataclass(frozen=True)
class Probe:
    """Simulations of one part, whose signatures are combined linearly.

    Attributes:
        values: the parameter values of each simulation k, whose signature is multiplied by an amplitude a_k.
        free_sign: whether a_k may be negative.
        moved: for each simulation k, the parameter that a_k multiplies; empty: amplitudes multiply no parameter.
    """

    part: Part
    values: tuple[Values, ...]
    free_sign: bool
    moved: tuple[str, ...] = ()


def probes_of(part: Part, base: Model, excitation: Excitation) -> list[Probe]:
    """Returns the probes that test a part as an addition to the model `base`.

    An effect that is smooth in its size is tried at one size and extrapolated. An effect that is not smooth, such as a
    deadband, is tried at several sizes.
    """
    if isinstance(part, RunPart):
        starts = RUN_KINDS[part.effect].tried or (RUN_KINDS[part.effect].sd,)
        return [Probe(part, (dict.fromkeys(part.free, value),), True) for value in starts]
    if limit := limit_of(part):
        largest = excitation.largest.get(limit.limits, 0.0)
        tried = [share * largest for share in _LIMIT_SHARES if limit.minimum <= share * largest <= limit.maximum]
        return [Probe(part, ({limit.name: size},), False) for size in tried if size > 0]
    if scanned := scanned_parameter(part):
        return [Probe(part, ({scanned.name: v, **on},), False) for v in scanned.scan for on in switch_settings(part)]
    infos = {name: one for name, one in part.infos.items() if name in part.free}
    natural = {name: (one.preset or one.trial) * scale_of(one.unit, base) for name, one in infos.items()}
    if part.is_periodic:
        return _periodic(part, natural, excitation)
    if all(is_signed(one) for one in infos.values()):
        zero = dict.fromkeys(infos, 0.0)
        small = tuple(_within_range(part, {**zero, name: _SMALL * natural[name]}) for name in infos)
        return [Probe(part, small, True, tuple(infos))]
    return _at_several_sizes(part, natural, infos)


def _at_several_sizes(part: Part, natural: Values, infos: Mapping[str, ParameterInfo]) -> list[Probe]:
    """Returns probes at every size, with every combination of signs and every setting of switches."""
    signs_of = {name: (1.0, -1.0, 0.0) if one.role == "place" else (1.0, -1.0) for name, one in infos.items()}
    signed = [name for name in infos if is_signed(infos[name])]
    probes = []
    for size, signs in itertools.product(_SIZES, itertools.product(*(signs_of[name] for name in signed))):
        start = {name: one * (1.0 if infos[name].role in ("shape", "place") else size) for name, one in natural.items()}
        start |= {name: natural[name] * sign for name, sign in zip(signed, signs, strict=True)}
        for on in switch_settings(part):
            probes.append(Probe(part, (_within_range(part, {**start, **on}),), False, part.free[:1]))
    return probes


def _periodic(part: Part, natural: Values, excitation: Excitation) -> list[Probe]:
    """Returns, for each order, a probe that combines all phases linearly; in windows also probes with large sizes."""
    size, names = part.free[0], ("phase", "phase_difference")

    def at(order: float, share: float, phases: Sequence[tuple[float, float]]) -> tuple[Values, ...]:
        """Returns the values at each phase and, if the phase difference is free, at each phase difference."""
        begin = {**natural, size: share * natural[size], "order": order}
        if names[1] not in part.free:
            return tuple(_within_range(part, {**begin, "phase": phase}) for phase, apart in phases if apart == 0)
        return tuple(_within_range(part, {**begin, **dict(zip(names, one, strict=True))}) for one in phases)

    orders = [order for order in (*excitation.orders, *_USUAL_ORDERS) if order >= excitation.least_order]
    large = itertools.product([one for one in excitation.orders if excitation.windowed and one in orders], _LARGE)
    return [
        *(Probe(part, at(order, 1.0, _PHASES), True) for order in orders),
        *(
            Probe(part, (values,), False, (size,))
            for order, share in large
            for values in at(order, share, _GRID_OF_PHASES)
        ),
    ]


def _fit_amplitudes(probe: Probe, signatures: Array, residual: Array) -> Array:
    """Returns (simulations,): the amplitudes of the signatures that explain the residual best.

    Args:
        signatures: (rows, simulations) changes of the residual.
        residual: (rows,).
    """
    found = np.linalg.lstsq(signatures, residual, rcond=1e-6)[0]
    if probe.free_sign:
        largest = max(float(np.abs(found).max()), 1e-12)
        return np.asarray(found * min(1.0, _LONGEST_STEP / largest))
    return np.clip(found, _LEAST_STEP, _LARGEST_STEP)


def _values_at(probe: Probe, amplitudes: Sequence[float]) -> dict[str, float]:
    """Returns the part's parameter values at these amplitudes of the probe's signatures, clipped to their ranges."""
    values = dict(probe.values[0])
    if probe.part.is_periodic and probe.free_sign:
        phasors = _WHEELS[:, : len(amplitudes)] @ amplitudes
        left, right = np.angle(phasors)
        difference = float(np.angle(np.exp(1j * (left - right))))
        values[probe.part.free[0]] *= float(np.mean(np.abs(phasors)))
        values["phase"] = float(np.angle(np.exp(1j * (right + difference / 2))))
        if "phase_difference" in values:
            values["phase_difference"] = difference
    for name, one, amplitude in zip(probe.moved, probe.values, amplitudes, strict=False):
        values[name] = one[name] * amplitude
    return _within_range(probe.part, values)


def _within_range(part: Part, values: Values) -> dict[str, float]:
    return {name: float(np.clip(value, *part.range_of(name))) for name, value in values.items()}
