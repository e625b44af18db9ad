"""The best predictor: the explanation with every part that makes whole runs left out better, claimed or not.

It is for those who want to predict and do not ask why. Nothing in it is a finding: parts that no evidence tells apart
stand in it side by side, and no prior odds hold them back.
"""

from __future__ import annotations

import dataclasses

from brickpilot.discover import numbers
from brickpilot.discover.deadline import COMPOSED
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search import Found, Library, Search, Tell, runs_of
from brickpilot.discover.settle import Settled, follow, whole_runs, written
from brickpilot.errors import SimulationError

_MOST_JOINED = 5

_SAYS = "A predictor: its parts are what predicts best, and none of them is claimed."


def best_predictor(prepared: Prepared, start: Explanation, tell: Tell) -> Settled:
    """Returns the best predictor that grows from an explanation, chosen on stretches of the fit runs left out."""
    data, current = prepared.coarse, start
    whole = whole_runs(prepared)
    deadline = prepared.until(COMPOSED)
    try:
        if whole is not None:
            data, current = follow(whole, start, prepared.jobs)
        for _ in range(_MOST_JOINED):
            if deadline.passed:
                break
            tell("searching for the best predictor")
            judge = Judge.of(data, prepared.seed)
            now = judge.of_explanation(current)
            found = Found(judge, now, {current.key: now})
            library = Library(prepared.excitation, runs_of(data))
            search = Search(data, current, library, prepared.excitation, prepared.jobs, deadline, tell)
            found.add(search.beside(found, now), prepared.jobs)
            best = max(found.table.values(), key=lambda one: one.total)
            if best.total - now.total < numbers.CHANCE_NATS * judge.correlation(best):
                break
            current = best.explanation
            if whole is not None:
                data, current = follow(whole, current, prepared.jobs)
    except SimulationError:
        current, data = start, prepared.coarse
    made = written(prepared, data, current, (_SAYS,))
    model = dataclasses.replace(made.model, name=f"{made.model.name}, predictor")
    return dataclasses.replace(made, model=model)
