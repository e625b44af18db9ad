"""Rows that are closer in time than the motor steps of the plant are merged, and the user is told."""

from __future__ import annotations

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.constants import MOTOR_STEP_S

SIGNALS = {"voltage": "u", "speed": "w", "current": "i"}


def log(time: np.ndarray) -> pd.DataFrame:
    """Returns a log: a voltage that rises by 1 V per ms, a speed ten times as large, a current in one row of 30."""
    current = np.where(np.arange(time.size) % 30 == 4, 1e3 * time, np.nan)
    return pd.DataFrame({"time": time, "u": 1e3 * time, "w": 1e4 * time, "i": current})


def read(frame: pd.DataFrame, *, floats: bool = False) -> bp.Dataset:
    return bp.Dataset.from_frames({"run": frame}, vehicle="motor", signals=SIGNALS, floats=floats)


def test_three_rows_of_a_tenth_of_a_ms_become_one():
    time = np.arange(3000) * 1e-4
    dataset = read(log(time))
    run = dataset.runs[0]
    assert run.time == pytest.approx(time[::3])
    assert run.inputs["voltage"] == pytest.approx(1e3 * time[1::3])  # the mean of three rows is the middle one
    assert run.outputs["speed"] == pytest.approx(1e4 * time[::3])
    note = [note for note in dataset.notes if "rows" in note]
    assert note == [
        "3,000 rows become 1,000: the plant simulates its motors in steps of 0.3 ms, and so cannot use faster rows; "
        "inputs are averaged"
    ]


def test_no_reading_of_a_channel_that_is_seldom_logged_is_lost():
    frame = log(np.arange(3000) * 1e-4)
    current = read(frame).runs[0].outputs["current"]
    assert current[np.isfinite(current)] == pytest.approx(frame["i"].dropna().to_numpy())


def test_a_motor_that_floats_in_one_row_floats_in_all():
    frame = log(np.arange(3000) * 1e-4)
    frame.loc[301, "u"] = np.nan
    floats = np.isnan(read(frame, floats=True).runs[0].inputs["voltage"])
    assert np.flatnonzero(floats).tolist() == [100]


@pytest.mark.parametrize("step", [0.6 * MOTOR_STEP_S, MOTOR_STEP_S, 0.01])
def test_rows_that_the_plant_can_use_stay(step):
    frame = log(np.arange(300) * step)
    dataset = read(frame)
    assert dataset.runs[0].time.size == 300
    assert not [note for note in dataset.notes if "rows become" in note]


def test_rows_in_bursts_stay_where_they_are():
    bursts = np.concatenate([k * 0.02 + np.arange(5) * 2e-5 for k in range(100)])
    run = read(log(bursts)).runs[0]
    assert run.time == pytest.approx(np.arange(100) * 0.02)
    assert run.outputs["speed"] == pytest.approx(1e4 * run.time)
