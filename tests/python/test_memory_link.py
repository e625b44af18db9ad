"""A flight over a link in memory is the same as over a serial line, but follows the link's own clock."""

from __future__ import annotations

import dataclasses
import time
from contextlib import AbstractContextManager

import pytest
from brickpilot.campaign import runs
from brickpilot.errors import InputError
from brickpilot.hil import ends, fly
from brickpilot.hil.ends import Ends
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle.scenario import Fault


def planned(*faults: Fault, seconds: float = 6.0) -> flight.Plan:
    plan = flight.plan("mission", sensors="imu+encoders", seed=5)
    scenario = dataclasses.replace(plan.scenario, faults=faults)
    return dataclasses.replace(plan, scenario=scenario, steps=round(seconds / 0.003))


def flown(both: AbstractContextManager[Ends], plan: flight.Plan) -> fly.HilFlight:
    with both as opened:
        quick = dataclasses.replace(opened, reply_s=0.1)
        return fly.fly(quick, "here", plan, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None)


def test_a_flight_without_faults_is_that_in_process():
    plan = planned()
    over = flown(ends.memory_ends(), plan)
    assert (over.flight.motors == flight.fly(plan).motors).all()
    row = runs.row(plan)
    assert row["waypoints_reached"] == 1
    for name, value in runs.over_a_link(over).items():
        near = pytest.approx(row[name], rel=1e-3, abs=1e-4, nan_ok=True) if isinstance(value, float) else row[name]
        assert value == near, name


@pytest.mark.realtime
def test_faults_do_the_same_as_over_a_serial_line():
    plan = planned(
        Fault("corrupt", 2.0, 3.0, 0.01),
        Fault("drop", 3.0, 4.0, 0.002),
        Fault("missing_sensor", 3.5, 4.0, sensor="imu"),
    )
    both = [flown(opened, plan) for opened in (ends.memory_ends(), ends.both_ends("serial:pty"))]
    hashes = {flight_figures.motor_hash(one.flight) for one in both}
    assert len(hashes) == 1
    assert hashes != {flight_figures.motor_hash(flight.fly(plan))}
    assert both[0].lost_frames == both[1].lost_frames > 2


def test_silence_costs_time_of_the_link_and_none_of_the_clock():
    plan = planned(Fault("disconnect", 2.0, 6.0))
    began = time.process_time()
    lost = flown(ends.memory_ends(), plan)
    assert time.process_time() - began < 2.0  # without the waits, 4 of 0.25 s and 670 of 3 ms; holds at 1 GHz, too
    row = runs.row(plan)
    assert (row["success"], row["cause"]) == (False, "the link was lost")
    assert lost.broke_off == "the link was lost: no reply, 2.001 s into the flight"


def test_a_restart_is_one_of_the_brick():
    row = runs.row(planned(Fault("controller_restart", 2.0, 2.1)))
    assert (row["success"], row["cause"]) == (False, "the brick was reset")


def test_a_fault_of_another_brick_is_refused():
    with pytest.raises(InputError, match="needs --target avr"):
        runs.row(planned(Fault("main_held", 2.0, 2.1)))
