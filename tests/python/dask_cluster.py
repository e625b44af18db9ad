"""A real Dask scheduler and its workers, each a separate program, on free ports of this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

DASK = Path(sys.executable).with_name("dask")
_START_S = 60.0

Worker = subprocess.Popen[bytes]


class Cluster:
    """A scheduler for a `with` block, whose end kills all programs. A part may kill two workers, not Dask's four."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._programs: list[Worker] = []
        self.workers: list[Worker] = []
        file = scratch / "scheduler.json"
        options = ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file)]
        self.scheduler = self._program("scheduler", *options, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1")
        self.address = str(json.loads(_content(file, self.scheduler))["address"])

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        for program in self._programs:
            program.kill()  # otherwise a worker would search for its lost scheduler for a while
        for program in self._programs:
            program.wait(20)

    def add_worker(self, name: str, *, path: Path | None = None) -> Worker:
        """Starts a worker that looks for modules first in `path`."""
        places = [str(one) for one in (path, *Path(__file__).parents[:2]) if one is not None]
        options = ["--nthreads", "1", "--no-nanny", "--local-directory", str(self._scratch)]
        environment = {"PYTHONPATH": os.pathsep.join(places), "OPENBLAS_NUM_THREADS": "1"}
        return self._program("worker", self.address, "--name", name, *options, **environment)

    def _program(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        log = (self._scratch / f"{arguments[0]}{len(self._programs)}.log").open("wb")
        with log:
            program = subprocess.Popen(
                [str(DASK), *arguments, "--no-dashboard"],
                stdout=log, stderr=log, env={**os.environ, **environment}, start_new_session=True,
            )  # fmt: skip
        self._programs.append(program)
        return program


def _content(file: Path, program: subprocess.Popen[bytes]) -> str:
    """Waits until a program has written complete JSON into a file, and returns the content."""
    until = time.monotonic() + _START_S
    while time.monotonic() < until and program.poll() is None:
        try:
            json.loads(text := file.read_text())
            return text
        except (OSError, ValueError):
            time.sleep(0.05)
    raise AssertionError("the scheduler did not start")
