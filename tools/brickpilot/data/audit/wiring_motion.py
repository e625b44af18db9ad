"""The motion of drives, wheels and yaw in short windows, and hypotheses on how their channels are wired.

The model: the wheels follow their drives with positive gains and a lag, in straight motion and in turns; the yaw
follows the difference of the wheels. Each way to swap and reverse channels is a hypothesis, and explains a share of the
motion. This share gives the likelihood of the hypothesis. The posterior weight is the likelihood times a prior factor
for each fault in the hypothesis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from math import exp, log, sqrt

import numpy as np

from brickpilot.data.audit.fault import Kind
from brickpilot.data.audit.relations import Geometry
from brickpilot.data.audit.view import Channels, Vector, cut, typical_motion

SURE = 0.99
"""A fault with at least this probability is mended before the analysis."""

WHEEL_KINDS = ("angle", "travel", "speed", "velocity")

_WINDOW_S = 0.1
_PER_SECOND = 4.0  # number of independent windows in a second
_MOST = 60.0  # a larger number of independent windows counts as this number, because the model is rough
_FLOOR = 0.02  # share of the motion that even the right hypothesis does not explain
_EXPLAINED = 0.4  # least share of the motion: a hypothesis that explains less gets no likelihood for it
_PER_FAULT = 6.0  # natural logarithm of the prior odds against each fault
LAGS = (
    1.0,
    0.5,
    0.25,
    0.1,
)  # lags that are tried, each as the share of a step response that is reached after one window
_DEAD = 0.01  # a wheel stands still if its motion is at most this share of the other wheel's motion
_APART = 0.3  # share of the drives' rms: with a weaker drive, a wheel may stand still although its encoder works
FREE = 1.33  # largest factor, up or down, by which slip and inexact lengths may change a ratio
UNIT_FITS = 3.0  # a unit explains a ratio if (ratio / the unit's factor) is below this, up or down
_ONE_RUN = 30.0  # limit, in medians of the runs' motion: a run's channel with more motion is in another unit
_ONE_NUMBER = 0.93  # least share of the yaw that two wheels without slip explain
_COLLINEAR = 1e4  # largest condition number of the normal equations at which left and right can be told apart


@dataclass(frozen=True)
class Taken:
    """A signal's values are `factor` times those of the channel `source`."""

    source: str
    factor: float = 1.0


@dataclass(frozen=True)
class Miswired:
    """One fault of the wiring or scale, in words, and its correction.

    Attributes:
        kind: "swapped", "sign", "frozen", "unit" or "clock", as in `Fault`.
        signals: the channels that are wrong.
        text: what is wrong, as the beginning of a sentence.
        sure: probability of the fault, 0..1.
        mend: signal -> the channel that holds the signal's values; empty: the fault cannot be mended.
        factor: ratio of stated to true value; None: no factor describes the fault.
        is_open: whether another value, such as a measured length, may be wrong instead; then no channel is mended.
    """

    kind: Kind
    signals: tuple[str, ...]
    text: str
    sure: float
    mend: Mapping[str, Taken] = field(default_factory=dict)
    factor: float | None = None
    is_open: bool = False

    @property
    def is_mended(self) -> bool:
        """Whether the analysis uses the mended channels."""
        return bool(self.mend) and self.sure >= SURE and not self.is_open

    @property
    def sentence(self) -> str:
        sure = f"{100 * min(self.sure, 0.999):.3g} % sure"
        done = "left out here" if self.kind == "frozen" else "mended here"
        text = self.text if "_" in self.text.split()[0] else f"{self.text[0].upper()}{self.text[1:]}"
        return f"{text} ({sure}{f', {done}' if self.is_mended else ''})."


class Motion:
    """The motion of drives, wheels and yaw in short windows of all runs; (w,) each, NaN where unknown."""

    def __init__(self, runs: Sequence[Channels]) -> None:
        from scipy.signal import lfilter  # slow to load, and not needed without data

        self.inputs = list(runs[0].inputs)
        self.names = [name for name in runs[0].outputs if any(np.isfinite(run.outputs[name]).any() for run in runs)]
        self.kind = next((kind for kind in WHEEL_KINDS if set(pair(f"wheel_{kind}")) & set(self.names)), None)
        self.wheels: tuple[str, ...] = () if self.kind is None else pair(f"wheel_{self.kind}")
        self.yaw = next((name for name in ("yaw_rate", "yaw_angle") if name in self.names), None)
        parts: list[dict[str, Vector]] = []
        for run in runs:
            driven = {side: drive for side, drive in run.drives.items() if side != "yaw"}
            wanted = {name: run.outputs[name] for name in self.names if name.startswith(("wheel_", "yaw_"))}
            seconds = float(run.time[-1] - run.time[0])
            windows = cut(run.time, driven | wanted, int(np.clip(seconds / _WINDOW_S, 8, 2000)))
            nothing = np.full_like(windows.seconds, np.nan)
            part = {name: windows.moved.get(name, nothing) / windows.seconds for name in (*driven, *wanted)}
            for number, share in enumerate(LAGS):
                for side in driven:
                    part[f"{side}{number}"] = lfilter([share], [1.0, share - 1.0], part[side])
            parts.append(part | {"seconds": windows.seconds})
        for name in (name for name in self.names if name.startswith("wheel_")):
            sizes = np.array([_rms(part[name]) if name in part else 0.0 for part in parts])
            usual = float(np.median(sizes[sizes > 0.0])) if sizes.any() else 0.0
            for part, size in zip(parts, sizes, strict=True):
                if size > _ONE_RUN * usual:
                    part[name][:] = np.nan  # this run alone is in another unit; the audit finds this fault
        self.at = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    @cached_property
    def drives(self) -> float:
        """The rms of the drives."""
        return _rms(np.concatenate([self.at["left"], self.at["right"]]))

    @cached_property
    def still(self) -> tuple[str, ...]:
        """The wheels that stand still in all runs although the other wheel moves or the body turns."""
        sizes = {name: _rms(self.at[name]) if name in self.at else np.nan for name in self.wheels}
        largest = max(sizes.values(), default=0.0)
        turns = self.yaw is not None and _rms(self.at[self.yaw]) > 0.05
        return tuple(
            name for name, size in sizes.items()
            if name in self.at and (size <= _DEAD * largest or (largest == 0.0 and turns))
        )  # fmt: skip

    def dead(self) -> list[Miswired]:
        """Returns the encoders that do not count."""
        if len(self.still) == 2:
            turns = "the gyro" if self.yaw == "yaw_rate" else self.yaw
            text = f"both encoders stand still while {turns} turns"
            return [Miswired("frozen", self.still, text, 1.0, {name: Taken(name, np.nan) for name in self.still})]
        found = []
        for name in self.still:
            side, other = ("left", "right") if name.endswith("left") else ("right", "left")
            own = self.at[side]
            if _rms(own) < _APART * self.drives:
                continue
            # If the wheel were blocked instead, the robot would turn about this wheel.
            sure = 1.0 if self._goes_straight(other) else 0.9
            text = f"the {side} encoder stands still while its motor is driven and the {other} wheel moves"
            found.append(Miswired("frozen", (name,), text, sure, {name: Taken(name, np.nan)}))
        return found

    def _goes_straight(self, moving: str) -> bool:
        """Whether both drives explain the yaw better than the wheel `moving` alone; then the other wheel turns, too."""
        if self.yaw is None:
            return False
        turn, left, right = (self.at[name] for name in (self.yaw, "left1", "right1"))
        alone = self.at[self.wheels[0 if moving == "left" else 1]]
        ahead, apart, alone_alike = (abs(_correlation(turn, one)) for one in (left + right, left - right, alone))
        return max(ahead, apart) > alone_alike

    def hypotheses(self, nominal: Mapping[str, float]) -> list[Miswired]:
        """Returns the faults of the most probable hypothesis; empty: it has no faults."""
        least_turn = self._least_turn(nominal)
        scored = [(self._score(one, least_turn) - _PER_FAULT * one.cost, one) for one in _WAYS if self._can(one)]
        if not scored:
            return []
        top = max(score for score, _ in scored)
        total = sum(exp(score - top) for score, _ in scored)
        best = max(scored, key=lambda one: (one[0], -one[1].cost))[1]
        if best.cost == 0:
            return []
        alike = [one for score, one in scored if score > top - 1e-6 and one is not best]
        share = sum(exp(score - top) for score, one in scored if one is best or one in alike) / total
        rivals = [" and ".join(fault.text for fault in one.faults(self, share)) for one in alike]
        *first, last = best.faults(self, share)
        return [*first, replace(last, text=last.text + (f", or as well {', '.join(rivals)}" if rivals else ""))]

    def turning(self) -> Gains | None:
        """Returns the gains from the left and the right wheel to the yaw; None: not measured, or the gains vary."""
        if self.yaw is None or len(self.moving) < 2:
            return None
        left, right = (self.at[name] for name in self.wheels)
        turn, seconds = self.at[self.yaw], float(np.sum(self.at["seconds"]))
        x = np.column_stack([left, -right])
        if (whole := _gains(x, turn, seconds, _ONE_NUMBER)) is None:
            return None
        slow = np.abs(turn) < 0.5 * float(np.nanmax(np.abs(turn), initial=0.0))
        apart = x @ whole.gains
        known = np.isfinite(turn) & np.isfinite(apart)
        # The error from slip, or from a gyro at the end of its range, grows with speed; the error from wrong counts
        # does not.
        ratios = [float(turn[some] @ apart[some]) / max(float(apart[some] @ apart[some]), 1e-12)
                  for some in (known & slow, known & ~slow)]  # fmt: skip
        alike = min(ratios) > 0.0 and max(ratios) < FREE * min(ratios)
        return whole if alike else None

    def driven(self, lag: int) -> Gains | None:
        """Returns the gain from each side's drive to its wheel, or to the yaw if the wheels are not measured."""
        left, right, seconds = self.at[f"left{lag}"], self.at[f"right{lag}"], float(np.sum(self.at["seconds"]))
        if len(self.moving) < 2:
            return None if self.yaw is None else _gains(np.column_stack([left, -right]), self.at[self.yaw], seconds)
        nothing = np.zeros_like(left)
        x = np.vstack([np.column_stack([left, nothing]), np.column_stack([nothing, right])])
        return _gains(x, np.concatenate([self.at[name] for name in self.wheels]), seconds)

    def geometry(self, nominal: Mapping[str, float]) -> float | None:
        """Returns the ratio yaw / (left - right wheel) from the stated lengths; None: a length is not stated."""
        stated = Geometry(nominal.get("wheel_radius"), nominal.get("half_track"), {})
        return stated.turn("", self.kind or "")

    def with_it(self, name: str) -> list[str]:
        """Returns a channel and the channels of the same wheel, or of the yaw, that correlate with this channel."""
        stem, side = name.split("_")[0], name.rsplit("_", 1)[1]
        found = [name]
        for other in self.names:
            if other != name and other.startswith(f"{stem}_") and (stem == "yaw" or other.endswith(side)):
                one, two = self.at[name], self.at[other]
                ratio = _rms(two) / max(_rms(one), 1e-12)
                if _correlation(one, two) > 0.5 and (stem == "wheel" or 1 / UNIT_FITS < ratio < UNIT_FITS):
                    found.append(other)
        return found

    def is_odd_by(self, unit: float) -> bool:
        """Whether a factor `unit` is more likely an error of the wheels than of the yaw, for a typical small robot."""
        turn = float(np.nanmax(np.abs(self.at[self.yaw or ""]), initial=0.0)) / typical_motion("yaw_")
        roll = float(np.nanmax(np.abs(self.at[self.wheels[0]]), initial=0.0)) / typical_motion(self.wheels[0])
        return abs(log(turn)) + abs(log(roll * unit)) < abs(log(turn / unit)) + abs(log(roll))

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The wheels that are measured and move."""
        return tuple(name for name in self.wheels if name in self.at and name not in self.still)

    def _can(self, way: _Way) -> bool:
        """Whether the channels that the hypothesis `way` changes are measured."""
        return not (self.yaw is None and way.yaw < 0) and not (way.wheels.faults and not self.moving)

    def _least_turn(self, nominal: Mapping[str, float]) -> float:
        """Returns the least ratio yaw / (left - right wheel) that is evidence; a smaller yaw has another cause.

        In straight motion, a gyro's bias or unequal wheels cause a small yaw, which is no sign of a reversed wheel.
        """
        usual = typical_motion("yaw_") / (2 * typical_motion("".join(self.wheels[:1]) or "wheel_"))
        return (self.geometry(nominal) or usual) / UNIT_FITS

    def _score(self, way: _Way, least_turn: float) -> float:
        """Returns the log-likelihood of a hypothesis, with the lag that fits best."""
        unknown = np.full_like(self.at["left"], np.nan)
        measured = [self.at[name] if name in self.moving else unknown for name in self.wheels] or [unknown, unknown]
        left_wheel, right_wheel = way.wheels.of(*measured)
        wheels = np.concatenate([left_wheel, right_wheel])
        both = len(self.moving) == 2
        best = -np.inf
        for number in range(len(LAGS)):
            left, right = way.drives.of(self.at[f"left{number}"], self.at[f"right{number}"])
            ahead, apart = left + right, left - right
            columns = np.column_stack([np.tile(ahead, 2), np.concatenate([apart, -apart])])
            explained = _share_left(wheels, columns)
            if self.yaw is not None:
                cause = left_wheel - right_wheel if both else apart
                explained += _share_left(way.yaw * self.at[self.yaw], cause[:, np.newaxis], least_turn if both else 0.0)
            best = max(best, self._weight * explained)
        return best

    @cached_property
    def _weight(self) -> float:
        return min(_PER_SECOND * float(np.sum(self.at["seconds"])), _MOST) / 2


@dataclass(frozen=True)
class _Sides:
    """How the channels of two sides are wired: whether they are swapped, and the signs of left and right."""

    is_swapped: bool
    left: int
    right: int

    @property
    def faults(self) -> int:
        return self.is_swapped + (self.left < 0) + (self.right < 0)

    def of(self, left: Vector, right: Vector) -> tuple[Vector, Vector]:
        """Returns the motions of the left and the right side, from the channels that are named left and right."""
        if self.is_swapped:
            left, right = right, left
        return self.left * left, self.right * right


@dataclass(frozen=True)
class _Way:
    """A hypothesis: one way in which drives, wheels and yaw may be wired."""

    drives: _Sides
    wheels: _Sides
    yaw: int

    @property
    def cost(self) -> int:
        return self.drives.faults + self.wheels.faults + (self.yaw < 0)

    def faults(self, motion: Motion, sure: float) -> list[Miswired]:
        """Returns the faults of this hypothesis, each with the probability `sure`, in the order of their correction."""
        found: list[Miswired] = []

        def add(kind: Kind, text: str, mend: dict[str, Taken]) -> None:
            found.append(Miswired(kind, tuple(mend), text, sure, mend, -1.0 if kind == "sign" else None))

        inputs = [name for name in motion.inputs if name.endswith(("_left", "_right"))]
        wheels = [name for wheel in motion.wheels for name in motion.with_it(wheel)]
        wheels = [name for name in wheels if not self.wheels.is_swapped or _across(name) in wheels]
        for sides, names, part, counts in (
            (self.drives, inputs, "motor", "is driven"), (self.wheels, wheels, "encoder", "counts"),
        ):  # fmt: skip
            if sides.is_swapped:
                add("swapped", f"the left and the right {part} are swapped", {n: Taken(_across(n)) for n in names})
            for side, sign in (("left", sides.left), ("right", sides.right)):
                if sign < 0:
                    own = {name: Taken(name, -1.0) for name in names if name.endswith(side)}
                    add("sign", f"the {side} {part} {counts} backwards", own)
        if self.yaw < 0 and motion.yaw is not None:
            names = motion.with_it(motion.yaw)
            text = f"the sign of {' and '.join(names)} is reversed, or the frame is stated wrongly"
            add("sign", text, {name: Taken(name, -1.0) for name in names})
        return found


_ALL_SIDES = [_Sides(swapped, left, right) for swapped, left, right in product((False, True), (1, -1), (1, -1))]
_WAYS = [_Way(drives, wheels, yaw) for drives, wheels, yaw in product(_ALL_SIDES, _ALL_SIDES, (1, -1))]


def _share_left(y: Vector, x: Vector, least: float = 0.0) -> float:
    """Returns -log(share of `y` that the columns of `x` do not explain), with gains of at least `least`."""
    known = np.isfinite(y) & np.isfinite(x).all(axis=1)
    y, x = y[known], x[known]
    power = float(y @ y)
    if len(y) < 8 or power == 0.0:
        return 0.0
    explained = 0.0
    gram, common = x.T @ x, x.T @ y
    if x.shape[1] == 2 and abs(np.linalg.det(gram)) > 1e-9 * max(gram[0, 0] * gram[1, 1], 1e-300):
        gains = np.linalg.solve(gram, common)
        if np.all(gains >= least):
            explained = float(gains @ common)
    for k in range(x.shape[1]):
        if common[k] > least * gram[k, k]:
            explained = max(explained, float(common[k] ** 2 / gram[k, k]))
    left = max(1.0 - explained / power, 0.0)
    return 0.0 if left > 1.0 - _EXPLAINED else -log(left + _FLOOR)


@dataclass(frozen=True, eq=False)
class Gains:
    """Two positive gains, left and right, and the sd of the logarithm of their ratio."""

    gains: Vector
    sd: float


def _gains(x: Vector, y: Vector, seconds: float, least: float = _EXPLAINED) -> Gains | None:
    """Returns the gains from the columns of `x` to `y`; None: they are not unique or positive, or explain little.

    `least`: the least share of `y` that the gains have to explain.
    """
    known = np.isfinite(y) & np.isfinite(x).all(axis=1)
    x, y = x[known], y[known]
    gram = x.T @ x
    if len(y) < 20 or not y.any() or np.linalg.cond(gram) > _COLLINEAR:
        return None
    gains = np.linalg.solve(gram, x.T @ y)
    if gains.min() <= 0.0:
        return None
    left, power = y - x @ gains, float(y @ y)
    if float(left @ left) > (1.0 - least) * power:
        return None
    variance = (float(left @ left) + _FLOOR**2 * power) / max(_PER_SECOND * seconds, 3.0)
    covariance = variance * np.linalg.inv(gram)
    across = np.array([1.0, -1.0]) / gains
    return Gains(np.asarray(gains, dtype=np.float64), float(np.sqrt(across @ covariance @ across)))


def _correlation(one: Vector, other: Vector) -> float:
    """Returns the correlation of two motions, whose means are not subtracted; 0 if one motion is zero."""
    known = np.isfinite(one) & np.isfinite(other)
    power = sqrt(float(one[known] @ one[known]) * float(other[known] @ other[known]))
    return float(one[known] @ other[known]) / power if power > 0.0 else 0.0


def pair(stem: str) -> tuple[str, str]:
    return f"{stem}_left", f"{stem}_right"


def _across(name: str) -> str:
    return f"{name[:-4]}right" if name.endswith("left") else f"{name[:-5]}left"


def _rms(values: Vector) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0
