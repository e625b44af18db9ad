"""The message BOARD in words: a board's report on its newest start and its devices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CAUSES = {1: "power-on", 2: "the reset pin", 4: "a brown-out", 8: "the watchdog"}
"""Bit of `started_by` -> cause of the reset; hal/wire/brickpilot.dbc has them."""


def told(board: Mapping[str, int]) -> dict[str, Any] | None:
    """Returns the cause of the newest start, in words, and the counts since power-on.

    Args:
        board: signal of BOARD -> its raw value; empty: the brick has sent none.

    Returns:
        `started_by` and the counts by their signals; None if `board` is empty.
    """
    if not board:
        return None
    causes = [name for bit, name in CAUSES.items() if board["started_by"] & bit]
    return {**board, "started_by": " and ".join(causes) or "an unknown cause"}
