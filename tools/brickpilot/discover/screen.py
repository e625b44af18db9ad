"""Screens parts: how well each could explain the residual, from few simulations and without a fit.

A simulation shows the signature of a part: how it changes the residual. From both, everything is projected out that the
parameters of the model could still take up (a score test, Rao 1948).
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.discover.deadline import NO_LIMIT, Deadline
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
from brickpilot.fit.replay import RUN_KINDS
from brickpilot.fit.residual import Problem, Projection
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

Values = Mapping[str, float]

_INVISIBLE = 1e-3  # scales: a signature that is smaller everywhere shows nothing

# Sizes are shares of the preset, scaled to the vehicle.
_SMALL = 0.1  # for effects that are smooth in their size
_SIZES = (0.03, 0.2, 1.0, 3.0)  # for effects that are not
_LIMIT_SHARES = (0.95, 0.85, 0.7, 0.5)  # of the largest command or reading: where a limit may be
_LONGEST_STEP = 20.0  # times the size of the probe: a line is followed no further
_LEAST_STEP, _LARGEST_STEP = 0.1, 2.0  # the same where the sign is fixed

_USUAL_ORDERS = (1.0, 2.0, 4.0, 6.0, 8.0, 12.0)  # periods per turn, tried beside those that the wheels show
_PHASES = ((0.0, 0.0), (np.pi / 2, 0.0), (0.0, np.pi), (np.pi / 2, np.pi))  # (phase, phase_difference): span the others
_LARGE = (1.0, 3.0)  # sizes at which a periodic effect holds the wheels or throws them over: not linear
_PHASES_A_WHEEL = 6
_GRID_OF_PHASES = tuple(
    (math.remainder((left + right) * np.pi / _PHASES_A_WHEEL, math.tau), (left - right) * math.tau / _PHASES_A_WHEEL)
    for left in range(_PHASES_A_WHEEL)
    for right in range(_PHASES_A_WHEEL)
)


@dataclass(frozen=True)
class Trial:
    """One part from one size.

    Attributes:
        values: where a fit of it starts.
        left: half the squared residual that the model can come down to with the part, priors included.
        gain: by how much half the squared residual of the data comes down.
        prior_gain: by how much half the squares of what was known before come down.
    """

    part: Part
    values: Mapping[str, float]
    left: float
    gain: float = 0.0
    prior_gain: float = 0.0

    @classmethod
    def of(cls, part: Part, values: Mapping[str, float], before: Array, after: Array, count: int) -> Trial:
        """Returns a trial from what is left without and with the part, (values + parameters,) with `count` values."""
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
    """Returns every part from each of its sizes, the best first, without those that change nothing.

    Args:
        problem: with the plan of the model, and its sensitivities kept at `point`.
        point: where the fit of that plan ended.
        excitation: how far the vehicle was driven.
        deadline: the parts behind it are left out.
    """
    residual, probed = _probed(problem, point, chosen, excitation, deadline)
    trials = []
    for probe, signatures in _of_runs_joined(probed, residual):
        amplitudes = fit_amplitudes(probe, signatures, residual)
        after = residual - signatures @ amplitudes
        values = values_at(probe, amplitudes)
        trials.append(Trial.of(probe.part, values, residual, after, len(problem.data.measured)))
    return sorted(trials, key=lambda one: one.left)


def _of_runs_joined(probed: list[tuple[Probe, Array]], residual: Array) -> list[tuple[Probe, Array]]:
    """Returns the probes, those of one kind of values of runs as one: each run at the value that explains it best.

    At a small value a late start shows nothing, and a fit from there would lead nowhere.
    """
    kinds: dict[str, list[tuple[Probe, Array]]] = {}
    others = []
    for probe, signatures in probed:
        if isinstance(probe.part, RunPart):
            kinds.setdefault(probe.part.name, []).append((probe, signatures))
        else:
            others.append((probe, signatures))
    for tried in kinds.values():
        gains = np.array([_gains(signatures, residual) for _, signatures in tried])
        best = np.argmax(gains, axis=0)
        part = tried[0][0].part
        values = {run: tried[k][0].values[0][run] for run, k in zip(part.free, best.tolist(), strict=True)}
        columns = np.column_stack([tried[k][1][:, index] for index, k in enumerate(best.tolist())])
        others.append((Probe(part, (values,), True), columns))
    return others


def _gains(signatures: Array, residual: Array) -> Array:
    """Returns (columns,): by how much each signature alone, in its own direction, lowers the squared residual."""
    along = np.maximum(signatures.T @ residual, 0.0)
    return np.asarray(along**2 / np.maximum(np.sum(signatures**2, axis=0), 1e-300))


def signature_strengths(
    problem: Problem, point: Array, chosen: Sequence[Part], *, excitation: Excitation
) -> list[tuple[Part, Mapping[str, float], float]]:
    """Returns parts with one free size, its values, and half the squares of their signature there.

    The arguments are those of `screen`. Parts that come and go with their size are left out: one size says nothing of
    another there.
    """
    few = [one for one in chosen if len(one.free) == 1 and scanned_parameter(one) is None]
    probed = _probed(problem, point, few, excitation)[1]
    return [(probe.part, probe.values[0], float(np.sum(one**2)) / 2) for probe, one in probed]


def _probed(
    problem: Problem,
    point: Array,
    chosen: Sequence[Part],
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Array, list[tuple[Probe, Array]]]:
    """Returns the residual (rows,), and each visible probe with its signatures (rows, simulations), projected."""
    base = problem.plan.at(point)
    plan = dataclasses.replace(problem.plan, model=base)
    residual = problem.data.scaled(base)
    projection = Projection(problem, point)
    probes = [probe for part in chosen for probe in probes_of(part, base, excitation)]
    models = [probe.part.starting(plan, values).model for probe in probes for values in probe.values]
    simulated = problem.data.scaled_by(models)
    found: list[tuple[Probe, Array]] = []
    for probe in probes:
        if found and deadline.passed:
            break
        changes = np.array([residual - next(simulated) for _ in probe.values])
        if not np.isfinite(changes).all() or np.abs(changes).max() < _INVISIBLE:
            continue
        if isinstance(probe.part, RunPart):  # one simulation with the values of all runs shows what each run's does
            changes = np.array([np.where(problem.data.rows_of(run), changes[0], 0.0) for run in probe.part.free])
            if np.abs(changes).max(axis=1).min() < _INVISIBLE:
                continue
        found.append((probe, projection.signatures(changes)))
    return projection.remainder(residual), found


@dataclass(frozen=True)
class Probe:
    """Simulations of a part whose signatures are combined.

    Attributes:
        values: each is simulated, and its signature taken a_k times.
        free_sign: whether a_k may be negative.
    """

    part: Part
    values: tuple[Values, ...]
    free_sign: bool


def probes_of(part: Part, base: Model, excitation: Excitation) -> list[Probe]:
    """Returns the probes of a part beside `base`.

    An effect that is smooth in its size is tried at one size and extrapolated. One that is not, such as a deadband, is
    tried at several.
    """
    if isinstance(part, RunPart):
        starts = RUN_KINDS[part.effect].tried or (RUN_KINDS[part.effect].sd,)
        return [Probe(part, (dict.fromkeys(part.free, value),), True) for value in starts]
    effect = catalogue.effect(part.effect)
    infos = {one.name: one for one in effect.parameters if one.name in part.free}
    if limit := limit_of(part):
        largest = excitation.largest.get(limit.limits, 0.0)
        tried = [share * largest for share in _LIMIT_SHARES if limit.minimum <= share * largest <= limit.maximum]
        return [Probe(part, ({limit.name: size},), False) for size in tried if size > 0]
    if scanned := scanned_parameter(part):
        settings = switch_settings(effect)
        return [Probe(part, ({scanned.name: v, **on},), False) for v in scanned.scan for on in settings]
    natural = {name: (one.preset or one.trial) * scale_of(one.unit, base) for name, one in infos.items()}
    if "order" in infos:
        return _periodic(part, natural, excitation)
    if all(is_signed(one) for one in infos.values()):
        zero = dict.fromkeys(infos, 0.0)
        return [Probe(part, tuple({**zero, name: _SMALL * natural[name]} for name in infos), True)]
    return _at_several_sizes(part, natural, infos)


def _at_several_sizes(part: Part, natural: Values, infos: Mapping[str, ParameterInfo]) -> list[Probe]:
    """Returns probes at every size, with every combination of signs and every setting of switches."""
    effect = catalogue.effect(part.effect)
    sized = [name for name in infos if infos[name].role not in ("shape", "place")]
    signed = [name for name in infos if is_signed(infos[name])]
    probes = []
    for size in _SIZES:
        for signs in itertools.product(
            *((1.0, -1.0, 0.0) if infos[n].role == "place" else (1.0, -1.0) for n in signed)
        ):
            start = {**natural, **{name: natural[name] * size for name in sized}}
            start |= {name: natural[name] * sign for name, sign in zip(signed, signs, strict=True)}
            settings = switch_settings(effect)
            probes += [Probe(part, (_within_range(effect.name, {**start, **on}),), False) for on in settings]
    return probes


def _periodic(part: Part, natural: Values, excitation: Excitation) -> list[Probe]:
    """Returns probes at every order, linear in the phases; in windows also at large sizes, phase by phase."""
    orders = [order for order in (*excitation.orders, *_USUAL_ORDERS) if order >= excitation.least_order]
    linear = [Probe(part, _at_phases(part, natural, order, _PHASES), True) for order in orders]
    size = part.free[0]
    large = [
        Probe(part, (one,), False)
        for order in (excitation.orders if excitation.windowed else ())
        if order in orders
        for share in _LARGE
        for one in _at_phases(part, {**natural, size: share * natural[size]}, order, _GRID_OF_PHASES)
    ]
    return [*linear, *large]


def _at_phases(part: Part, natural: Values, order: float, phases: Sequence[tuple[float, float]]) -> tuple[Values, ...]:
    """Returns the values of a periodic effect at each phase and, where it is free, each phase difference."""
    two_phases = "phase_difference" in part.free
    shifted = (
        {**natural, "order": order, "phase": phase} | ({"phase_difference": difference} if two_phases else {})
        for phase, difference in phases
        if two_phases or difference == 0
    )
    return tuple(_within_range(part.effect, one) for one in shifted)


def fit_amplitudes(probe: Probe, signatures: Array, residual: Array) -> Array:
    """Returns (simulations,): how many times each signature explains the residual best.

    Args:
        signatures: (rows, simulations) changes of the residual.
        residual: (rows,).
    """
    found = np.linalg.lstsq(signatures, residual, rcond=1e-6)[0]
    if probe.free_sign:
        largest = max(float(np.abs(found).max()), 1e-12)
        return np.asarray(found * min(1.0, _LONGEST_STEP / largest))
    return np.clip(found, _LEAST_STEP, _LARGEST_STEP)


def values_at(probe: Probe, amplitudes: Array) -> dict[str, float]:
    """Returns the parameters that the amplitudes of a probe's signatures stand for, within their ranges."""
    part, values = probe.part, dict(probe.values[0])
    if isinstance(part, RunPart):
        kind = RUN_KINDS[part.effect]
        return {
            run: min(max(values[run] * share, kind.low), kind.high)
            for run, share in zip(part.free, amplitudes.tolist(), strict=True)
        }
    if "order" in values and probe.free_sign:
        values |= _wave_at(part, values, amplitudes)
    elif limit_of(part) or scanned_parameter(part):
        pass  # a tighter limit changes more, so an amplitude does not say where the limit is
    elif probe.free_sign:
        for one, amplitude in zip(probe.values, amplitudes, strict=True):
            moved = next(name for name, value in one.items() if value != 0)
            values[moved] = one[moved] * float(amplitude)
    elif part.free[0] in values:
        values[part.free[0]] *= float(amplitudes[0])
    return _within_range(part.effect, values)


def _wave_at(part: Part, values: Values, amplitudes: Array) -> dict[str, float]:
    """Returns size and phases of a periodic effect from the amplitudes at `_PHASES`."""
    phasors = _wheel_phasors(amplitudes)
    left, right = np.angle(phasors)
    difference = float(np.angle(np.exp(1j * (left - right))))
    size = part.free[0]
    wave = {
        size: values[size] * float(np.mean(np.abs(phasors))),
        "phase": float(np.angle(np.exp(1j * (right + difference / 2)))),
    }
    return wave | ({"phase_difference": difference} if "phase_difference" in values else {})


def _wheel_phasors(amplitudes: Array) -> NDArray[np.complex128]:
    """Returns the phasors of the left and the right wheel from the amplitudes at `_PHASES`."""
    a, b, c, d = np.append(amplitudes, np.zeros(4 - len(amplitudes)))
    return np.array([a - d + 1j * (b + c), a + d + 1j * (b - c)])


def _within_range(effect: str, values: Values) -> dict[str, float]:
    infos = {one.name: one for one in catalogue.effect(effect).parameters}
    return {name: float(np.clip(value, infos[name].minimum, infos[name].maximum)) for name, value in values.items()}
