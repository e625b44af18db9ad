"""The spread of a size between runs of one recording: two recordings of one state differ by this much."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from brickpilot.changed.differences import Difference
from brickpilot.changed.recordings import run_by_run
from brickpilot.data.motion import run_of
from brickpilot.discover.explanation import ROUGH, Explanation, fit
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual

Array = NDArray[np.float64]

_LEAST_DEGREES = 2  # least degrees of freedom: the number of runs, less one for each recording


def sd_between_recordings(data: Residual, best: Explanation, part: Difference, correlated: float) -> float:
    """Returns the sd of the difference of two recordings of one state, in the unit of the first value of `part`.

    Each run gets a value of its own. The scatter of these values beyond their own uncertainty is the spread between
    runs (the random effects of DerSimonian & Laird 1986, Controlled Clinical Trials 7). A recording has the mean of its
    runs. The sd is 0 if there are too few runs, or if the value has one sign only.

    Args:
        data: the residual of both recordings.
        correlated: the correlation time of the residual, in values.
    """
    key, own = part.free[0], run_by_run(data)
    info = part.rows[key]
    recordings = {run_of(run.name): run.recording for run in data.replay.dataset.runs if run.name in data.runs}
    groups: dict[str, list[str]] = {}
    for run, recording in recordings.items():
        groups.setdefault(recording, []).append(run)
    if info.minimum >= 0 or sum(len(runs) - 1 for runs in groups.values()) < _LEAST_DEGREES:
        return 0.0
    by_run = {
        kind: {run: table.get(recording, 0.0) for run, recording in recordings.items()}
        for kind, table in best.model.by_run.items()
    }
    model = dataclasses.replace(best.model, by_run=by_run)
    plan = Plan(model, tuple(Free(f"{key}@{run}", info, None, unit=info.trial) for run in recordings), ())
    problem = Problem(own, plan)
    found = fit(problem, (), plan, plan.start(), ROUGH)
    if found is None:
        return 0.0
    slopes = problem.jacobian(found.point)[: len(own.measured)]
    left = max(2 * found.cost / len(own.measured), 1.0) * correlated
    known = np.sum(slopes**2, axis=0) / left
    values = dict(zip(recordings, zip(found.point.tolist(), known.tolist(), strict=True), strict=True))
    return info.trial * spread_of([[values[run] for run in runs] for runs in groups.values()])


def spread_of(groups: list[list[tuple[float, float]]]) -> float:
    """Returns the sd of the difference of the means of two groups that are alike.

    Args:
        groups: for each recording, the value and the information (1 / variance) of each run.
    """
    excess = weight = 0.0
    for group in groups:
        values, known = (np.array(one) for one in zip(*group, strict=True))
        if len(values) > 1 and known.sum() > 0:
            mean = float(known @ values / known.sum())
            excess += float(known @ (values - mean) ** 2) - (len(values) - 1)
            weight += float(known.sum() - known @ known / known.sum())
    variance = max(excess / weight, 0.0) if weight > 0 else 0.0
    return float(np.sqrt(variance * sum(1 / len(group) for group in groups)))
