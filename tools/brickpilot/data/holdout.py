"""Chooses fit runs and held-out runs if the data set does not state roles, and limits the number of fit runs.

Also finds runs that repeat each other.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.signals import Array

# Share of an input's mean size: if the sd of the size is larger, the input is a ramp or a sweep, not a step.
_STEP_SPREAD = 0.2
# The sum and the difference of two motors' inputs are compared. If the ratio of the smaller to the larger is below this
# limit, the run is straight or a turn on the spot.
_PURE = 0.25
# Largest ratio of two runs' rms inputs: if the ratio is larger, the smaller run is not held out.
_AS_LARGE = 1.5
# Share of a run's input: if less of the input is in one direction, the run belongs to the other direction.
_ONE_WAY = 0.1
# In s: a shorter stretch is not held out, because it tests a free run poorly.
_SHORTEST_S = 0.3
# Least shares of the input's energy (its square, integrated over time): of the fit in total, of the fit in each
# direction, and of the held-out part.
_KEPT, _KEPT_OF_DIRECTION, _LEAST_END = 0.75, 0.5, 0.1

# Two runs repeat each other if their inputs differ by at most `_SAME_SHARE` of their rms, for at least `_REPEAT_S` s
# and `_REPEAT_SHARE` of the shorter run. `_GRID_S` is the step in s of the grid on which the inputs are compared.
_SAME_SHARE, _REPEAT_S, _REPEAT_SHARE, _GRID_S = 0.05, 0.5, 0.5, 0.02

_GIVEN = {
    frozenset({"fit"}): "The data set holds no run out.",
    frozenset({"held_out"}): "The data set holds every run out.",
    frozenset({"fit", "held_out"}): "The data set states which runs are held out.",
}


@dataclass(frozen=True)
class Roles:
    """The role of each run, and how it was chosen.

    Attributes:
        by_run: run -> "fit" or "held_out".
        note: a sentence that says who chose the roles and how.
        stretches: fit run -> first and last time of its held-out samples, in s on the run's clock.
    """

    by_run: Mapping[str, str]
    note: str
    stretches: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def fit(self) -> list[str]:
        return [name for name, role in self.by_run.items() if role == "fit"]

    def held_out(self) -> list[str]:
        return [name for name, role in self.by_run.items() if role == "held_out"]

    def tested(self) -> list[str]:
        """Returns the runs that are held out as a whole or have a held-out stretch."""
        return [name for name, role in self.by_run.items() if role == "held_out" or name in self.stretches]

    def samples(self, run: Run, role: str, name: str = "") -> Run:
        """Returns the run with blank outputs at all samples that do not have the role `role`.

        `name`: the name of the run from which `run` was cut, if any.
        """
        stretch = self.stretches.get(name or run.name)
        if stretch is None:
            return run
        inside = (run.time >= stretch[0]) & (run.time <= stretch[1])
        other = ~inside if role == "held_out" else inside
        return replace(run, outputs={signal: np.where(other, np.nan, values) for signal, values in run.outputs.items()})


def assign(dataset: Dataset, inputs: Mapping[str, Array], *, stretches: bool = False) -> Roles:
    """Returns the role of every run. `inputs`: run -> the inputs of its motors, (n, 1) or (n, 2).

    If the file names held-out runs, its other runs are fitted. Otherwise runs without a role are grouped by manoeuvre
    (straight, turn on the spot or curve; step or ramp) and direction (forward or backward; right or left). Without data
    in both directions a fit cannot separate friction and asymmetry. So some runs of each group stay in the fit, among
    them the run with the largest input; see `_held_out_of`. Replicates are held out. The same data set always gives the
    same roles.

    Args:
        stretches: whether the last part of a run whose manoeuvre occurs only once may be held out; see `_last_drive`.
    """
    given = {run.name: run.role for run in dataset.runs if run.role is not None}
    if len(given) == len(dataset.runs):
        return Roles(given, _GIVEN[frozenset(given.values())])
    if "held_out" in given.values():
        chosen = {run.name: run.role or "fit" for run in dataset.runs}
        return Roles(chosen, "The data set states which runs are held out; its other runs are fitted.")
    open_runs = [run for run in dataset.runs if run.role is None]
    groups = _by_manoeuvre([run for run in open_runs if run.replicate_of is None], inputs)
    out = {run.name for run in open_runs if run.replicate_of is not None}.union(*map(_held_out_of, groups))
    alone = {run.name for group in groups if not _held_out_of(group) for _, run in group}
    ends: dict[str, tuple[float, float]] = {}
    for run in open_runs:
        if stretches and run.name in alone and (last := _last_drive(run, np.nan_to_num(inputs[run.name]))):
            ends[run.name] = last
    chosen = {run.name: run.role or ("held_out" if run.name in out else "fit") for run in dataset.runs}
    return Roles(chosen, _note([name for name in chosen if name in out], list(ends)), ends)


def _note(out: Sequence[str], stretches: Sequence[str]) -> str:
    """Returns a sentence that names the runs that the program held out."""
    if not out and not stretches:
        return "No run is held out: the data set names none, and each manoeuvre occurs once in a direction."
    parts = []
    if out:
        parts.append(f"{', '.join(out)} (of 2 or 3 similar runs at most one, and never that with the largest input)")
    if stretches:
        parts.append(f"the last part of the drive in {', '.join(stretches)} (a manoeuvre that occurs once)")
    return f"The program held out {' and '.join(parts)}."


Group = list[tuple[float, Run]]
"""The runs of one manoeuvre and direction, each with the rms of its input."""


def _by_manoeuvre(runs: Sequence[Run], inputs: Mapping[str, Array]) -> list[Group]:
    groups: dict[str, Group] = defaultdict(list)
    for run in runs:
        driven = np.nan_to_num(inputs[run.name])
        groups[manoeuvre(driven)].append((float(np.sqrt(np.mean(driven**2))), run))
    return list(groups.values())


def _held_out_of(group: Group) -> list[str]:
    """Returns a group's held-out runs: of three runs, the middle run; of more, every third run, never the largest.

    The runs are ordered by the rms of their inputs. Of two runs, the run with the smaller input is held out. If its
    input is much smaller, no run is held out, because only this run shows the static friction.
    """
    ordered = sorted((size, run.name) for size, run in group)
    if len(ordered) == 2:
        (smaller, name), (larger, _) = ordered
        return [name] if larger < _AS_LARGE * smaller else []
    return [name for _, name in ordered[1:-1:3]]


def kind_of(driven: Array) -> str:
    """Returns the kind of motion that inputs (n, 1) or (n, 2) drive: rest, drive (a motor), straight, spin, curve."""
    moving = _moving(driven)
    if len(moving) == 0:
        return "rest"
    if driven.shape[1] == 1:
        return "drive"
    common, difference = np.abs(moving.sum(axis=1)).mean(), np.abs(moving[:, 0] - moving[:, 1]).mean()
    if min(common, difference) > _PURE * max(common, difference):
        return "curve"
    return "straight" if common > difference else "spin"


def turning_share(driven: Array) -> float:
    """Returns the share, 0..1, of the driven rows of inputs (n, 2) that turn the robot; 0: no row is driven."""
    moving = _moving(driven)
    common, difference = np.abs(moving.sum(axis=1)), np.abs(moving[:, 0] - moving[:, 1])
    return float(np.mean(difference > _PURE * common)) if len(moving) else 0.0


def manoeuvre(driven: Array) -> str:
    """Returns the kind, shape and direction of a run, such as "straight step forward", from inputs as in `kind_of`."""
    moving, kind = _moving(driven), kind_of(driven)
    if kind == "rest":
        return kind
    size = np.abs(moving).max(axis=1)
    shape = "step" if size.std() < _STEP_SPREAD * size.mean() else "ramp"
    if kind == "drive":
        return f"{shape} {_direction(moving[:, 0], 'forward', 'backward')}"
    ahead, apart = moving.sum(axis=1), moving[:, 0] - moving[:, 1]
    along, around = _direction(ahead, "forward", "backward"), _direction(apart, "right", "left")
    if kind == "curve":
        return f"curve {shape} {along}, {_direction(ahead * apart, 'left', 'right')} wheel faster"
    return f"{kind} {shape} {along if kind == 'straight' else around}"


def _moving(driven: Array) -> Array:
    """Returns the rows of the inputs in which a motor is driven."""
    size = np.abs(driven).max(axis=1, initial=0.0)
    return np.asarray(driven[size > 0.05 * max(float(size.max(initial=0.0)), 1e-12)])


def _direction(values: Array, positive: str, negative: str) -> str:
    share = float(np.sum(values[values > 0])) / float(np.sum(np.abs(values)) or 1.0)
    return positive if share > 1 - _ONE_WAY else negative if share < _ONE_WAY else "both ways"


def _last_drive(run: Run, driven: Array) -> tuple[float, float] | None:
    """Returns start and end of a run's held-out samples, in s on the run's clock; None: no sample is held out.

    The fit keeps at least three quarters of the input's energy, and half of the energy in each direction. So the
    fit sees every part of the manoeuvre, and nearly the largest input of a ramp. It also sees the stop after the drive.
    """
    ahead, apart = driven.sum(axis=1), driven[:, 0] - driven[:, -1]
    steps = np.gradient(run.time)
    energy = np.sum(driven**2, axis=1) * steps
    ways = [np.where(sign * values > 0, values**2, 0.0) * steps for values in (ahead, apart) for sign in (1, -1)]
    total = float(energy.sum())
    kept = [(energy, _KEPT)] + [(way, _KEPT_OF_DIRECTION) for way in ways if way.sum() > _ONE_WAY * total]
    start = 1 + max(int(np.searchsorted(np.cumsum(way), share * float(way.sum()))) for way, share in kept)
    if start >= len(energy) or energy[start:].sum() < _LEAST_END * total:
        return None
    last = int(np.flatnonzero(energy)[-1])
    if run.time[last] - run.time[start] < _SHORTEST_S:
        return None
    return float(run.time[start]), float(run.time[last])


MANY, ENOUGH = 100_000, 30_000
"""If the fit runs have more than `MANY` samples, only some of the runs are fitted, with at least `ENOUGH` samples in
total. With so many samples, the model's error limits the accuracy of a fitted value. For example, twelve runs of 10 s
at 500 Hz are all fitted."""


def enough_to_fit(dataset: Dataset) -> tuple[Dataset, str | None]:
    """Returns a data set of some fit runs, and a note. With at most `MANY` fit samples: the whole data set, and None.

    Runs are chosen from all groups (manoeuvre and direction) in turn: first the run with the largest input, then the
    other runs, evenly over the file's order. The pause before a run grows by the duration of the runs left out, so that
    the run's time since power-on stays the same.
    """
    inputs = {run.name: motor_inputs(run, dataset) for run in dataset.runs}
    fitted = set(assign(dataset, inputs, stretches=True).fit())
    runs = [run for run in dataset.runs if run.name in fitted]
    if sum(len(run.time) for run in runs) <= MANY:
        return dataset, None
    chosen, samples = set[str](), 0
    queues = [_in_turn(group) for group in _by_manoeuvre(runs, inputs)]
    while samples < ENOUGH:
        for queue in queues:
            if queue:
                run = queue.pop(0)
                chosen.add(run.name)
                samples += len(run.time)
    note = (
        f"The nominal values are fitted to {len(chosen)} of {len(runs)} fit runs, {samples} samples: "
        "more samples would hardly improve them."
    )
    return replace(dataset, runs=_kept(dataset, chosen)), note


def _in_turn(group: Group) -> list[Run]:
    """Returns a group's runs in the order of choice: the run with the largest input, then the others.

    The others are in bit-reversed order, so that the first few are always spread evenly over the file's order.
    """
    largest = max(range(len(group)), key=lambda index: group[index][0])
    others = [run for index, (_, run) in enumerate(group) if index != largest]
    bits = max(len(others) - 1, 1).bit_length()
    order = sorted(range(len(others)), key=lambda index: int(f"{index:0{bits}b}"[::-1], 2))
    return [group[largest][1], *(others[index] for index in order)]


def _kept(dataset: Dataset, chosen: set[str]) -> tuple[Run, ...]:
    """Returns the chosen runs with the role "fit"; the time from power-on to each run does not change."""
    kept, left_out = [], 0.0
    for run in dataset.runs:
        if run.name in chosen:
            kept.append(replace(run, role="fit", gap_s=run.gap_s + left_out, replicate_of=None))
            left_out = 0.0
        else:
            left_out += run.gap_s + float(run.time[-1] - run.time[0])
    return tuple(kept)


def repeats(dataset: Dataset) -> tuple[tuple[str, str, float], ...]:
    """Returns (run, run, s): pairs whose inputs are equal for the first s seconds, also if not stated as replicates."""
    inputs = {run.name: motor_inputs(run, dataset) for run in dataset.runs}
    pairs = []
    for first, second in combinations(dataset.runs, 2):
        shorter = min(float(run.time[-1] - run.time[0]) for run in (first, second))
        seconds = _same_for(first, second, inputs, np.arange(0.0, shorter, _GRID_S))
        if seconds >= max(_REPEAT_S, _REPEAT_SHARE * shorter):
            pairs.append((first.name, second.name, seconds))
    return tuple(pairs)


def _same_for(first: Run, second: Run, inputs: Mapping[str, Array], grid: Array) -> float:
    """Returns for how many s from the start two runs have the same inputs, compared at the times `grid` in s."""
    rows = (np.searchsorted(run.time - run.time[0], grid + 1e-9, side="right") - 1 for run in (first, second))
    of_first, of_second = (inputs[run.name][held] for run, held in zip((first, second), rows, strict=True))
    if not np.array_equal(np.isnan(of_first), np.isnan(of_second)):
        return 0.0
    apart = np.cumsum(np.nansum((of_first - of_second) ** 2, axis=1))
    size = np.cumsum(np.nansum(of_first**2 + of_second**2, axis=1) / 2)
    same = np.flatnonzero((apart <= _SAME_SHARE**2 * size) & (size > 0))
    return float(grid[same[-1]]) if len(same) else 0.0
