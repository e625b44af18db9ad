"""Finds channels whose gain per drive is in another unit than in the other runs, although no relation shows it."""

from __future__ import annotations

from collections.abc import Iterable
from math import log

import numpy as np

from brickpilot.data.audit.blame import Contradiction
from brickpilot.data.audit.fault import FACTORS
from brickpilot.data.audit.relations import Alike, State
from brickpilot.data.audit.run_set import RunSet, drive_gain, drive_level, oddness
from brickpilot.data.audit.view import driven_by

_WITH_DRIVE = 0.8  # correlation of a motion with its drive, for it to have a gain
_LARGE = 9.0  # smallest factor that counts
_GAINS_FIT = 1.3  # how far the ratio of two gains may be from a factor
_GAINS_ALIKE = 2.0  # ratio of the gains of most other runs
_NOISE_FIT = 2.0  # how far the ratio of two noises may be from a factor


def against_other_runs(runs: RunSet) -> list[Contradiction]:
    """Returns channels that no relation contradicts, but whose gain per drive differs by a unit from other runs.

    A gain that is too small may come from a wheel that sticks; if other channels have it too, it may come from the
    machine. In both cases the channel's noise must have changed by the same factor.
    """
    found: list[Contradiction] = []
    for name in runs.names:
        which = driven_by(name)
        gains = {
            number: abs(gain)
            for number, one in runs.windows.items()
            if which in runs.least and drive_level(one, which) >= runs.least[which]
            if (gain := drive_gain(one, name, surely=_WITH_DRIVE)) is not None
        }
        odd: dict[int, float] = {}
        for number, gain in gains.items():
            others = [k for k in gains if k != number]
            if not others:
                continue
            ratios = gain / np.array([gains[k] for k in others])
            ratio = float(np.median(ratios))
            factor = next((one for one in _large_factors() if 1 / _GAINS_FIT < ratio / one < _GAINS_FIT), None)
            # The median of two different gains is like neither of them.
            if factor is None or np.mean(np.abs(np.log(ratios / ratio)) < log(_GAINS_ALIKE)) <= 0.5:
                continue
            noisy = _is_as_noisy(runs, number, others, name, factor)
            if noisy or (factor > 1.0 and not _is_confirmed(runs, number, name)):
                odd[number] = factor
        if len(odd) == len(gains) == 2:  # they contradict each other: the more unusual one is wrong
            odd = dict([max(odd.items(), key=lambda one: oddness(runs.windows[one[0]], name))])
        found += [Contradiction((name,), factor, (number,), ()) for number, factor in odd.items()]
    return found


def _large_factors() -> list[float]:
    return [one for factor in FACTORS if factor > _LARGE for one in (factor, 1 / factor)]


def _is_confirmed(runs: RunSet, number: int, name: str) -> bool:
    """Whether another channel of the run agrees with this one."""
    return any(
        evidence.state is State.HOLDS and any(name in group for group in (*relation.over, *relation.under))
        for relation, evidence in zip(runs.relations, runs.evidence[number], strict=True)
        if isinstance(relation, Alike)
    )


def _is_as_noisy(runs: RunSet, number: int, others: Iterable[int], name: str, factor: float) -> bool:
    own = runs.roughness[number][name]
    usual = [rough for k in others if (rough := runs.roughness[k][name]) > 0.0]
    return bool(own > 0.0 and usual and 1 / _NOISE_FIT < own / (factor * float(np.median(usual))) < _NOISE_FIT)
