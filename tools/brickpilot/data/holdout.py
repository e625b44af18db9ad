"""Chooses fit runs and held-out runs where the data set does not state them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run

# An input whose spread exceeds this share of its size is a ramp or a sweep, not a step.
_STEP_SPREAD = 0.2
# With the smaller of sum and difference of two motors' inputs below this share of the larger, a run is straight or a
# turn on the spot.
_PURE = 0.3

_GIVEN = {
    frozenset({"fit"}): "The data set holds no run out.",
    frozenset({"held_out"}): "The data set holds every run out.",
    frozenset({"fit", "held_out"}): "The data set states which runs are held out.",
}


@dataclass(frozen=True)
class Roles:
    """The role of each run, "fit" or "held_out", and one sentence on who chose it and how."""

    by_run: Mapping[str, str]
    note: str

    def fit(self) -> list[str]:
        return [name for name, role in self.by_run.items() if role == "fit"]

    def held_out(self) -> list[str]:
        return [name for name, role in self.by_run.items() if role == "held_out"]


def assign(dataset: Dataset, inputs: Mapping[str, NDArray[np.float64]]) -> Roles:
    """Returns the role of every run. `inputs` are the motor inputs by run name, (n, 1) or (n, 2).

    If the file holds a run out, its other runs are fitted. Otherwise runs without a role are grouped by manoeuvre:
    straight, turn on the spot or curve, each as step or ramp; forward and backward are the same. Each group is ordered
    by the size of the input, and the second of every three runs is held out. Replicates are always held out. The same
    data set always gives the same roles.
    """
    given = {run.name: run.role for run in dataset.runs if run.role is not None}
    if len(given) == len(dataset.runs):
        return Roles(given, _GIVEN[frozenset(given.values())])
    if "held_out" in given.values():
        chosen = {run.name: run.role or "fit" for run in dataset.runs}
        return Roles(chosen, "The data set states which runs are held out; its other runs are fitted.")
    open_runs = [run for run in dataset.runs if run.role is None]
    out = _choose(open_runs, inputs)
    chosen = {run.name: run.role or ("held_out" if run.name in out else "fit") for run in dataset.runs}
    if not out:
        return Roles(chosen, "No run is held out: the data set names none, and each manoeuvre occurs once.")
    return Roles(
        chosen, f"The program held out {', '.join(n for n in chosen if n in out)}: one of three of each manoeuvre."
    )


def _choose(runs: list[Run], inputs: Mapping[str, NDArray[np.float64]]) -> set[str]:
    out = {run.name for run in runs if run.replicate_of is not None}
    groups: dict[str, list[tuple[float, str]]] = defaultdict(list)
    for run in runs:
        if run.name not in out:
            driven = np.nan_to_num(inputs[run.name])
            groups[_manoeuvre(driven)].append((float(np.sqrt(np.mean(driven**2))), run.name))
    for group in groups.values():
        out.update(name for _, name in sorted(group)[1::3])
    return out


def _manoeuvre(driven: NDArray[np.float64]) -> str:
    size = np.abs(driven).max(axis=1)
    moving = driven[size > 0.05 * max(float(size.max()), 1e-12)]
    if len(moving) == 0:
        return "rest"
    size = np.abs(moving).max(axis=1)
    shape = "step" if size.std() < _STEP_SPREAD * size.mean() else "ramp"
    if driven.shape[1] == 1:
        return shape
    common, difference = np.abs(moving.sum(axis=1)).mean(), np.abs(moving[:, 0] - moving[:, 1]).mean()
    if min(common, difference) > _PURE * max(common, difference):
        return f"curve {shape}"
    return f"{'straight' if common > difference else 'spin'} {shape}"
