"""Finds whole channels that contradict the other channels or the other runs: a reversed sign, or another unit.

No model is needed and no parameter is fitted, because only relations that hold for any machine are used (`relations`).
A trial corrects one or more channels of a broken relation by a factor, in some runs or in all. The trial that repairs
most relations and breaks none is accepted. If two trials repair equally many, the trial with the lower cost is
accepted. The cost says how unusual the corrected channels still are, compared with the other runs and with a typical
small machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from brickpilot.data.audit.fault import CLOCK_FACTORS, FACTORS, GRAVITY, is_one_of, usual_factors
from brickpilot.data.audit.relations import WHEEL_KINDS, Alike, Driven, Geometry, Group, State, relations
from brickpilot.data.audit.view import LEAST_SAMPLES, RunView, Vector, Windows, cut, driven_by, ratio_of, typical_motion

_MOST = 8  # largest number of contradictions that a search returns
_INTERVAL_RATIO = 1.4  # a factor explains the ratio of two sampling intervals if (ratio / factor) is below this
_UNSATURATED = 0.8  # share of the fastest turn of all runs: the geometry is estimated from slower turns only
_TURNS = 0.3  # rad/s: the geometry is estimated only if the rms turn rate is at least this
_TURN_PER_METRE = (0.5, 50.0)  # 1/m: plausible yaw / (left - right travel): 1 / (2 b), half track b from 1 cm to 1 m
_TURN_PER_RADIAN = (0.03, 1.2)  # plausible yaw / (left - right wheel angle): r / (2 b), with the wheel radius r
_LEVEL = 0.4  # share of the strongest drive of any run: a weaker drive is no evidence; other causes may move the robot
_WITH_DRIVE = 0.8  # the gain (motion per drive) counts only if motion and drive have at least this correlation
_LARGE = 9.0  # a comparison with the other runs finds only factors above this
_GAINS_FIT, _NOISE_FIT = 1.3, 2.0  # a factor explains a ratio of gains or noise if (ratio / factor) is below this
_GAINS_ALIKE = 2.0  # two gains agree if their ratio is below this; the gains of most other runs have to agree
_WORST = 6.0  # a larger logarithm of a ratio counts as this value
_TYPICAL_INTERVAL_S = 0.005
_TYPICAL_BATTERY, _HIGHEST_BATTERY = 9.0, 500.0  # V: a typical battery; the limit of a plausible one

# Costs of a trial, in logarithms of a ratio.
_PER_CHANNEL = 0.01  # cost of each blamed channel; it decides only between trials that are equal otherwise
_IMPLAUSIBLE = 0.25  # weight of the comparison with a typical small machine; other comparisons have weight 1
_LIKELIER = 2.0  # logarithm of the prior odds of a mistake in all runs against a mistake in a single run
_UNUSUAL = 0.3  # cost of a factor that is unusual for the channel's unit


@dataclass(frozen=True)
class Contradiction:
    """Whole channels that are wrong.

    Attributes:
        names: the channels, "time", or drives ("drive_left").
        factor: ratio of stated to true value.
        runs: numbers of the runs in which the channels are wrong.
        against: the channels or drives that contradict `names`; empty: the other runs contradict `names`.
    """

    names: Group
    factor: float
    runs: tuple[int, ...]
    against: Group


class RunSet:
    """The runs that are long enough to be compared.

    Attributes:
        windows: number of a run -> the run's windows.
        names: the output channels.
        least: drive -> the least rms per second of this drive that counts as evidence.
        relations: all relations among the channels.
        evidence: number of the run -> the evidence of each relation, in the order of `relations`.
    """

    def __init__(self, windows: Mapping[int, Windows], names: Sequence[str], geometry: Geometry) -> None:
        self.windows = windows
        self.names = names
        levels = {
            which: [one.rms(one.of(f"drive_{which}")) for one in windows.values()]
            for which in ("left", "right", "shaft", "yaw")
        }
        self.least = {which: _LEVEL * max(each) for which, each in levels.items() if any(each)}
        self.relations = relations(names, geometry, self.least)
        self.evidence = {k: [relation.evidence(one) for relation in self.relations] for k, one in windows.items()}


@dataclass(frozen=True)
class Trial:
    """A group of channels that may be wrong by a factor."""

    group: Group
    factor: float

    @property
    def is_plausible(self) -> bool:
        """Whether a confusion of units explains the factor."""
        if self.group == ("time",):
            return self.factor > 0.0 and is_one_of(self.factor, CLOCK_FACTORS)
        return is_one_of(self.factor, (GRAVITY, *FACTORS))

    @property
    def is_one_drive(self) -> bool:
        """Whether the trial blames one drive alone, which is the least likely fault."""
        return len(self.group) == 1 and not _is_output(self.group[0])

    def factors(self) -> dict[str, float]:
        return dict.fromkeys(self.group, self.factor)


def contradictions(views: Sequence[RunView], nominal: Mapping[str, float]) -> list[Contradiction]:
    """Returns the channels that are wrong as a whole, in the order of the search.

    Args:
        nominal: wheel_radius, half_track (m) and battery_voltage (V), as far as these are known.
    """
    windows = {k: _windows(view) for k, view in enumerate(views) if len(view.time) >= LEAST_SAMPLES}
    names = [name for name in dict.fromkeys(n for one in windows.values() for n in one.moved) if _is_output(name)]
    geometry = Geometry(nominal.get("wheel_radius"), nominal.get("half_track"), {})
    found = _clocks_in_other_units(windows)
    found += _search(windows, names, geometry)
    # The ratio of yaw to wheel difference is estimated only now, when the wheels no longer contradict each other.
    if learnt := _turned(windows, names, geometry):
        found += _search(windows, names, replace(geometry, turned=learnt))
    found += _against_other_runs(RunSet(windows, names, geometry))
    return found + _wrong_batteries(views, nominal.get("battery_voltage"))


def _windows(view: RunView) -> Windows:
    driven = {f"drive_{which}": drive for which, drive in view.drives.items() if which != "yaw"}
    return cut(view.time, {**view.outputs, **driven})


def _is_output(name: str) -> bool:
    """Whether a channel is measured, and not a drive."""
    return not name.startswith("drive_")


def _is_near(ratio: float, factor: float, by: float) -> bool:
    return 1 / by < ratio / factor < by


def _beside_others(values: Mapping[int, float], factors: Sequence[float], by: float) -> dict[int, float]:
    """Returns run -> the factor of `factors` that explains (the run's value / the median of the other runs' values).

    Runs without such a factor have no entry. `by`: as in `_is_near`.
    """
    found: dict[int, float] = {}
    for number, value in values.items():
        others = [other for k, other in values.items() if k != number]
        ratio = value / float(np.median(others)) if others else 1.0
        if factor := next((one for one in factors if _is_near(ratio, one, by)), None):
            found[number] = factor
    return found


def _clocks_in_other_units(windows: dict[int, Windows]) -> list[Contradiction]:
    """Returns runs whose sampling interval is in another unit than in the other runs, and corrects their windows."""
    intervals = {number: one.interval for number, one in windows.items()}
    odd = _beside_others(intervals, CLOCK_FACTORS, _INTERVAL_RATIO)
    if len(odd) == len(intervals) == 2:
        odd = dict([max(odd.items(), key=lambda one: _log_ratio(intervals[one[0]], _TYPICAL_INTERVAL_S))])
    for number, factor in odd.items():
        windows[number] = windows[number].divided({"time": factor})
    return [Contradiction(("time",), factor, (number,), ()) for number, factor in odd.items()]


def _search(windows: dict[int, Windows], names: Sequence[str], geometry: Geometry) -> list[Contradiction]:
    """Returns contradictions, the most likely first; each one is corrected in `windows` before the next search."""
    found: list[Contradiction] = []
    while len(found) < _MOST:
        best = _most_likely(RunSet(windows, names, geometry))
        if best is None:
            break
        found.append(best)
        for number in best.runs:
            windows[number] = windows[number].divided(dict.fromkeys(best.names, best.factor))
    return found


def _most_likely(runs: RunSet) -> Contradiction | None:
    """Returns the trial that repairs most relations and breaks none in its runs; of equal trials, the cheapest."""
    scored: list[tuple[int, float, Trial, tuple[int, ...]]] = []
    for trial in _trials(runs):
        gains = {number: _gain(runs, number, trial) for number in runs.windows}
        mended = tuple(number for number, gain in gains.items() if gain > 0)
        if not mended:
            continue
        breaks_none = all(gain >= 0 for gain in gains.values())
        scope = tuple(k for k in runs.windows if k in mended or _may_share(runs, k, trial, mended))
        score = sum(gains[number] for number in mended) - len(mended) * trial.is_one_drive
        scored.append((score, -_cost(runs, trial, mended, in_all=breaks_none), trial, scope if breaks_none else mended))
    if not scored:
        return None
    _, _, trial, scope = max(scored, key=lambda one: one[:2])
    return Contradiction(trial.group, trial.factor, scope, _against(runs, trial, scope))


def _trials(runs: RunSet) -> list[Trial]:
    trials: dict[Trial, None] = {}
    for each in runs.evidence.values():
        for relation, evidence in zip(runs.relations, each, strict=True):
            for factor in evidence.factors:
                trials |= dict.fromkeys(Trial(group, factor) for group in relation.over)
                trials |= dict.fromkeys(Trial(group, 1 / factor) for group in relation.under)
    return [one for one in trials if one.is_plausible]


def _gain(runs: RunSet, number: int, trial: Trial) -> int:
    """Returns (relations of a run that a trial repairs) - (those that it breaks); above 0 only if it repairs one."""
    windows = runs.windows[number].divided(trial.factors())
    mends, gain = False, 0
    for relation, before in zip(runs.relations, runs.evidence[number], strict=True):
        after = relation.evidence(windows, faint=before.state is State.BROKEN)
        mends |= before.state is State.BROKEN and after.state is State.HOLDS
        gain += after.state - before.state
    return gain if mends or gain < 0 else 0


def _may_share(runs: RunSet, number: int, trial: Trial, mended: tuple[int, ...]) -> bool:
    """Whether a run may share the fault of the `mended` runs. False: its logged noise is like their corrected noise."""
    if abs(trial.factor) == 1.0 or trial.group == ("time",) or len(mended) > 1:
        return True
    own, shown = runs.windows[number].roughness, runs.windows[mended[0]].roughness
    ratios = [log(own[name] / shown[name]) for name in trial.group if own.get(name, 0) and shown.get(name, 0)]
    return all(abs(ratio) < abs(ratio + log(abs(trial.factor))) + _LIKELIER for ratio in ratios)


def _against(runs: RunSet, trial: Trial, scope: Iterable[int]) -> Group:
    """Returns the channels or drives outside the trial's group that contradict the group, in the runs `scope`."""
    found: dict[str, None] = {}
    for number in scope:
        for relation, evidence in zip(runs.relations, runs.evidence[number], strict=True):
            if evidence.state is State.BROKEN and trial.group in (*relation.over, *relation.under):
                if trial.group in relation.under:
                    found |= dict.fromkeys(relation.over[0])
                elif isinstance(relation, Driven):
                    found |= dict.fromkeys((f"drive_{relation.drive}",))
                else:
                    found |= dict.fromkeys(relation.under[0])
    return tuple(name for name in found if name not in trial.group)


def _cost(runs: RunSet, trial: Trial, mended: tuple[int, ...], *, in_all: bool) -> float:
    """Returns how unusual the runs in `mended` are after the trial's correction.

    The channels of these runs are compared with each other, with the other runs, and with a typical small machine.
    `in_all`: whether the other runs are corrected, too, because they may have the same fault.
    """
    factors = trial.factors()
    others = [one.divided(factors) if in_all else one for k, one in runs.windows.items() if k not in mended]
    gains = {name: [abs(gain) for one in others if (gain := _gain_of(one, name)) is not None] for name in runs.names}
    interval = float(np.median([one.interval for one in others])) if others else _TYPICAL_INTERVAL_S
    outputs = [name for name in trial.group if _is_output(name)]
    unusual = any(not is_one_of(trial.factor, usual_factors(name)) for name in outputs if name != "time")
    cost = _PER_CHANNEL * len(trial.group) + _UNUSUAL * unusual
    for number in mended:
        right = runs.windows[number].divided(factors)
        evidence = [one.evidence(right, faint=True) for one in runs.relations if isinstance(one, Alike)]
        odd = sum(_log_ratio(one.ratio, 1.0) for one in evidence if np.isfinite(one.ratio))
        odd += _log_ratio(right.interval, interval) + _IMPLAUSIBLE * _log_ratio(right.interval, _TYPICAL_INTERVAL_S)
        for name in runs.names:
            odd += _IMPLAUSIBLE * _oddness(right, name)
            if gains[name] and (own := _gain_of(right, name)) is not None:
                odd += _log_ratio(own, float(np.median(gains[name])))
        cost += odd / len(mended)
    return cost


def _log_ratio(one: float, other: float) -> float:
    """Returns the absolute logarithm of the ratio of two sizes, at most 6."""
    return min(abs(log(abs(one) / abs(other))), _WORST)


def _gain_of(windows: Windows, name: str, *, surely: float = 0.0) -> float | None:
    """Returns a channel's motion per drive, by least squares.

    Returns None if motion or drive is unknown or zero, or if their correlation is below `surely`.
    """
    motion, drive = windows.of(name), windows.of(f"drive_{driven_by(name)}")
    known = np.isfinite(motion) & np.isfinite(drive)
    motion, drive = motion[known], drive[known]
    common, power, moved = float(motion @ drive), float(drive @ drive), float(motion @ motion)
    if common == 0.0 or abs(common) < surely * float(np.sqrt(power * moved)):
        return None
    return common / power


def _oddness(windows: Windows, name: str) -> float:
    """Returns the absolute log ratio of a channel's fastest motion to that of a typical small machine."""
    largest, typical = _fastest(windows, name), typical_motion(name)
    return _log_ratio(largest, typical) if typical and largest > 0.0 else 0.0


def _fastest(windows: Windows, name: str) -> float:
    """Returns the largest mean rate of all windows; 0 if no window is known."""
    return float(np.nanmax(np.abs(windows.of(name) / windows.seconds), initial=0.0))


def _turned(windows: Mapping[int, Windows], names: Iterable[str], geometry: Geometry) -> dict[tuple[str, str], float]:
    """Returns (yaw channel, kind of wheel channel) -> median over the runs of yaw / (left - right wheel).

    Pairs for which the data set states the geometry have no entry. An implausible value is divided by the first factor
    between units that makes the value plausible. Then the relation is broken in all runs, and the search finds the
    fault. The fastest turns are left out, because a gyro at the end of its range would bias the estimate.
    """
    found: dict[tuple[str, str], float] = {}
    for kind in WHEEL_KINDS:
        left, right = f"wheel_{kind}_left", f"wheel_{kind}_right"
        for yaw in {"yaw_rate", "yaw_angle"} & set(names):
            if not {left, right} <= set(names) or geometry.turn(yaw, kind) is not None:
                continue
            limits = _TURN_PER_METRE if geometry.metres(kind) == 1.0 else _TURN_PER_RADIAN
            per = float(np.sqrt(limits[0] * limits[1]))
            fastest = max((_fastest(one, yaw) for one in windows.values()), default=0.0)
            for below in (_UNSATURATED * fastest, np.inf):  # if no slower turn is usable, all turns are used
                each = [_turn_ratio(one, yaw, one.of(left) - one.of(right), per, below) for one in windows.values()]
                if ratios := [ratio for ratio in each if ratio is not None]:
                    found[yaw, kind] = _plausible(float(np.median(ratios)), limits)
                    break
    return found


def _turn_ratio(windows: Windows, yaw: str, apart: Vector, per: float, below: float) -> float | None:
    """Returns yaw / `apart` (left - right wheel) from windows that turn slower than `below` rad/s; None: too few."""
    turn = windows.of(yaw)
    slow = np.isfinite(apart) & (np.abs(turn) < below * windows.seconds)
    turn, apart = (np.where(slow, values, np.nan) for values in (turn, apart))
    ratio = ratio_of(turn, apart)
    return None if ratio is None or max(windows.rms(turn), windows.rms(per * apart)) < _TURNS else abs(ratio)


def _plausible(ratio: float, limits: tuple[float, float]) -> float:
    if limits[0] <= ratio <= limits[1]:
        return ratio
    listed = [one for factor in FACTORS for one in (factor, 1 / factor)]
    return next((ratio / one for one in listed if limits[0] <= ratio / one <= limits[1]), ratio)


def _against_other_runs(runs: RunSet) -> list[Contradiction]:
    """Returns channels whose gain (motion per drive) differs from the other runs' gain by the factor of a unit.

    A sticking wheel may make the gain too small. If another channel confirms the gain, the machine may have changed.
    In both cases the channel counts as wrong only if its noise has changed by the same factor.
    """
    found: list[Contradiction] = []
    large = [one for factor in FACTORS if factor > _LARGE for one in (factor, 1 / factor)]
    for name in runs.names:
        which = driven_by(name)
        gains = {
            number: abs(gain)
            for number, one in runs.windows.items()
            if which in runs.least and one.rms(one.of(f"drive_{which}")) >= runs.least[which]
            if (gain := _gain_of(one, name, surely=_WITH_DRIVE)) is not None
        }
        odd: dict[int, float] = {}
        for number, factor in _beside_others(gains, large, _GAINS_FIT).items():
            others = [k for k in gains if k != number]
            usual_gain = float(np.median([gains[k] for k in others]))
            # If the other gains disagree, no comparison with their median is possible.
            if np.mean([_log_ratio(gains[k], usual_gain) < log(_GAINS_ALIKE) for k in others]) <= 0.5:
                continue
            own, rough = runs.windows[number].roughness[name], [runs.windows[k].roughness[name] for k in others]
            usual = float(np.median([one for one in rough if one > 0.0] or [np.inf]))
            if _is_near(own / usual, factor, _NOISE_FIT) or (factor > 1.0 and not _is_confirmed(runs, number, name)):
                odd[number] = factor
        if len(odd) == len(gains) == 2:  # two runs contradict each other: the run with the more unusual motion is wrong
            odd = dict([max(odd.items(), key=lambda one: _oddness(runs.windows[one[0]], name))])
        found += [Contradiction((name,), factor, (number,), ()) for number, factor in odd.items()]
    return found


def _is_confirmed(runs: RunSet, number: int, name: str) -> bool:
    """Whether another channel of the run agrees with channel `name`."""
    return any(
        evidence.state is State.HOLDS and any(name in group for group in (*relation.over, *relation.under))
        for relation, evidence in zip(runs.relations, runs.evidence[number], strict=True)
        if isinstance(relation, Alike)
    )


def _wrong_batteries(views: Sequence[RunView], nominal: float | None) -> list[Contradiction]:
    """Returns runs whose battery voltage is negative, or 100 or 1000 times too large or too small.

    The voltage is compared with the stated voltage, with the other runs, or with a typical battery's voltage.
    """
    name = "battery_voltage"
    known = {k: one.outputs[name] for k, one in enumerate(views) if np.isfinite(one.outputs.get(name, ())).any()}
    levels = {k: float(np.nanmedian(values)) for k, values in known.items()}
    odd: dict[float, list[int]] = {}
    for number, level in levels.items():
        others = [other for k, other in levels.items() if k != number]
        usual = float(np.median(others)) if len(others) > 1 else _TYPICAL_BATTERY
        usual = nominal if nominal is not None else usual if usual < _HIGHEST_BATTERY else _TYPICAL_BATTERY
        ratio = level / max(usual, 1e-9)
        factor = next((one for one in (1e3, 1e-3, 1e2, 1e-2) if _is_near(abs(ratio), one, 3.0)), None)
        factor = -1.0 if level < 0.0 else factor
        if usual > 0.0 and factor is not None:
            odd.setdefault(factor, []).append(number)
    return [Contradiction((name,), factor, tuple(runs), ()) for factor, runs in odd.items()]
