"""The blind test: runs discovery on data sets whose truth is known, and appends one result for each set.

A set that already has a result is not run again, so that a long benchmark can be interrupted and continued. All output
is computed only from the results (table.py).
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brickpilot import __version__
from brickpilot.campaign.run_parts import Part, PartProgress, Workers, run_parts
from brickpilot.campaign.workers import shared
from brickpilot.data import reading
from brickpilot.discover import pipeline
from brickpilot.discover.finding import verdict_json
from brickpilot.errors import SimulationError
from brickpilot.fit.descent import Progress

from lab import measured
from lab.result import RESULTS, append, held_out_gap, load, put_in_order, truth_fields, verdict_fields
from lab.sets import Maker, Task, truth_of

_FIRST = 8  # number of first sets: if none of them can be made, the test ends with an error


@dataclass(frozen=True)
class Work:
    """What to run on each set.

    Attributes:
        maker: makes sets and experiments. None: the sets exist already, and no experiment is made.
        jobs: number of jobs of each `discover`, and of the maker.
    """

    maker: Maker | None
    jobs: int


@dataclass(frozen=True)
class _Asked:
    """One set and the work on it, for a worker."""

    task: Task
    work: Work


@dataclass(frozen=True)
class _Ran:
    """The result of one set. `unmade`: the reason why the set could not be made; None: it was made."""

    result: dict[str, Any]
    unmade: str | None


def run(tasks: Sequence[Task], out: Path, *, work: Work, workers: Workers, progress: Progress) -> list[dict[str, Any]]:
    """Runs the sets that have no result or an error in OUT/results.jsonl, and returns all results.

    Each result is appended at once. At the end the results of `tasks` stand last, in the order of `tasks`.

    Args:
        workers: the workers that run the sets.
        progress: called with (sets done, all sets, text).

    Raises:
        SimulationError: none of the first sets can be made.
    """
    path = out / RESULTS
    kept = {_key(one) for one in load(path) if not one["error"]} if path.exists() else set()
    left = [task for task in tasks if task.key not in kept]
    made, unmade = 0, 0

    def keep(part: Part, ran: _Ran) -> None:
        nonlocal made, unmade
        append(path, ran.result)
        made, unmade = made + (ran.unmade is None), unmade + (ran.unmade is not None)
        if not made and unmade == min(_FIRST, len(left)):
            raise SimulationError(str(ran.unmade))

    parts = (Part("/".join(map(str, task.key)), _Asked(task, work)) for task in left)
    told = PartProgress(progress, len(tasks), len(tasks) - len(left), "sets")
    run_parts(_run_asked, parts, keep=keep, workers=workers, progress=told)
    return put_in_order(path, [task.key for task in tasks])


def _key(result: Mapping[str, Any]) -> tuple[str, str, int]:
    return result["engine"], result["name"], result["seed"]


def _run_asked(asked: _Asked) -> _Ran:
    """Makes a set if it does not exist yet, and runs discovery on it. Runs on the worker."""
    task, work, unmade = asked.task, asked.work, None
    if work.maker is not None:
        shared(work.maker.tests)
    with tempfile.TemporaryDirectory(prefix="brickpilot-lab-") as scratch:
        further = Path(scratch, "further")
        further.mkdir()
        if task.folder is not None:
            folder = shared(task.folder)
        else:
            folder = Path(scratch, "sets", task.name)
            try:
                if work.maker is not None:
                    work.maker.make([task], folder.parent, work.jobs)
            except SimulationError as error:
                unmade = str(error)
        return _Ran(run_one(task, folder, further, work.maker, work.jobs), unmade)


def run_one(task: Task, folder: Path, further: Path, maker: Maker | None, jobs: int) -> dict[str, Any]:
    """Returns the result of one set: truth, verdict, and the verdict after the next experiment.

    An exception becomes the `error` of the result, and does not end the benchmark.
    """
    result: dict[str, Any] = {
        "name": task.name,
        "engine": task.engine,
        "seed": task.seed,
        "suite": task.suite,
        "seed_offset": task.seed_offset,
        "version": __version__,
        "measured": measured.state(),
        "error": None,
    }
    try:
        truth = truth_of(folder)
        result |= truth_fields(task.name, truth)
        began, worked = time.perf_counter(), time.process_time()
        data = reading.read(folder)
        found = pipeline.discover(data, seed=0, jobs=jobs)
        result["elapsed_s"] = round(time.perf_counter() - began, 2)
        result["cpu_s"] = round(time.process_time() - worked, 2)
        result |= verdict_fields(found)
        result["held_out"] = held_out_gap(found)
        asked = verdict_json(found)["next_experiment"]
        result["asked"] = None if asked is None else {key: asked.get(key) for key in ("name", "signal", "separation")}
        if asked is not None and maker is not None:
            made = maker.follow(folder, asked, further)
            if made is not None:
                result["follow"] = verdict_fields(pipeline.discover(reading.read(made), seed=0, jobs=jobs))
    except Exception as error:
        text = " ".join(str(error).split())
        result = {
            **truth_fields(task.name, None),
            "verdict": "error",
            **result,
            "error": f"{type(error).__name__}: {text}",
        }
    return result
