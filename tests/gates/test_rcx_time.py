"""The RCX's images run in simulated time, with brickOS's kernel, all interrupts, and the plant as the robot.

Every instruction takes its clock states, and the converter, the timers and the serial line interrupt as on the chip.
"""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from brickpilot.hil import rcx_flight
from brickpilot.hil.rcx_flight import ARRIVED, CLOCK_HZ, Image, RcxFlight, SimulatedRcx
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx

ROOT = Path(__file__).resolve().parents[2]
SENSORS = ["imu", "rotation"]
TICK_MS, P99_MS = 9.0, 11.0
LATE = "Err 7"

HOLD = bytes.fromhex("7fe87260")
"""Machine code of bclr #6,@0xffe8, with which the step disables the converter's interrupt."""
NO_OPERATION = bytes(4)

COUNT_MS, COUNTS = 8, 200
"""Time between two counts of a wheel, ms, and number of counts. 125 counts/s are 0.67 m/s, two thirds above cruise."""
REST_MS = 2500
LEFT_COUNT, RIGHT_COUNT = 0xADA8, 0xADA4
"""Addresses of the wheels' counts in Debian's build of the brickOS kernel."""

CLOCK_STATES = 188
"""Clock states of the interrupt of each ms, by Hitachi's table: 24 to enter, 54 in the ROM, 110 in the kernel."""


def watchdog_ms() -> int:
    """Returns the longest period of the loop, ms, that does not end a run."""
    text = (ROOT / "firmware/app/params_gen.h").read_text()
    found = re.search(r"\.watchdog_ms = (\d+)", text)
    assert found is not None
    return int(found[1])


def fly(image: Image, sensors: str, duration: float) -> RcxFlight:
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=duration)
    plan = flight.plan(mission, rcx(), sensors=rcx_flight.SENSORS[sensors], seed=0)
    return rcx_flight.fly(image, plan, lambda *_: None)


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Image]:
    """Returns a function: sensors -> the image for these sensors, built once."""
    return functools.cache(lambda sensors: rcx_flight.build(sensors, tmp_path_factory.mktemp(sensors)))


@pytest.fixture(params=SENSORS)
def sensors(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def image(build: Callable[[str], Image], sensors: str) -> Image:
    return build(sensors)


def test_the_mission_is_flown_in_time(image: Image, sensors: str) -> None:
    flown = fly(image, sensors, 65.0)
    assert flown.reached.count == 8
    assert flown.shown == ARRIVED
    assert len(flown.ticks_ms) > 4000
    assert np.median(flown.ticks_ms) == pytest.approx(TICK_MS, abs=0.1)
    assert np.percentile(flown.ticks_ms, 99) <= P99_MS
    assert flown.ticks_ms.max() < watchdog_ms()


def test_without_the_held_converter_no_mission_is_flown(image: Image, sensors: str) -> None:
    text = image.program.image
    assert text.count(HOLD) == 1
    free = dataclasses.replace(image.program, image=text.replace(HOLD, NO_OPERATION))
    flown = fly(dataclasses.replace(image, program=free), sensors, 6.0)
    assert flown.shown == LATE
    assert flown.reached.count == 0
    assert np.percentile(flown.ticks_ms, 99) > P99_MS
    assert flown.ticks_ms.max() > watchdog_ms()


def test_fast_wheels_lose_no_count(build: Callable[[str], Image]) -> None:
    levels = rcx_flight.ROTATION_LEVELS
    with SimulatedRcx() as brick:
        brick.convert(319, levels[0], 512, levels[0])
        rcx_flight.start(brick, build("rotation"))
        brick.run(REST_MS)
        assert brick.shows("run 1")
        for count in range(1, COUNTS + 1):
            brick.convert(319, levels[count % 4], 512, levels[-count % 4])
            brick.run(COUNT_MS)
        brick.run(30)
        assert brick.word(LEFT_COUNT) == COUNTS
        assert brick.word(RIGHT_COUNT) == 0x10000 - COUNTS


def test_the_kernel_alone_is_interrupted_as_an_independent_emulator_says() -> None:
    with SimulatedRcx() as brick:
        brick.convert(319, 512, 512, 512)
        brick.run(2000)
        before = brick.tally()
        brick.run(1000)
        tally = brick.tally().since(before)
    assert sum(tally.spent.values()) == tally.states
    assert tally.states == pytest.approx(CLOCK_HZ, abs=100)
    assert tally.count["clock"] == pytest.approx(1000, abs=2)
    assert tally.count["motors"] == pytest.approx(500, abs=2)
    assert tally.count["subsystems"] == pytest.approx(500, abs=2)
    assert tally.count["converter"] == pytest.approx(24_100, rel=0.02)
    assert tally.spent["clock"] == pytest.approx(CLOCK_STATES * tally.count["clock"], rel=1e-3)
    assert 0.54 < tally.spent["converter"] / tally.states < 0.65
