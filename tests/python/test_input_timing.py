"""Whether inputs are held or linear between two rows of a slow log is stated, or is found from the runs."""

from __future__ import annotations

import dataclasses
import functools
from typing import Literal

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.discover.row_meaning import with_known_timing
from hidden import measure
from hidden.manoeuvre import ramps
from hidden.recipe import BENCH, Recipe

ROW_S = 0.04
SIGNALS = ("wheel_speed_left", "wheel_speed_right", "yaw_rate")
NOMINAL = {name: {"value": value, "sd": 0.03 * value} for name, value in dataclasses.asdict(BENCH).items() if value > 0}


@functools.cache
def frames(truth: Literal["held", "linear"], late_rows: float = 0.0) -> dict[str, pd.DataFrame]:
    """Returns name -> log of four runs of the planar engine, with a row every 40 ms and a new command in each row.

    Args:
        truth: whether the motors' voltage is held or linear between two rows.
        late_rows: delay of the voltage, in rows.
    """
    random = np.random.default_rng(4)
    time = np.arange(0.0, 6.0 + ROW_S / 2, ROW_S)
    drives = []
    for number in range(4):
        slow = np.cumsum(random.normal(0.0, 1.0, (len(time), 2)), axis=0)
        volts = 5.0 * np.sin(slow / 2 + number)
        volts[time < 0.3] = 0.0
        drives.append(ramps(f"drive_{number}", 6.0, *zip(time.tolist(), *volts.T.tolist(), strict=True)))
    late = [dataclasses.replace(one, time=tuple(t + late_rows * ROW_S for t in one.time)) for one in drives]
    tracks = measure.engine("planar")(BENCH, {}, late, seed=1, sample_s=ROW_S if truth == "held" else 0.001)
    recipe = Recipe("timing", engine="planar", runs=tuple(drives), sample_s=ROW_S)
    logged = measure.log(measure.sense(tracks, recipe), recipe)
    found = {}
    for drive, signals in zip(drives, logged, strict=True):
        at, left, right = drive.held(ROW_S)
        measured = {name: signals[name] for name in SIGNALS}
        found[drive.name] = pd.DataFrame({"time": at, "voltage_left": left, "voltage_right": right, **measured})
    return found


def dataset(truth: Literal["held", "linear"], late_rows: float = 0.0, timing: str = "unknown") -> bp.Dataset:
    return bp.Dataset.from_frames(
        frames(truth, late_rows), vehicle="diff_drive", nominal=NOMINAL, input_timing=timing,  # type: ignore[arg-type]
    )  # fmt: skip


def test_a_linear_input_becomes_steps_with_the_mean_of_each() -> None:
    frame = pd.DataFrame({"time": [0.0, 0.02, 0.04], "voltage": [0.0, 0.4, 0.4], "speed": [0.0, 1.0, 2.0]})
    (run,) = bp.Dataset.from_frames({"one": frame}, vehicle="motor", input_timing="linear").runs
    np.testing.assert_allclose(run.time, [0, 0.005, 0.01, 0.015, 0.02, 0.04])
    np.testing.assert_allclose(run.inputs["voltage"], [0.05, 0.15, 0.25, 0.35, 0.4, 0.4])
    np.testing.assert_array_equal(run.outputs["speed"], [0, np.nan, np.nan, np.nan, 1, 2])


@pytest.mark.parametrize("truth", ["held", "linear"])
def test_the_timing_of_another_engine_is_found_with_certainty(truth: Literal["held", "linear"]) -> None:
    known = with_known_timing(dataset(truth), None, seed=0, jobs=1)
    assert known.input_timing == truth
    assert any(f"between two rows the inputs are {truth}, found from the runs, 99" in note for note in known.notes)
    assert not any("not known" in note for note in known.notes)
    if truth == "linear":
        stated = dataset(truth, timing="linear")
        pd.testing.assert_frame_equal(known.runs[1].to_frame(), stated.runs[1].to_frame())


def test_linear_inputs_that_act_late_are_not_called_held_with_certainty() -> None:
    """Linear inputs that act half a row late look like held inputs, which act on average half a row later than linear
    inputs. So the answer is "linear", or a note names linear inputs behind a delay."""
    known = with_known_timing(dataset("linear", late_rows=0.5), None, seed=0, jobs=1)
    (note,) = (note for note in known.notes if "between two rows" in note)
    assert known.input_timing == "linear" or "linear inputs behind a delay of 2" in note


def test_runs_that_never_change_their_command_do_not_tell() -> None:
    still = {name: frame.assign(voltage_left=4.0, voltage_right=3.0) for name, frame in frames("held").items()}
    unknown = bp.Dataset.from_frames(still, vehicle="diff_drive", nominal=NOMINAL, input_timing="unknown")
    known = with_known_timing(unknown, None, seed=0, jobs=1)
    assert known.input_timing == "held"
    assert any("these runs do not tell: held is taken" in note for note in known.notes)


def test_check_and_discover_say_what_they_found() -> None:
    said = bp.check(dataset("linear"), jobs=1)
    assert sum("the inputs are linear, found from the runs" in note for note in said.notes) == 1
    assert {run.samples for run in said.runs} == {151}  # rows of the log, without the rows added for ramps
    assert [run.step_s for run in said.runs] == pytest.approx([ROW_S] * 4)
    assert all(one.missing == 0 for one in said.signals)
    found = bp.discover(dataset("linear"), jobs=1)
    assert any("the inputs are linear, found from the runs" in note for note in found.notes)
    assert found.verdict == "none"
