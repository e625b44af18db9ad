"""The memory accesses of each H8/300 instruction, from `hal/h8sim/states.toml`, and their C table for the simulator.

The sum of an instruction's states depends neither on the data nor on whether a branch is taken. The exception is
`eepmov`, whose sum depends on its count, so `eepmov` is not in the table.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass

PLACES = ("nothing", "stack", "register", "short", "word", "displaced", "stepped")
"""The places of an instruction's data in the table; nothing: the instruction has no data."""


@dataclass(frozen=True)
class Cost:
    """Accesses of an instruction: words of ``code``, ``words`` and ``data_bytes`` at ``place``; its ``own`` states."""

    code: int
    words: int
    data_bytes: int
    own: int
    place: str


def load(text: str) -> dict[int, Cost]:
    """Returns first byte of an instruction -> cost, from the text of states.toml."""
    costs: dict[int, Cost] = {}
    for row in tomllib.loads(text)["instruction"]:
        words, data_bytes, own = (row.get(key, 0) for key in ("words", "bytes", "own"))
        cost = Cost(row["code"], words, data_bytes, own, row.get("at", "nothing"))
        for first in row["first"]:
            begin, end = first if isinstance(first, list) else (first, first)
            costs.update(dict.fromkeys(range(begin, end + 1), cost))
    return costs


_HEAD = """#ifndef BRICKPILOT_H8SIM_STATES_GEN_H
#define BRICKPILOT_H8SIM_STATES_GEN_H

#include <stdint.h>

/* Where the data of an instruction lie. */
enum {
%s
};

/* Accesses by the first byte of an instruction: words of code, words and bytes at `where`; and its own states.
 * All 0: the sum is not fixed. */
typedef struct {
    uint8_t code, words, bytes, own, where;
} instruction_t;

static const instruction_t INSTRUCTIONS[256] = {
%s
};

#endif
"""


def render(table: str) -> str:
    """Returns the text of the header below its banner; `table`: the text of states.toml."""
    kinds = ",\n".join(f"    AT_{place.upper()}" for place in PLACES)
    rows = [
        f"    [0x{first:02X}] = {{{cost.code}, {cost.words}, {cost.data_bytes}, {cost.own}, AT_{cost.place.upper()}}}"
        for first, cost in sorted(load(table).items())
    ]
    return _HEAD % (kinds, ",\n".join(rows))
