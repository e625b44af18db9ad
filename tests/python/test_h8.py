"""The clock cycles ("states") of an instruction on the RCX's processor equal the manual; those of a step in a trace are
counted correctly."""

from __future__ import annotations

import numpy as np
import pytest
from lab.rcx_budget import EXTERNAL, ON_CHIP, STAGES, Counter, Program

# From the Hitachi H8/300 Series Programming Manual, appendix A: instruction -> its first byte, and its states if code,
# stack and data are in on-chip memory.
STATES_ON_CHIP = {
    "add.w r1,r0": (0x09, 2),
    "addx #0,r0l": (0x98, 2),
    "adds #1,r0": (0x0B, 2),
    "bne": (0x46, 4),
    "bsr": (0x55, 6),
    "jsr @aa:16": (0x5E, 8),
    "jsr @rn": (0x5D, 6),
    "rts": (0x54, 8),
    "mov.w #xx:16,r0": (0x79, 4),
    "mov.w @r1,r0": (0x69, 4),
    "mov.w @(d:16,r1),r0": (0x6F, 6),
    "mov.b @(d:16,r1),r0l": (0x6E, 6),
    "push r0": (0x6D, 6),
    "mulxu": (0x50, 14),
    "divxu": (0x51, 14),
    "bset #3,@aa:8": (0x7F, 8),
}


@pytest.mark.parametrize("instruction", STATES_ON_CHIP)
def test_states_on_chip_equal_the_manuals(instruction: str) -> None:
    first, expected = STATES_ON_CHIP[instruction]
    assert ON_CHIP.by_first_byte()[first] == expected


def test_a_word_behind_the_external_bus_takes_six_states_and_a_byte_three() -> None:
    external = EXTERNAL.by_first_byte()
    assert external[0x09] == 6  # the instruction is one word of code
    assert external[0x6E] == 2 * 6 + 3
    assert external[0x6F] == 2 * 6 + 6
    assert external[0x50] == 6 + 12
    assert external[0x7B] == -1  # the states of eepmov depend on the number of bytes


def program() -> Program:
    """Returns a program with functions at 0x100, 0x110 and so on, in which each instruction takes one state.

    In external memory, each instruction takes two states.
    """
    names = ["loop_tick", "hal_imu_read", *(name for functions in STAGES.values() for name in functions)]
    ones = np.ones(0x10000, dtype=np.int64)
    return Program({"external": 2 * ones, "on_chip": ones}, {name: 0x100 + 16 * i for i, name in enumerate(names)})


def step_of(functions: list[tuple[str, int]]) -> list[tuple[int, int]]:
    """Returns the trace of a step, (address, stack pointer) of each instruction.

    Args:
        functions: (name, number of its instructions) of each function that the step calls.
    """
    at = program().at
    trace = [(at["loop_tick"], 0x7000), (at["loop_tick"] + 2, 0x6FF0)]
    for name, count in functions:
        trace += [(at[name] + 2 * i, 0x6FEE - (2 if i else 0)) for i in range(count)]
        trace.append((at["loop_tick"] + 4, 0x6FF0))
    return [*trace, (0x50, 0x7002)]


@pytest.mark.parametrize("piece", [1, 3, 1000])
def test_a_step_is_found_however_its_trace_is_cut(piece: int) -> None:
    trace = step_of([("hal_imu_read", 4), ("heading_step", 5), ("pid_step", 2), ("pid_step", 3)]) * 3
    counter = Counter(program())
    for begin in range(0, len(trace), piece):
        counter.take(np.array(trace[begin : begin + piece], dtype=np.uint16))
    found = counter.stages()
    assert found["heading"].instructions.tolist() == [5, 5, 5]
    assert found["control"].states["external"].tolist() == [10, 10, 10]
    assert found["hal"].instructions.tolist() == [4, 4, 4]
    assert found["rest"].instructions.tolist() == [6, 6, 6]
    assert found["step"].instructions.tolist() == [16, 16, 16]
    assert counter.stack == 0x7002 - 0x6FEC
