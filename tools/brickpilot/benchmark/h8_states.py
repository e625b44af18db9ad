"""States (cycles of the 16 MHz clock) that an H8/300 instruction takes, by where code and data lie.

Source: Hitachi H8/300 Series Programming Manual, appendix A, "Number of States Required for Instruction Execution". An
instruction fetches I words of code, reads J branch addresses, moves K words on the stack, L bytes and M words of data,
and takes N states by itself: I S_I + J S_J + K S_K + L S_L + M S_M + N. The sum depends neither on the data nor on
whether a branch is taken. Only that of `eepmov` depends on its count, so `eepmov` is not in the table.

On-chip memory answers a byte or a word in 2 states. Behind the 8-bit external bus a byte takes 3 states and a word 6,
without wait states. The RCX holds brickOS and programs in external RAM; `EXTERNAL` assumes that for code, data and
stack. Interrupts (the 1 ms tick of the kernel, sensors, link) are not counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CLOCK_HZ = 16_000_000


@dataclass(frozen=True)
class Memory:
    """States of one access: ``word`` for code, stack or data, ``byte`` for data."""

    word: int
    byte: int


EXTERNAL = Memory(word=6, byte=3)
ON_CHIP = Memory(word=2, byte=2)


@dataclass(frozen=True)
class Cost:
    """Accesses of an instruction, in the manual's letters: ``code`` I, ``words`` J K M, ``data_bytes`` L, ``own`` N."""

    code: int
    words: int = 0
    data_bytes: int = 0
    own: int = 0

    def states(self, memory: Memory) -> int:
        """Returns the states with code, stack and data in `memory`."""
        return (self.code + self.words) * memory.word + self.data_bytes * memory.byte + self.own


def _by_first_byte() -> dict[int, Cost]:
    one, two = Cost(1), Cost(2)
    costs: dict[int, Cost] = {}
    for first in (*range(0x00, 0x20), *range(0x60, 0x64), 0x67, *range(0x70, 0x78), *range(0x80, 0x100)):
        costs[first] = one  # between registers, or with an immediate byte
    costs.update({first: Cost(1, data_bytes=1) for first in range(0x20, 0x40)})  # mov.b @aa:8
    costs.update(dict.fromkeys(range(0x40, 0x50), two))  # Bcc
    costs.update({0x50: Cost(1, own=12), 0x51: Cost(1, own=12)})  # MULXU, DIVXU
    costs.update(
        {0x54: Cost(2, words=1, own=2), 0x55: Cost(2, words=1), 0x56: Cost(2, words=2, own=2)}
    )  # RTS, BSR, RTE
    costs.update({0x59: two, 0x5A: Cost(2, own=2), 0x5B: Cost(2, words=1, own=2)})  # JMP
    costs.update({0x5D: Cost(2, words=1), 0x5E: Cost(2, words=1, own=2), 0x5F: Cost(2, words=2)})  # JSR
    costs.update({0x68: Cost(1, data_bytes=1), 0x69: Cost(1, words=1)})  # MOV @Rn
    costs.update({0x6A: Cost(2, data_bytes=1), 0x6B: Cost(2, words=1)})  # MOV @aa:16
    costs.update({0x6C: Cost(1, data_bytes=1, own=2), 0x6D: Cost(1, words=1, own=2)})  # MOV @Rn+, @-Rn
    costs.update({0x6E: Cost(2, data_bytes=1), 0x6F: Cost(2, words=1)})  # MOV @(d:16,Rn)
    costs.update({0x79: two})  # MOV.W #xx:16
    costs.update({0x7C: Cost(2, data_bytes=1), 0x7D: Cost(2, data_bytes=2)})  # bits in memory: tested, changed
    costs.update({0x7E: Cost(2, data_bytes=1), 0x7F: Cost(2, data_bytes=2)})
    return costs


COSTS = _by_first_byte()


def by_first_byte(memory: Memory) -> NDArray[np.int64]:
    """Returns (256,): states of an instruction by its first byte; -1 where there is none, or none with a fixed sum."""
    return np.array([COSTS[first].states(memory) if first in COSTS else -1 for first in range(256)], dtype=np.int64)
