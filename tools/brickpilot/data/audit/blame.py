"""Finds which channels are at fault where relations are broken.

Each channel of a broken relation is tried with a corrected factor, in one run or in all. The trial that repairs most
relations and breaks none is taken. If two repair equally many, the gain per drive in the other runs decides, and then
the values that are usual for a small machine.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log

import numpy as np

from brickpilot.data.audit.fault import is_clock_factor, is_unit_factor, is_usual
from brickpilot.data.audit.relations import Alike, Driven, Group, State
from brickpilot.data.audit.run_set import (
    TYPICAL_INTERVAL_S,
    RunSet,
    drive_gain,
    is_output,
    log_ratio,
    oddness,
    usual_gain,
)

# Costs of a trial, in logarithms of a ratio.
_PER_CHANNEL = 0.01  # for each channel blamed; decides only where all else is equal
_PER_DRIVE = 0.1  # for a drive blamed alone
_IMPLAUSIBLE = 0.25  # weight of the values of a typical small machine, relative to those of the channels
_UNUSUAL = 0.3  # for a factor by which the channel's own unit is seldom mistaken
_AGAINST_DRIVE = 1.0  # for a channel that goes against its drive, however weakly
_LIKELIER_IN_ALL = 0.5  # gained if one mistake in all runs explains as much as one in some runs
_LIKELIER = 2.0  # logarithm: how much likelier a mistake in a whole column is than in one run of it


@dataclass(frozen=True)
class Contradiction:
    """Whole channels that are wrong.

    Attributes:
        names: the channels, "time", or drives ("drive_left").
        factor: stated over true value.
        runs: numbers of the runs in which they are wrong.
        against: the channels or drives that contradict them; empty: the other runs contradict them.
    """

    names: Group
    factor: float
    runs: tuple[int, ...]
    against: Group


@dataclass(frozen=True)
class Trial:
    """A group of channels that may be wrong by a factor."""

    group: Group
    factor: float

    @property
    def is_plausible(self) -> bool:
        """Whether a mistaken unit explains the factor."""
        return is_clock_factor(self.factor) if self.group == ("time",) else is_unit_factor(self.factor)

    def factors(self) -> dict[str, float]:
        return dict.fromkeys(self.group, self.factor)


def most_likely(runs: RunSet) -> Contradiction | None:
    """Returns the trial that repairs most relations and breaks none in its runs; of two, the cheaper one."""
    scored: list[tuple[int, float, Trial, tuple[int, ...]]] = []
    for trial in _trials(runs):
        gains = {number: _gain(runs, number, trial) for number in runs.windows}
        mended = tuple(number for number, gain in gains.items() if gain > 0)
        if not mended:
            continue
        breaks_none = all(gain >= 0 for gain in gains.values())
        scope = _as_noisy(runs, trial, mended) if breaks_none else mended
        score = sum(gains[number] for number in mended) - len(mended) * _is_one_drive(trial)
        scored.append((score, -_cost(runs, trial, mended, in_all=breaks_none), trial, scope))
    if not scored:
        return None
    _, _, trial, scope = max(scored, key=lambda one: one[:2])
    return Contradiction(trial.group, trial.factor, scope, _against(runs, trial, scope))


def _is_one_drive(trial: Trial) -> bool:
    """Whether the trial blames one drive alone, which is the least likely fault."""
    return len(trial.group) == 1 and not is_output(trial.group[0])


def _trials(runs: RunSet) -> list[Trial]:
    trials: dict[Trial, None] = {}
    for each in runs.evidence.values():
        for relation, evidence in zip(runs.relations, each, strict=True):
            for factor in evidence.factors:
                for group in relation.over:
                    trials[Trial(group, factor)] = None
                for group in relation.under:
                    trials[Trial(group, 1 / factor)] = None
    return [one for one in trials if one.is_plausible]


def _gain(runs: RunSet, number: int, trial: Trial) -> int:
    """Returns how many relations of a run a trial repairs, minus the broken ones; positive only if it repairs one."""
    windows = runs.windows[number].divided(trial.factors())
    mends, gain = False, 0
    for relation, before in zip(runs.relations, runs.evidence[number], strict=True):
        after = relation.evidence(windows, faint=before.state is State.BROKEN)
        mends |= before.state is State.BROKEN and after.state is State.HOLDS
        gain += after.state - before.state
    return gain if mends or gain < 0 else 0


def _as_noisy(runs: RunSet, trial: Trial, mended: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the runs that may have the same fault: all whose noise does not exclude it.

    A channel in another unit has other noise than in the corrected run.
    """
    if abs(trial.factor) == 1.0 or trial.group == ("time",) or len(mended) > 1:
        return tuple(runs.windows)
    found: list[int] = []
    for number in runs.windows:
        shown, own = runs.roughness[mended[0]], runs.roughness[number]
        known = [log(own[name] / shown[name]) for name in trial.group if own.get(name, 0) and shown.get(name, 0)]
        if all(abs(ratio) < abs(ratio + log(abs(trial.factor))) + _LIKELIER for ratio in known):
            found.append(number)
    return tuple(sorted({*found, *mended}))


def _against(runs: RunSet, trial: Trial, scope: Iterable[int]) -> Group:
    """Returns the channels or drives that contradict the trial."""
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

    Their channels are compared with each other, with the other runs, and with a typical small machine.
    `in_all`: the other runs may have the same fault, and are corrected too.
    """
    factors = trial.factors()
    others = [one.divided(factors) if in_all else one for k, one in runs.windows.items() if k not in mended]
    usual = {name: gain for name in runs.names if (gain := usual_gain(others, name)) is not None}
    interval = float(np.median([one.interval for one in others])) if others else TYPICAL_INTERVAL_S
    unusual = any(not is_usual(name, trial.factor) for name in trial.group if is_output(name) and name != "time")
    cost = _PER_DRIVE if _is_one_drive(trial) else _PER_CHANNEL * sum(map(is_output, trial.group))
    cost += _UNUSUAL * unusual - _LIKELIER_IN_ALL * in_all
    for number in mended:
        right = runs.windows[number].divided(factors)
        evidence = [one.evidence(right, faint=True) for one in runs.relations if isinstance(one, Alike)]
        odd = sum(log_ratio(one.ratio, 1.0) for one in evidence if np.isfinite(one.ratio))
        odd += log_ratio(right.interval, interval) + _IMPLAUSIBLE * log_ratio(right.interval, TYPICAL_INTERVAL_S)
        for name in runs.names:
            own = drive_gain(right, name)
            odd += _IMPLAUSIBLE * oddness(right, name)
            odd += _AGAINST_DRIVE if own is not None and own < 0.0 else 0.0
            odd += log_ratio(own, usual[name]) if own is not None and name in usual else 0.0
        cost += odd / len(mended)
    return cost
