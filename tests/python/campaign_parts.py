"""Functions that campaign tests give to workers, in a module of their own because test modules have fixtures."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa


def squared(number: int) -> int:
    return number * number


def table(seed: int) -> pa.Table:
    """Returns 20 rows that depend only on the seed, after a delay that depends on the process."""
    time.sleep(0.002 * (os.getpid() % 3))
    drawn = np.random.default_rng(seed)
    return pa.table(
        {
            "seed": np.full(20, seed),
            "error": drawn.normal(size=20),
            "reached": drawn.random(20) < 0.5,
            "word": [f"row {one}" for one in drawn.integers(0, 5, 20)],
        }
    )


def slow_table(seed: int) -> pa.Table:
    """Returns `table(seed)` after 0.1 s."""
    time.sleep(0.1)
    return table(seed)


def slowly_squared(number: int) -> int:
    time.sleep(0.05)
    return number * number


def too_late(_: Any) -> None:
    raise TimeoutError("of the function")


def dies_once(argument: tuple[int, str]) -> int:
    """Returns the number; if the mark names a file that does not exist, first makes the file and kills the worker."""
    number, mark = argument
    if mark and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def dies(argument: int) -> int:
    """Returns the number; the number 3 kills its worker."""
    if argument == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return argument


def fails(argument: Any) -> None:
    raise ValueError(f"no such thing as {argument}")


def threads(_: Any) -> list[int]:
    """Returns the number of threads of each numeric library in the worker."""
    from threadpoolctl import threadpool_info

    return [one["num_threads"] for one in threadpool_info()]


class AwkwardError(Exception):
    """An error that cannot be rebuilt from its pickle."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def awkward(argument: Any) -> None:
    raise AwkwardError(argument, argument)


def long_answer(size: int) -> bytes:
    """Returns `size` bytes: more than a pipe holds."""
    return b"x" * size


def process(_: Any) -> int:
    time.sleep(0.05)
    return os.getpid()
