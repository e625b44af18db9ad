"""The states of each H8/300 instruction as a table in C, for the simulated RCX."""

from __future__ import annotations

from brickpilot.bench.h8_states import PLACES, load

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
