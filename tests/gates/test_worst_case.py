"""On each brick every control period stays within its bound, for two kinds of start, drawn settings and a full link.

`tests/loop/worst_case.py` has the figures of hal/avr/README.md and hal/rcx/README.md; this test makes two short flights
per brick.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import pytest
import worst_case
from lab.avr_budget import PERIOD

AVR_SHARE = 1.2
"""Longest step as a share of a period. A step above 1 delays the next step; from 2 on a tick would count as late."""

RCX_MS = 12.0
"""Longest time between steps, ms. The watchdog stops a run at 20 ms."""

FLIGHTS = (0, 1)  # seeds: with 0 the robot starts by itself, with 1 in a host's session


@pytest.fixture(autouse=True, scope="module")
def _built_once() -> Iterator[None]:
    """Builds each image once for both flights."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(worst_case, "avr_image", functools.cache(worst_case.avr_image))
        patched.setattr(worst_case.rcx_flight, "build", functools.cache(worst_case.rcx_flight.build))
        yield


@pytest.mark.parametrize("target", ["avr:328p-imu", "avr:2560"])
def test_a_period_of_an_avr_chip_stays_within_its_bound(target: str) -> None:
    longest = max(int(worst_case.avr_cycles(target, 3.0, seed).max()) for seed in FLIGHTS)
    assert 0.8 * PERIOD < longest <= AVR_SHARE * PERIOD


@pytest.mark.parametrize("target", sorted(worst_case.RCX_TARGETS))
def test_a_step_of_an_rcx_follows_the_last_one_in_time(target: str) -> None:
    longest = max(float(worst_case.rcx_ticks_ms(target, 3.0, seed).max()) for seed in FLIGHTS)
    assert 9.0 < longest <= RCX_MS
