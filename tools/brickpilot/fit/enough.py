"""Chooses some of the fit runs where there are many: their samples tell the nominal values as well as all do."""

from __future__ import annotations

import dataclasses
from collections import defaultdict

import numpy as np

from brickpilot.data import holdout
from brickpilot.data.dataset import Dataset, Run, motor_inputs

MANY, ENOUGH = 100_000, 30_000
"""Samples of fit runs above which some are chosen, and how many. The model's own error, and not the number of samples,
then limits how well a value is known. A dozen runs of 10 s at 500 Hz have 60,000, and all of them are fitted."""


def enough_to_fit(dataset: Dataset) -> tuple[Dataset, str | None]:
    """Returns a data set of some fit runs and a note; all of it and None where these have no more than `MANY` samples.

    Runs are taken in turn from each manoeuvre and direction, that of the largest input first, the others evenly over
    the file's order. Pauses grow by what is left out, so that a run is as old as before.
    """
    inputs = {run.name: motor_inputs(run, dataset) for run in dataset.runs}
    fitted = set(holdout.assign(dataset, inputs, stretches=True).fit())
    runs = [run for run in dataset.runs if run.name in fitted]
    if sum(len(run.time) for run in runs) <= MANY:
        return dataset, None
    groups: dict[str, list[tuple[float, Run]]] = defaultdict(list)
    for run in runs:
        driven = np.nan_to_num(inputs[run.name])
        groups[holdout.manoeuvre(driven)].append((float(np.sqrt(np.mean(driven**2))), run))
    chosen, samples = set[str](), 0
    queues = [_in_turn(group) for group in groups.values()]
    while samples < ENOUGH:
        for queue in queues:
            if queue:
                run = queue.pop(0)
                chosen.add(run.name)
                samples += len(run.time)
    note = (
        f"The nominal values are fitted to {len(chosen)} of {len(runs)} fit runs, {samples} samples: more tell no more."
    )
    return dataclasses.replace(dataset, runs=_kept(dataset, chosen)), note


def _in_turn(group: list[tuple[float, Run]]) -> list[Run]:
    """Returns the runs of one manoeuvre: that of the largest input, then halves, quarters and so on of the others."""
    largest = max(range(len(group)), key=lambda index: group[index][0])
    others = [run for index, (_, run) in enumerate(group) if index != largest]
    bits = max(len(others) - 1, 1).bit_length()
    order = sorted(range(len(others)), key=lambda index: int(f"{index:0{bits}b}"[::-1], 2))
    return [group[largest][1], *(others[index] for index in order)]


def _kept(dataset: Dataset, chosen: set[str]) -> tuple[Run, ...]:
    """Returns the chosen runs, stated as fit runs, each as old as before."""
    kept, left_out = [], 0.0
    for run in dataset.runs:
        if run.name in chosen:
            kept.append(dataclasses.replace(run, role="fit", gap_s=run.gap_s + left_out, replicate_of=None))
            left_out = 0.0
        else:
            left_out += run.gap_s + float(run.time[-1] - run.time[0])
    return tuple(kept)
