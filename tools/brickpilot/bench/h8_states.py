"""States (cycles of the 16 MHz clock) that an H8/300 instruction takes, by where code and data lie.

`hal/h8sim/states.toml` has what each instruction accesses. The sum of its states depends neither on the data nor on
whether a branch is taken. Only that of `eepmov` depends on its count, so `eepmov` is not in the table.

On-chip memory answers a byte or a word in 2 states. Behind the 8-bit external bus a byte takes 3 states and a word 6,
without wait states. The RCX holds brickOS and programs in external RAM; `EXTERNAL` assumes that for code, data and
stack. The simulated RCX (hal/h8sim) has the same table, and knows where each access goes.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CLOCK_HZ = 16_000_000
PLACES = ("nothing", "stack", "register", "short", "word", "displaced", "stepped")
"""Where an instruction's data lie, as in the table; nothing: it has none."""


@dataclass(frozen=True)
class Memory:
    """States of one access: ``word`` for code, stack or data, ``byte`` for data."""

    word: int
    byte: int


EXTERNAL = Memory(word=6, byte=3)
ON_CHIP = Memory(word=2, byte=2)


@dataclass(frozen=True)
class Cost:
    """Accesses of an instruction: words of ``code``, ``words`` and ``data_bytes`` at ``place``; its ``own`` states."""

    code: int
    words: int
    data_bytes: int
    own: int
    place: str

    def states(self, memory: Memory) -> int:
        """Returns the states with code, stack and data in `memory`."""
        return (self.code + self.words) * memory.word + self.data_bytes * memory.byte + self.own


def load(text: str) -> dict[int, Cost]:
    """Returns the table in `text`, that of states.toml, by the first byte of an instruction."""
    costs: dict[int, Cost] = {}
    for row in tomllib.loads(text)["instruction"]:
        words, data_bytes, own = (row.get(key, 0) for key in ("words", "bytes", "own"))
        cost = Cost(row["code"], words, data_bytes, own, row.get("at", "nothing"))
        for first in row["first"]:
            begin, end = first if isinstance(first, list) else (first, first)
            costs.update(dict.fromkeys(range(begin, end + 1), cost))
    return costs


COSTS = load((Path(__file__).parents[1] / "states.toml").read_text(encoding="utf-8"))


def by_first_byte(memory: Memory) -> NDArray[np.int64]:
    """Returns (256,): states of an instruction by its first byte; -1 where there is none, or none with a fixed sum."""
    return np.array([COSTS[first].states(memory) if first in COSTS else -1 for first in range(256)], dtype=np.int64)
