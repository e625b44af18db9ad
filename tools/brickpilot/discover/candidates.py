"""Which effects may be missing, from which sizes each is tried, and how well each could do: the screen.

A candidate is an effect with some of its parameters free. A simulation a size shows its signature; from the residual
all that the parameters of the model could still take up is projected out first (a score test, Rao 1948). What is
smooth in its size is tried at one and extrapolated; what is not, such as a deadband, is tried at several.
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
from brickpilot.catalogue import EffectInfo, ParameterInfo
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.excitation import Excitation
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model, rcx

Array = NDArray[np.float64]

_SIZES = (0.03, 0.2, 1.0, 3.0)  # of what is natural for the vehicle: for effects that are not smooth in their size
_SMALL = 0.1  # the one size of those that are
_MOST = 20.0  # times that size is as far as a line is followed
_LEAST = 0.1
_ORDERS = (1.0, 2.0, 4.0, 6.0, 8.0, 12.0)  # a turn: usual ones, tried whatever was read
_TURNS = ((0.0, 0.0), (np.pi / 2, 0.0), (0.0, np.pi), (np.pi / 2, np.pi))  # phase, phase_difference: span all of them
_BITES = (1.0, 3.0)  # of what is natural: sizes at which what repeats is tried that holds or throws the wheels
_ROUND = 6  # phases of each wheel that those sizes are tried with
_ROUNDS = tuple(
    (math.remainder((left + right) * np.pi / _ROUND, math.tau), (left - right) * math.tau / _ROUND)
    for left in range(_ROUND)
    for right in range(_ROUND)
)
_SHARES = (0.95, 0.85, 0.7, 0.5)  # of the largest command or reading: where a limit may be
_CHUNK = 24  # models simulated at once: what their outputs take of memory
_NOTHING = 1e-3  # scales: a change that is less everywhere is none
_COMMAND = "voltage"  # the limited signal that is a command, not a reading


@dataclass(frozen=True)
class Candidate:
    """An effect with the parameters that are fitted; those not named stay at `fixed`."""

    effect: str
    free: tuple[str, ...]
    fixed: Mapping[str, float]

    @property
    def is_periodic(self) -> bool:
        """Whether it repeats with a wheel's angle, so often as is fitted."""
        return "order" in self.free

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        """`base` with this candidate switched on at `values`, its free parameters last."""
        infos = catalogue.effect(self.effect).parameters
        table = {one.name: values.get(one.name, self.fixed.get(one.name, one.preset)) for one in infos}
        model = dataclasses.replace(base.model, effects={**base.model.effects, self.effect: table})
        added = tuple(Free(f"{self.effect}.{one.name}", one, None) for one in infos if one.name in self.free)
        return Plan(model, (*base.free, *added), ())


@dataclass(frozen=True)
class Trial:
    """One candidate from one size.

    `before`, `after`: half the squared residual, priors included, that the model without it can come down to, and with.
    """

    candidate: Candidate
    values: Mapping[str, float]
    before: float
    after: float


@dataclass(frozen=True)
class _Probe:
    """Simulations whose changes of the residual are combined: `values[k]` is simulated, and its change times a_k.

    `free_sign`: whether a_k may be negative. `ends`: amplitudes -> the values that they stand for.
    """

    candidate: Candidate
    values: tuple[Mapping[str, float], ...]
    free_sign: bool


def candidates(base: Model) -> list[Candidate]:
    """Every effect that `base` does not hold, once for each set of parameters worth freeing.

    An optional parameter is freed beside the others, and alone where it needs none of them.
    """
    found = []
    for info in catalogue.effects():
        if info.name in base.effects or info.composed:
            continue
        if info.acts_on == "supply" and base.parameters.get("force_per_volt", 0) + base.parameters.get(
            "torque_per_volt", 0
        ):
            continue  # a drive that closes a current loop has its supply behind it
        usable = [one for one in info.parameters if base.vehicle == "diff_drive" or not one.odd]
        main = tuple(one.name for one in usable if not one.optional and one.role != "switch")
        optional = [one.name for one in usable if one.optional]
        signed = all(_is_signed(one) for one in usable)
        sets = [main, *((name,) for name in optional if signed)]
        if not signed or len(usable) == 2:  # of three laws in one effect each is tried for itself
            sets += [(*main, name) for name in optional]
        for free in dict.fromkeys(one for one in sets if one):
            off = {one.name: one.preset if one.role == "shape" else 0.0 for one in usable if one.name not in free}
            found.append(Candidate(info.name, free, off))
    return found


def sizes_of(candidate: Candidate) -> list[str]:
    """Its free parameters that say how large it is, and may be zero."""
    infos = {one.name: one for one in catalogue.effect(candidate.effect).parameters}
    return [name for name in candidate.free if infos[name].role != "shape" and infos[name].minimum <= 0]


def read_limits(candidate: Candidate) -> list[tuple[str, str]]:
    """The parameters of a candidate that limit what a signal can read, each with that signal."""
    infos = catalogue.effect(candidate.effect).parameters
    return [(one.name, one.limits) for one in infos if one.limits not in ("", _COMMAND)]


def screen(
    error: BinnedOutputError, point: Array, chosen: Sequence[Candidate], *, excitation: Excitation
) -> list[Trial]:
    """Every candidate from each of its sizes, best first; those of which nothing shows are left out.

    Args:
        error: with the plan of what is in the model already, its sensitivities kept at `point`.
        point: where that plan's fit ended.
        excitation: what the vehicle was driven to.
    """
    left, probed = _probed(error, point, chosen, excitation)
    before, trials = float(np.sum(left**2)) / 2, []
    for probe, columns in probed:
        amplitudes = _amplitudes(columns, left, free_sign=probe.free_sign)
        after = float(np.sum((left - columns @ amplitudes) ** 2)) / 2
        trials.append(Trial(probe.candidate, _ends(probe, amplitudes), before, after))
    return sorted(trials, key=lambda one: one.after)


def signatures(
    error: BinnedOutputError, point: Array, chosen: Sequence[Candidate], *, excitation: Excitation
) -> list[tuple[Candidate, Mapping[str, float], float]]:
    """Each candidate with one free size at the values it is simulated at, and half the squares of what that changes.

    Arguments as of `screen`. Not of what comes and goes with its size, as one size says nothing of another there.
    """
    few = [one for one in chosen if len(one.free) == 1 and _scanned(one) is None]
    probed = _probed(error, point, few, excitation)[1]
    return [(probe.candidate, probe.values[0], float(np.sum(columns**2)) / 2) for probe, columns in probed]


def _probed(
    error: BinnedOutputError, point: Array, chosen: Sequence[Candidate], excitation: Excitation
) -> tuple[Array, list[tuple[_Probe, Array]]]:
    """The residual, and of each probe that shows (rows, simulations) its changes; both with the rest projected out."""
    base = error.plan.at(point)
    plan = dataclasses.replace(error.plan, model=base)
    residual = error.whiten(error.predict([base])[0])
    projection = Projection(error, point)
    probes = [probe for candidate in chosen for probe in _probes(candidate, base, excitation)]
    models = [probe.candidate.starting(plan, values).model for probe in probes for values in probe.values]
    simulated = (row for chunk in _chunks(models) for row in error.predict(chunk))
    found = []
    for probe in probes:
        changes = np.array([residual - error.whiten(next(simulated)) for _ in probe.values])
        if not np.isfinite(changes).all() or np.abs(changes).max() < _NOTHING:
            continue
        columns = np.array([projection.project(np.append(one, np.zeros(len(point)))) for one in changes]).T
        found.append((probe, columns))
    return projection.remainder(residual), found


class Projection:
    """Removes from a whitened residual what the parameters of `error.plan` can take up, from `point`.

    To first order, priors included.
    """

    def __init__(self, error: BinnedOutputError, point: Array) -> None:
        prior, slopes = error.prior_rows(point)
        whitened = error.sensitivity(point) * error.weight()[:, np.newaxis]
        self._prior = -prior
        self._basis, _ = np.linalg.qr(np.vstack([whitened, slopes]))

    def remainder(self, residual: Array) -> Array:
        """(samples + parameters,): of (samples,); the rows of the priors come last."""
        return self.project(np.concatenate([residual, self._prior]))

    def project(self, rows: Array) -> Array:
        left: Array = rows - self._basis @ (self._basis.T @ rows)
        return left


def _chunks(models: list[Model]) -> list[list[Model]]:
    return [models[k : k + _CHUNK] for k in range(0, len(models), _CHUNK)]


def _amplitudes(columns: Array, left: Array, *, free_sign: bool) -> Array:
    found = np.linalg.lstsq(columns, left, rcond=1e-6)[0]
    if free_sign:
        largest = max(float(np.abs(found).max()), 1e-12)
        return np.asarray(found * min(1.0, _MOST / largest))
    return np.clip(found, _LEAST, 2.0)


def _ends(probe: _Probe, amplitudes: Array) -> dict[str, float]:
    """The values that the amplitudes of a probe's changes stand for, within the parameters' ranges."""
    first = dict(probe.values[0])
    if "order" in first and probe.free_sign:
        sides = _sides(amplitudes)
        first[_size_of(probe.candidate)] *= float(np.mean(np.abs(sides)))
        left, right = np.angle(sides)
        apart = float(np.angle(np.exp(1j * (left - right))))
        first["phase"] = float(np.angle(np.exp(1j * (right + apart / 2))))
        if "phase_difference" in first:
            first["phase_difference"] = apart
    elif _limited(probe.candidate) or _scanned(probe.candidate):
        pass  # the tighter, the more it changes: its amplitude says nothing of where it is
    elif probe.free_sign:
        for values, amplitude in zip(probe.values, amplitudes, strict=True):
            moved = next(name for name, value in values.items() if value != 0)
            first[moved] = values[moved] * float(amplitude)
    else:
        for name in first:
            if name == _size_of(probe.candidate):
                first[name] *= float(amplitudes[0])
    return _within(probe.candidate.effect, first)


def _sides(amplitudes: Array) -> NDArray[np.complex128]:
    """Left and right phasor of what repeats with the angle, from the amplitudes of `_TURNS`."""
    a, b, c, d = np.append(amplitudes, np.zeros(4 - len(amplitudes)))
    return np.array([a - d + 1j * (b + c), a + d + 1j * (b - c)])


def _within(effect: str, values: Mapping[str, float]) -> dict[str, float]:
    infos = {one.name: one for one in catalogue.effect(effect).parameters}
    return {name: float(np.clip(value, infos[name].minimum, infos[name].maximum)) for name, value in values.items()}


def _size_of(candidate: Candidate) -> str:
    return candidate.free[0]


def _probes(candidate: Candidate, base: Model, excitation: Excitation) -> list[_Probe]:
    effect = catalogue.effect(candidate.effect)
    infos = {one.name: one for one in effect.parameters if one.name in candidate.free}
    if limit := _limited(candidate):
        largest = excitation.largest.get(limit.limits, 0.0)
        return [_Probe(candidate, ({limit.name: share * largest},), False) for share in _SHARES if largest > 0]
    if scanned := _scanned(candidate):
        on_off = _switched(effect)
        return [_Probe(candidate, ({scanned.name: v, **on},), False) for v in scanned.scan for on in on_off]
    natural = {name: (one.preset or one.trial) * scale_of(one.unit, base) for name, one in infos.items()}
    if "order" in infos:
        orders = [order for order in (*excitation.orders, *_ORDERS) if order >= excitation.least_order]
        waves = [_wave(candidate, natural, order, _TURNS) for order in orders]
        bites = [
            _Probe(candidate, (one,), False)
            for order in (excitation.orders if excitation.windowed else ())
            if order in orders
            for size in _BITES
            for one in _wave(
                candidate, natural | {_size_of(candidate): size * natural[_size_of(candidate)]}, order, _ROUNDS
            )
        ]
        return [*(_Probe(candidate, wave, True) for wave in waves), *bites]
    if all(_is_signed(one) for one in infos.values()):
        zero = dict.fromkeys(infos, 0.0)
        return [_Probe(candidate, tuple({**zero, name: _SMALL * natural[name]} for name in infos), True)]
    sized = [name for name in infos if infos[name].role not in ("shape", "place")]
    sides = [name for name in infos if _is_signed(infos[name])]
    probes = []
    for size in _SIZES:
        for signs in itertools.product((1.0, -1.0), repeat=len(sides)):
            start = {**natural, **{name: natural[name] * size for name in sized}}
            start |= {name: natural[name] * sign for name, sign in zip(sides, signs, strict=True)}
            probes += [_Probe(candidate, (_within(effect.name, {**start, **on}),), False) for on in _switched(effect)]
    return probes


def _wave(
    candidate: Candidate, natural: Mapping[str, float], order: float, phases: Sequence[tuple[float, float]]
) -> tuple[Mapping[str, float], ...]:
    """What repeats `order` times, with each phase and phase difference; the latter where it is free."""
    apart = "phase_difference" in candidate.free
    turned = (
        {**natural, "order": order, "phase": phase} | ({"phase_difference": by} if apart else {})
        for phase, by in phases
        if apart or by == 0
    )
    return tuple(_within(candidate.effect, one) for one in turned)


def _switched(effect: EffectInfo) -> list[dict[str, float]]:
    """Every choice that an effect leaves, as values beside its sizes: none, or one switch at its other end."""
    return [{}, *({one.name: one.maximum} for one in effect.parameters if one.role == "switch")]


def _is_signed(one: ParameterInfo) -> bool:
    return one.minimum < 0 and one.role != "shape"


def _limited(candidate: Candidate) -> ParameterInfo | None:
    """The parameter that is the end of a range."""
    return next((one for one in catalogue.effect(candidate.effect).parameters if one.role == "limit"), None)


def _scanned(candidate: Candidate) -> ParameterInfo | None:
    """The parameter whose sizes are tried one by one, because what the effect changes comes and goes with it."""
    return next((one for one in catalogue.effect(candidate.effect).parameters if one.scan), None)


def scale_of(unit: str, model: Model) -> float:
    """How much larger a quantity of that unit is on this vehicle than on the packaged robot, whose sizes are preset."""
    own, other = _sizes(model), _sizes(rcx())
    return own[unit] / other[unit] if unit in own else 1.0


def _sizes(model: Model) -> dict[str, float]:
    """What is large for a vehicle, by unit: at stall, at the speed it runs at without load."""
    known = {**catalogue.presets(model.vehicle), **model.parameters}
    volts = known["battery_voltage"] or 9.0
    direct = known["force_per_volt"] or known["torque_per_volt"]
    torque = direct * volts if direct else known["torque_constant"] * volts / known["resistance"]
    radius = 1.0 if known["force_per_volt"] else known["wheel_radius"] or 0.04
    if direct:
        speed = torque / known["viscous_friction"] if known["viscous_friction"] else 1.0
    else:
        speed = volts / known["emf_constant"]
    return {
        "V": volts,
        "N m": torque,
        "N": torque / radius,
        "N m s/rad": torque / speed,
        "N s^2/m^2": torque / radius / (speed * radius) ** 2,
        "rad/s": speed,
        "kg": known["mass"] or 1.0,
        "m": known["half_track"] or 0.07,
        "ohm": known["resistance"] or 1.0,
        "m/(N s)": speed * radius**2 / torque,
    }
