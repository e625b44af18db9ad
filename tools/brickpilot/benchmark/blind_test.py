"""The blind test of discovery: runs it on data sets whose truth is known, and appends one result for each set.

A set whose result exists already is not run again, so that a long benchmark can be interrupted and continued. What is
printed is computed from the results alone (table.py).
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

from brickpilot import __version__
from brickpilot.benchmark import sindy
from brickpilot.benchmark.result import RESULTS, append, held_out_gap, load, truth_fields, verdict_fields
from brickpilot.benchmark.sets import Maker, Task, truth_of
from brickpilot.data import dataset
from brickpilot.discover import pipeline
from brickpilot.discover.verdict_json import verdict_json
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.descent import Progress

Peer = Literal["sindy", "sindy-grid"]

_BATCH = 8  # sets that lie on the disk at a time


def run(
    tasks: Sequence[Task], out: Path, *, maker: Maker | None, jobs: int, peer: Peer | None, progress: Progress
) -> list[dict[str, Any]]:
    """Runs the sets that have no result in OUT/results.jsonl yet, or an error, and returns all results.

    Args:
        maker: makes sets and experiments. None: the sets exist already, and no experiment is made.
        jobs: number of jobs of each `discover`, and of the maker.
        progress: called with (sets done, all sets, text) before each set.

    Raises:
        InputError: the peer is not installed.
        SimulationError: no set of a batch can be made.
    """
    why = sindy.missing() if peer else None
    if why:
        raise InputError(why, field="--peer")
    path = out / RESULTS
    kept = (
        {(one["engine"], one["name"], one["seed"]) for one in load(path) if not one["error"]}
        if path.exists()
        else set()
    )
    left = [task for task in tasks if task.key not in kept]
    done = len(tasks) - len(left)
    for batch in _batches(left):
        with tempfile.TemporaryDirectory(prefix="brickpilot-benchmark-") as scratch:
            for task, folder in _ready(batch, Path(scratch), maker, jobs):
                progress(done, len(tasks), task.name)
                with tempfile.TemporaryDirectory(prefix="brickpilot-experiment-") as further:
                    append(path, run_one(task, folder, Path(further), maker, jobs, peer))
                if task.folder is None:
                    shutil.rmtree(folder, ignore_errors=True)
                done += 1
    return load(path)


def _batches(tasks: Sequence[Task]) -> Iterator[list[Task]]:
    """Yields some sets of one suite and engine at a time: the maker makes them together."""
    for _, group in groupby(tasks, key=lambda task: (task.suite, task.engine, task.seed_offset)):
        same = list(group)
        yield from (same[start : start + _BATCH] for start in range(0, len(same), _BATCH))


def _ready(batch: Sequence[Task], scratch: Path, maker: Maker | None, jobs: int) -> Iterator[tuple[Task, Path]]:
    """Yields the sets of a batch with their folders. A set that could not be made has no folder."""
    missing = [task for task in batch if task.folder is None]
    if missing and maker is not None:
        try:
            maker.make(missing, scratch, jobs)
        except SimulationError:
            if not any((scratch / task.name).is_dir() for task in missing):
                raise
    for task in batch:
        yield task, task.folder or scratch / task.name


def run_one(
    task: Task, folder: Path, further: Path, maker: Maker | None, jobs: int, peer: Peer | None
) -> dict[str, Any]:
    """Returns the result of one set: truth, verdict, and what the next experiment and the peer made of it.

    An exception becomes the `error` of the result, so that one set does not end the benchmark.
    """
    result: dict[str, Any] = {
        "name": task.name,
        "engine": task.engine,
        "seed": task.seed,
        "suite": task.suite,
        "seed_offset": task.seed_offset,
        "version": __version__,
        "error": None,
    }
    try:
        truth = truth_of(folder)
        result |= truth_fields(task.name, truth)
        began, worked = time.perf_counter(), time.process_time()
        data = dataset.read(folder)
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
                result["follow"] = verdict_fields(pipeline.discover(dataset.read(made), seed=0, jobs=jobs))
        if peer is not None:
            windows = sindy.WINDOWS_S if peer == "sindy-grid" else sindy.tuned_windows()
            result["peer"] = sindy.paths(
                data, found.nominal_model, found.simulated["nominal"], found.roles, found.noise_sd, windows
            )
    except Exception as error:
        text = " ".join(str(error).split())
        result = {
            **truth_fields(task.name, None),
            "verdict": "error",
            **result,
            "error": f"{type(error).__name__}: {text}",
        }
    return result
