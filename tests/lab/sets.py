"""The data sets of the blind test: `tests/hidden` makes them, or they exist already."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from brickpilot.errors import InputError, SimulationError

SUITES = ("single", "pairs", "triples", "none", "odd")
QUICK = ("same", "other", "outside", "nulls", "nominal", "scales")
REPORT = 1_000_000
"""Seed offset of reported results. Thresholds are set with offset 0."""

Engine = Literal["mujoco", "planar"]


@dataclass(frozen=True)
class Task:
    """One set to run.

    Attributes:
        seed: the seed of the set's noise.
        folder: the folder of an existing set; None: the set has to be made.
    """

    name: str
    engine: str
    seed: int
    suite: str | None = None
    seed_offset: int | None = None
    folder: Path | None = None

    @property
    def key(self) -> tuple[str, str, int]:
        return self.engine, self.name, self.seed


class Maker:
    """Runs `tests/hidden` in separate processes, because `tests/hidden` must share nothing with the tested program."""

    tests = Path(__file__).parents[1]

    def tasks(self, suite: str, engine: Engine, seed_offset: int) -> list[Task]:
        """Returns the sets of a suite, in order."""
        listed = self._run("hidden.benchmark", "list", suite, "--engine", engine, "--seed-offset", str(seed_offset))
        entries = [json.loads(line) for line in listed.splitlines()]
        return [Task(entry["name"], engine, entry["seed"], suite, seed_offset) for entry in entries]

    def make(self, tasks: Sequence[Task], out: Path, jobs: int) -> None:
        """Writes the sets of one suite and engine to OUT."""
        first = tasks[0]
        chosen = [argument for task in tasks for argument in ("--only", task.name)]
        options = ["--seed-offset", str(first.seed_offset), "--engine", first.engine, "--jobs", str(jobs)]
        self._run("hidden", str(first.suite), str(out), *options, *chosen)

    def follow(self, folder: Path, asked: Mapping[str, Any], out: Path) -> Path | None:
        """Makes the experiment that a verdict proposes; returns its data set, or None if the engine cannot make it."""
        if asked.get("name") is not None:
            table = out / "manoeuvre.json"
            table.parent.mkdir(parents=True, exist_ok=True)
            table.write_text(json.dumps(asked))
            self._run("hidden.benchmark", "add", str(folder), str(out), "--manoeuvre", str(table))
            return out / folder.name
        wanted = str(asked.get("signal"))
        if wanted.startswith(("wheel_speed", "wheel_angle")) and truth_of(folder)["recipe"]["sensors"] == "imu":
            self._run("hidden.benchmark", "add", str(folder), str(out), "--wheel-speeds")
            return out / folder.name
        return None

    def _run(self, module: str, *arguments: str) -> str:
        """Returns the stdout of ``python -m MODULE ARGUMENTS``.

        Raises:
            SimulationError: the module failed; the message contains the last line of its stderr.
        """
        path = os.pathsep.join(filter(None, [str(self.tests), os.environ.get("PYTHONPATH")]))
        environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments], capture_output=True, text=True, env=environment, check=False
        )
        if done.returncode:
            said = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise SimulationError(f"{module} {arguments[0]} failed: {said}")
        return done.stdout


def planned(
    maker: Maker, suite: str, engine: str, seed_offset: int, only: Sequence[str], limit: int | None
) -> list[Task]:
    """Returns at most `limit` sets of each suite and engine, among the sets whose names match `only`.

    Args:
        suite: one of `SUITES` or `QUICK`, "ci", "all" for all of `SUITES`, or "quick" for all of `QUICK`.
        engine: "mujoco", "planar" or "both".

    Raises:
        InputError: nothing matches, or the library of the engine is not installed.
    """
    engines: tuple[Engine, ...] = ("mujoco", "planar") if engine == "both" else (engine,)  # type: ignore[assignment]
    if "mujoco" in engines and find_spec("mujoco") is None:
        raise InputError(
            "needs the package mujoco: pip install mujoco, or use --engine planar", field="--engine mujoco"
        )
    tasks = []
    for one in {"all": SUITES, "quick": QUICK}.get(suite, (suite,)):
        for which in engines:
            tasks += _chosen(maker.tasks(one, which, seed_offset), only)[:limit]
    if not tasks:
        raise InputError(f"suite {suite} has no such set", field=f"--only {' '.join(only)}")
    return tasks


def existing(data: Path, only: Sequence[str], limit: int | None) -> list[Task]:
    """Returns the sets in a folder that also contains their truths.

    Raises:
        InputError: there is no such set.
    """
    truths = sorted(data.glob("*.truth.json")) if data.is_dir() else []
    tasks = []
    for path in truths:
        folder = path.with_name(path.name.removesuffix(".truth.json"))
        if folder.is_dir():
            recipe = truth_of(folder)["recipe"]
            tasks.append(Task(folder.name, recipe["engine"], recipe["seed"], folder=folder))
    tasks = _chosen(tasks, only)[:limit]
    if not tasks:
        raise InputError("holds no data set with its NAME.truth.json beside it, or none that --only selects", file=data)
    return tasks


def _chosen(tasks: Sequence[Task], only: Sequence[str]) -> list[Task]:
    return [task for task in tasks if not only or any(fnmatchcase(task.name, pattern) for pattern in only)]


def truth_of(folder: Path) -> dict[str, Any]:
    """Returns the truth that `tests/hidden` wrote beside the folder of a set.

    Raises:
        InputError: the file is missing, or is no truth.
    """
    path = folder.with_name(f"{folder.name}.truth.json")
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        for key in ("engine", "seed", "hidden", "sensors", "noise", "nominal_error"):
            found["recipe"][key]
        found["visibility"].values()
    except FileNotFoundError as error:
        raise InputError("is missing: the set was not made", file=path) from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError("is not the truth of a data set", file=path) from error
    return found
