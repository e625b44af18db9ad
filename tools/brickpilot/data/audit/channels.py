"""Finds channels that contradict the others of their run as a whole: the sign reversed, or the unit another.

Nothing is fitted and no model is needed. Where relations are bad (`relations`), each channel that takes part is
tried with the factor put right, in one run or in all; what puts most right and nothing wrong is at fault. Between two
that explain as much, the gain per drive in the other runs decides, then which values a small machine would show.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.relations import (
    FACTORS,
    WHEEL_KINDS,
    Alike,
    Driven,
    Geometry,
    Group,
    clock_factors,
    driving,
    is_clock,
    is_unit,
    is_usual,
    relations,
)
from brickpilot.data.audit.view import Course, driven_by, drives
from brickpilot.data.audit.windows import Windows, cut

Vector = NDArray[np.float64]

LEAST_SAMPLES = 20
"""A run of fewer samples is not compared."""

_LEVEL = 0.4  # of the hardest driven run: a run driven less may be moved by something else
_ROUNDS = 8
_WORST = 6.0  # largest discrepancy that counts, a logarithm
_LAST_RESORT = 0.01  # what a drive, or one more channel, costs where all else is equal
_WITH_DRIVE = 0.8  # correlation of a motion with its drive, for its gain to be one
_GROSS = 9.0
_GAINS_FIT = 1.3  # how far a gain over those of the other runs may be off a factor
_GAINS_ALIKE = 2.0  # of most of the other runs
_NOISE_FIT = 2.0
_LIKELIER = 2.0  # logarithm: one mistake in a column is likelier than in one run of it
_TURNS = 0.3  # rad/s
_TURN_PER_METRE = (0.5, 50.0)  # 1 / (2 b): b from 1 cm to 1 m
_TURN_PER_RADIAN = (0.03, 1.2)  # r / (2 b)
_TYPICAL = (("yaw_", 3.0), ("wheel_travel", 0.5), ("wheel_velocity", 0.5), ("position", 0.2), ("velocity", 0.2),
            ("wheel_", 10.0), ("angle", 10.0), ("speed", 10.0), ("accel_", 1.0))  # fmt: skip
_TYPICAL_INTERVAL_S = 0.005
_IMPLAUSIBLE = 0.25  # the weight of what small machines typically show beside what the channels say
_UNUSUAL = 0.3  # for a factor that the channel's own unit is seldom off by
_LIKELIER_IN_ALL = 0.5  # one mistake in all runs than in some
_AGAINST_DRIVE = 1.0  # what a channel that goes against its drive costs, however faint that is


@dataclass(frozen=True)
class Contradiction:
    """`names`: channels, "time" or drives ("drive_left") that say `factor` times what is so, in `runs` (by number).
    `against`: the channels that say so, or the drives; empty: the other runs."""

    names: Group
    factor: float
    runs: tuple[int, ...]
    against: Group


@dataclass(frozen=True)
class _Trial:
    group: Group
    factor: float

    def factors(self) -> dict[str, float]:
        return dict.fromkeys(self.group, self.factor)


class _Runs:
    """The windows of all runs that are long enough, by number, and what the relations say of them."""

    def __init__(
        self,
        windows: Mapping[int, Windows],
        names: Sequence[str],
        roughness: Mapping[int, Mapping[str, float]],
        geometry: Geometry,
    ) -> None:
        self.windows = windows
        self.names = names
        self.roughness = roughness
        self.least = _least(windows)
        self.relations = relations(names, geometry, self.least)
        self.judged = {k: [relation.judge(one) for relation in self.relations] for k, one in windows.items()}


def contradictions(
    courses: Sequence[Course], *, wheel_radius: float | None, half_track: float | None
) -> list[Contradiction]:
    """Channels at fault as a whole, the surest first. Lengths in m, None where they are not known."""
    windows = {k: _windows(course) for k, course in enumerate(courses) if len(course.time) >= LEAST_SAMPLES}
    names = [name for name in dict.fromkeys(n for one in windows.values() for n in one.moved) if _is_output(name)]
    rough = {k: {name: _roughness(values) for name, values in courses[k].outputs.items()} for k in windows}
    geometry = Geometry(wheel_radius, half_track, {})
    found = _clocks_in_other_units(windows)
    found += _search(windows, names, rough, geometry)
    # how wheels turn the body is learnt from wheels that do not contradict each other
    if learnt := _turned(windows, names, geometry):
        found += _search(windows, names, rough, replace(geometry, turned=learnt))
    return found + _against_other_runs(_Runs(windows, names, rough, geometry))


def _clocks_in_other_units(windows: dict[int, Windows]) -> list[Contradiction]:
    """Runs sampled a thousand times more seldom, or more often, than the others; their clock is put right."""
    intervals = {number: one.interval for number, one in windows.items()}
    odd: dict[int, float] = {}
    for number, interval in intervals.items():
        others = [other for k, other in intervals.items() if k != number]
        if others and (factors := clock_factors(interval / float(np.median(others)))):
            odd[number] = factors[0]
    if len(odd) == len(intervals) == 2:
        odd = dict([max(odd.items(), key=lambda one: abs(log(intervals[one[0]] / _TYPICAL_INTERVAL_S)))])
    for number, factor in odd.items():
        windows[number] = windows[number].divided({"time": factor})
    return [Contradiction(("time",), factor, (number,), ()) for number, factor in odd.items()]


def _search(
    windows: dict[int, Windows],
    names: Sequence[str],
    roughness: Mapping[int, Mapping[str, float]],
    geometry: Geometry,
) -> list[Contradiction]:
    """The surest contradictions one after the other; each is put right in `windows` before the next."""
    found: list[Contradiction] = []
    while len(found) < _ROUNDS:
        runs = _Runs(windows, names, roughness, geometry)
        best = _best(runs)
        if best is None:
            break
        found.append(best)
        for number in best.runs:
            windows[number] = windows[number].divided(dict.fromkeys(best.names, best.factor))
    return found


def _windows(course: Course) -> Windows:
    driven = {f"drive_{which}": drive for which, drive in drives(course.inputs).items() if which != "yaw"}
    return cut(course.time, {**course.outputs, **driven})


def _is_output(name: str) -> bool:
    return not name.startswith("drive_")


def _least(windows: Mapping[int, Windows]) -> dict[str, float]:
    """Of each drive that there is, the rms below which it says nothing."""
    levels = {which: [_level(one, which) for one in windows.values()] for which in ("left", "right", "shaft", "yaw")}
    return {which: _LEVEL * max(each) for which, each in levels.items() if any(level > 0.0 for level in each)}


def _level(windows: Windows, which: str) -> float:
    drive = driving(windows, which)
    return 0.0 if drive is None else float(np.sqrt(np.mean((drive / windows.seconds) ** 2)))


def _turned(windows: Mapping[int, Windows], names: Iterable[str], geometry: Geometry) -> dict[tuple[str, str], float]:
    """Yaw per difference of the wheels as most runs have it, where the data set does not state the geometry.

    A value that no small vehicle has is divided by the first unit factor that makes it one, so that all runs are bad.
    """
    found: dict[tuple[str, str], float] = {}
    for kind in WHEEL_KINDS:
        left, right = f"wheel_{kind}_left", f"wheel_{kind}_right"
        for yaw in {"yaw_rate", "yaw_angle"} & set(names):
            if not {left, right} <= set(names) or geometry.turn(yaw, kind) is not None:
                continue
            limits = _TURN_PER_METRE if geometry.metres(kind) == 1.0 else _TURN_PER_RADIAN
            per = float(np.sqrt(limits[0] * limits[1]))
            ratios = [turn for one in windows.values() if (turn := _turn_ratio(one, yaw, left, right, per)) is not None]
            if ratios:
                found[yaw, kind] = _believable(float(np.median(ratios)), limits)
    return found


def _turn_ratio(windows: Windows, yaw: str, left: str, right: str, per: float) -> float | None:
    if not {yaw, left, right} <= windows.moved.keys():
        return None
    turn, apart = windows.moved[yaw], windows.moved[left] - windows.moved[right]
    known = np.isfinite(turn) & np.isfinite(apart)
    turn, apart, seconds = turn[known], apart[known], windows.seconds[known]
    power, other = float(turn @ turn), float(apart @ apart)
    rates = [float(np.sqrt(np.mean((values / seconds) ** 2))) for values in (turn, per * apart)]
    if min(rates) == 0.0 or max(rates) < _TURNS:
        return None
    return float(np.sqrt(power / other)) if abs(turn @ apart) > 0.9 * np.sqrt(power * other) else None


def _believable(ratio: float, limits: tuple[float, float]) -> float:
    if limits[0] <= ratio <= limits[1]:
        return ratio
    listed = [one for factor in FACTORS for one in (factor, 1 / factor)]
    return next((ratio / one for one in listed if limits[0] <= ratio / one <= limits[1]), ratio)


def _best(runs: _Runs) -> Contradiction | None:
    """What puts most right and, in its runs, nothing wrong; of two, what leaves the runs less odd."""
    scored: list[tuple[int, float, _Trial, tuple[int, ...]]] = []
    for trial in _trials(runs):
        gains = {number: _gain(runs, number, trial) for number in runs.windows}
        helped = tuple(number for number, gain in gains.items() if gain > 0)
        if not helped:
            continue
        spares = all(gain >= 0 for gain in gains.values())
        scope = _as_noisy(runs, trial, helped) if spares else helped
        score = sum(gains[number] for number in helped) - len(helped) * _is_one_drive(trial)
        scored.append((score, -_cost(runs, trial, helped, spares=spares), trial, scope))
    if not scored:
        return None
    _, _, trial, scope = max(scored, key=lambda one: one[:2])
    return Contradiction(trial.group, trial.factor, scope, _against(runs, trial, scope))


def _is_one_drive(trial: _Trial) -> bool:
    """Whether it blames one drive alone, which the log's writer knew best."""
    return len(trial.group) == 1 and not _is_output(trial.group[0])


def _trials(runs: _Runs) -> list[_Trial]:
    trials: dict[_Trial, None] = {}
    for judged in runs.judged.values():
        for relation, judgement in zip(runs.relations, judged, strict=True):
            for factor in judgement.factors:
                for group in relation.over:
                    trials[_Trial(group, factor)] = None
                for group in relation.under:
                    trials[_Trial(group, 1 / factor)] = None
    return [one for one in trials if (is_clock(one.factor) if one.group == ("time",) else is_unit(one.factor))]


def _gain(runs: _Runs, number: int, trial: _Trial) -> int:
    """By how much a trial betters the relations of a run; 0 unless it makes one good that was bad."""
    windows = runs.windows[number].divided(trial.factors())
    heals, gain = False, 0
    for relation, before in zip(runs.relations, runs.judged[number], strict=True):
        after = relation.judge(windows, faint=before.state == -1)
        heals |= before.state == -1 and after.state == 1
        gain += after.state - before.state
    return gain if heals or gain < 0 else 0


def _as_noisy(runs: _Runs, trial: _Trial, helped: tuple[int, ...]) -> tuple[int, ...]:
    """All runs, but for those whose noise says that the channels of the one run that shows it are not as theirs."""
    if abs(trial.factor) == 1.0 or trial.group == ("time",) or len(helped) > 1:
        return tuple(runs.windows)
    found: list[int] = []
    for number in runs.windows:
        shown, own = runs.roughness[helped[0]], runs.roughness[number]
        known = [log(own[name] / shown[name]) for name in trial.group if own.get(name, 0) and shown.get(name, 0)]
        if all(abs(ratio) < abs(ratio + log(abs(trial.factor))) + _LIKELIER for ratio in known):
            found.append(number)
    return tuple(sorted({*found, *helped}))


def _against(runs: _Runs, trial: _Trial, scope: Iterable[int]) -> Group:
    """The channels by which the fault shows."""
    found: dict[str, None] = {}
    for number in scope:
        for relation, judgement in zip(runs.relations, runs.judged[number], strict=True):
            if judgement.state == -1 and trial.group in (*relation.over, *relation.under):
                if trial.group in relation.under:
                    found |= dict.fromkeys(relation.over[0])
                elif isinstance(relation, Driven):
                    found |= dict.fromkeys((f"drive_{relation.drive}",))
                else:
                    found |= dict.fromkeys(relation.under[0])
    return tuple(name for name in found if name not in trial.group)


def _cost(runs: _Runs, trial: _Trial, helped: tuple[int, ...], *, spares: bool) -> float:
    """How odd the runs in `helped` are once put right: by what their channels say, beside the other runs, and for a
    small machine. Where the trial `spares` the other runs they may be wrong as well, and are put right too."""
    factors = trial.factors()
    others = [one.divided(factors) if spares else one for k, one in runs.windows.items() if k not in helped]
    usual = {name: gain for name in runs.names if (gain := _usual_gain(others, name)) is not None}
    interval = float(np.median([one.interval for one in others])) if others else _TYPICAL_INTERVAL_S
    unusual = any(not is_usual(name, trial.factor) for name in trial.group if _is_output(name) and name != "time")
    cost = _LAST_RESORT * (10.0 if _is_one_drive(trial) else sum(map(_is_output, trial.group)))
    cost += _UNUSUAL * unusual - _LIKELIER_IN_ALL * spares
    for number in helped:
        right = runs.windows[number].divided(factors)
        judged = [one.judge(right, faint=True) for one in runs.relations if isinstance(one, Alike)]
        odd = sum(_apart(one.ratio, 1.0) for one in judged if np.isfinite(one.ratio))
        odd += _apart(right.interval, interval) + _IMPLAUSIBLE * _apart(right.interval, _TYPICAL_INTERVAL_S)
        for name in runs.names:
            own = _drive_gain(right, name)
            odd += _IMPLAUSIBLE * _oddness(right, name)
            odd += _AGAINST_DRIVE if own is not None and own < 0.0 else 0.0
            odd += _apart(own, usual[name]) if own is not None and name in usual else 0.0
        cost += odd / len(helped)
    return cost


def _apart(one: float, other: float) -> float:
    return min(abs(log(abs(one) / abs(other))), _WORST)


def _usual_gain(others: Iterable[Windows], name: str) -> float | None:
    gains = [abs(gain) for one in others if (gain := _drive_gain(one, name)) is not None]
    return float(np.median(gains)) if gains else None


def _drive_gain(windows: Windows, name: str, *, surely: float = 0.0) -> float | None:
    """A channel's motion per drive, by least squares; None where either is unknown or nothing, or less correlated."""
    drive = driving(windows, driven_by(name))
    if drive is None or name not in windows.moved:
        return None
    known = np.isfinite(windows.moved[name]) & np.isfinite(drive)
    motion, drive = windows.moved[name][known], drive[known]
    common, power, way = float(motion @ drive), float(drive @ drive), float(motion @ motion)
    if common == 0.0 or abs(common) < surely * float(np.sqrt(power * way)):
        return None
    return common / power


def _oddness(windows: Windows, name: str) -> float:
    typical = next((value for start, value in _TYPICAL if name.startswith(start)), None)
    if typical is None or name not in windows.moved:
        return 0.0
    largest = float(np.nanmax(np.abs(windows.moved[name] / windows.seconds), initial=0.0))
    return _apart(largest, typical) if largest > 0.0 else 0.0


def _against_other_runs(runs: _Runs) -> list[Contradiction]:
    """Channels that nothing in their run is held against, but whose gain per drive is another unit's of other runs'.

    A gain that is too small may be a wheel that sticks, and one that other channels share may be the machine's: then
    the channel's noise must have changed by as much.
    """
    found: list[Contradiction] = []
    for name in runs.names:
        which = driven_by(name)
        gains = {
            number: abs(gain)
            for number, one in runs.windows.items()
            if which in runs.least and _level(one, which) >= runs.least[which]
            if (gain := _drive_gain(one, name, surely=_WITH_DRIVE)) is not None
        }
        odd: dict[int, float] = {}
        for number, gain in gains.items():
            others = [k for k in gains if k != number]
            if not others:
                continue
            ratios = gain / np.array([gains[k] for k in others])
            ratio = float(np.median(ratios))
            factor = next((one for one in _gross() if 1 / _GAINS_FIT < ratio / one < _GAINS_FIT), None)
            # the median of two that differ is like neither
            if factor is None or np.mean(np.abs(np.log(ratios / ratio)) < log(_GAINS_ALIKE)) <= 0.5:
                continue
            noisy = _is_as_noisy(runs, number, others, name, factor)
            if noisy or (factor > 1.0 and not _is_confirmed(runs, number, name)):
                odd[number] = factor
        if len(odd) == len(gains) == 2:  # the one against the other
            odd = dict([max(odd.items(), key=lambda one: _oddness(runs.windows[one[0]], name))])
        found += [Contradiction((name,), factor, (number,), ()) for number, factor in odd.items()]
    return found


def _gross() -> list[float]:
    return [one for factor in FACTORS if factor > _GROSS for one in (factor, 1 / factor)]


def _is_confirmed(runs: _Runs, number: int, name: str) -> bool:
    """Whether another channel of the run says as much."""
    return any(
        judgement.state == 1 and any(name in group for group in (*relation.over, *relation.under))
        for relation, judgement in zip(runs.relations, runs.judged[number], strict=True)
        if isinstance(relation, Alike)
    )


def _is_as_noisy(runs: _Runs, number: int, others: Iterable[int], name: str, factor: float) -> bool:
    own = runs.roughness[number][name]
    usual = [rough for k in others if (rough := runs.roughness[k][name]) > 0.0]
    return bool(own > 0.0 and usual and 1 / _NOISE_FIT < own / (factor * float(np.median(usual))) < _NOISE_FIT)


def _roughness(values: Vector) -> float:
    """Mean size of the second differences: noise and resolution more than motion. 0 where there are none."""
    rough = np.abs(np.diff(values, 2))
    return float(np.mean(rough[np.isfinite(rough)])) if np.isfinite(rough).any() else 0.0
