"""The orders at which wheel speeds repeat are found up to a known limit, which the sample period sets."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.periods import orders, resolved_order
from brickpilot.vehicle import plant
from brickpilot.vehicle.plant import OpenLoopRun

RAMPS = ((1.0, 7.0), (-7.0, -1.5), (3.0, 4.0))


def ramps(period: float, ripple: float, order: float) -> Dataset:
    """Returns runs of slow ramps, rows `period` s apart; wheel speeds ripple by `ripple` rad/s, `order` a turn."""
    time = np.arange(0.0, 10.0, period)
    random = np.random.default_rng(1)
    runs = []
    for number, (start, end) in enumerate(RAMPS):
        volts = np.column_stack([start + (end - start) * time / time[-1]] * 2)
        outputs = plant.simulate([(synthetic.robot(), OpenLoopRun(time=time, inputs=volts))])[0].outputs
        measured = {
            f"wheel_speed_{side}": outputs[f"wheel_speed_{side}"]
            + ripple * np.cos(order * outputs[f"wheel_angle_{side}"])
            + random.normal(0.0, 0.02, len(time))
            for side in ("left", "right")
        }
        inputs = {"voltage_left": volts[:, 0], "voltage_right": volts[:, 1]}
        path = Path("ramps")
        runs.append(Run(f"ramp_{number}", path, None, time, inputs, measured, measured, 0.0, None, {}))
    return Dataset("ramps", Path("ramps"), "diff_drive", "FRD", {}, {}, {}, tuple(runs), 0.0, (), ())


@pytest.mark.parametrize("order", [6.0, 45.0, 90.0])
def test_a_ripple_is_found_at_its_order(order: float) -> None:
    found = orders(ramps(0.002, 0.1, order))
    assert min(abs(one - order) for one in found) < 0.2


def test_a_ripple_is_found_beside_what_is_held_out() -> None:
    """The wheel's angle after a hole is unknown, so only the longest part of each run is used."""
    data = ramps(0.002, 0.1, 6.0)

    def with_hole(run: Run) -> Run:
        hidden = (run.time > 6.0) & (run.time < 8.0)
        return dataclasses.replace(run, outputs={k: np.where(hidden, np.nan, v) for k, v in run.outputs.items()})

    found = orders(dataclasses.replace(data, runs=tuple(with_hole(run) for run in data.runs)))
    assert min(abs(one - 6.0) for one in found) < 0.2


def test_slow_samples_are_no_holes() -> None:
    """Rows that are 0.15 s apart are no hole, and a run with only one sample that is not held out changes nothing."""
    slow = ramps(0.15, 0.0, 6.0)
    lone = {name: np.where(np.arange(len(one)) == 7, one, np.nan) for name, one in slow.runs[0].outputs.items()}
    first = dataclasses.replace(slow.runs[0], outputs=lone)
    others = slow.runs[1:]
    assert orders(dataclasses.replace(slow, runs=others)) != ()  # no rows are missing
    assert orders(dataclasses.replace(slow, runs=(first, *others))) == orders(dataclasses.replace(slow, runs=others))


def test_smooth_wheels_have_no_order() -> None:
    assert orders(ramps(0.002, 0.0, 6.0)) == ()


def test_samples_show_so_many_periods_per_turn_as_they_are_dense() -> None:
    fine, coarse = (resolved_order(ramps(period, 0.0, 6.0)) for period in (0.002, 0.01))
    assert fine is not None
    assert coarse is not None
    assert fine == pytest.approx(5 * coarse, rel=0.05)
    assert coarse == pytest.approx(43.0, rel=0.1)  # for the slowest wheels, at 7 rad/s


def test_without_wheels_nothing_is_known() -> None:
    data = ramps(0.01, 0.0, 6.0)
    blind = dataclasses.replace(data, runs=tuple(dataclasses.replace(run, outputs={}) for run in data.runs))
    assert resolved_order(blind) is None
