"""A flight reports in words what the message BOARD says about the board's latest start."""

from __future__ import annotations

import pytest
from brickpilot.hil.linked_flight import RESET_CAUSES, board_figures
from brickpilot.link.messages import book

COUNTS = {"converter": 3, "edges": 2, "overruns": 1}


@pytest.mark.parametrize(
    ("started_by", "words"),
    [(1, "power-on"), (8, "the watchdog"), (5, "power-on and a brown-out"), (0, "an unknown cause")],
)
def test_the_cause_of_a_start_is_told_in_words(started_by: int, words: str) -> None:
    assert board_figures({"started_by": started_by, **COUNTS}) == {"started_by": words, **COUNTS}


def test_a_brick_without_devices_of_its_own_tells_nothing() -> None:
    assert board_figures({}) is None


def test_the_causes_are_those_of_the_message() -> None:
    comment = book().database.get_message_by_name("BOARD").get_signal_by_name("started_by").comment
    for bit, name in RESET_CAUSES.items():
        assert f"{bit} {name.removeprefix('the ').removeprefix('a ')}" in comment
