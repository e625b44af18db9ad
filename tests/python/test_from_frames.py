"""DataFrames give the same data set as files with the same values. A bad table is refused with run, row and column."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
import synthetic

SIGNALS = {"voltage": "volts", "speed": ("rpm", "rpm")}


def bench(rows: int = 50) -> pd.DataFrame:
    """Returns a table with time, s, voltage, V, and speed, rpm."""
    time = np.arange(rows) * 0.01
    return pd.DataFrame({"time": time, "volts": np.where(time > 0.1, 4.0, 0.0), "rpm": 100.0 * time})


def read(frame: pd.DataFrame, **changes: Any) -> bp.Dataset:
    stated = {"vehicle": "motor", "signals": SIGNALS, **changes}
    return bp.Dataset.from_frames({"low": bench(), "high": frame}, **stated)


def test_frames_and_files_give_the_same_data_set(tmp_path: Path) -> None:
    signals = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "yaw_rate": 0.01}
    units = {"yaw_rate": ("deg/s", 180 / np.pi)}

    def spoil(_: str, table: dict[str, Any]) -> None:
        table["wheel_speed_right"][60] += 900.0  # one wrong reading
        table["wheel_speed_left"][7] = np.nan

    roles = ["fit", "held_out", "fit", "fit"]
    folder = synthetic.write(
        tmp_path / "set", synthetic.robot(), signals, "mass = 0.5", frame="FLU", units=units, roles=roles, spoil=spoil
    )
    files = bp.read(folder)
    columns = {"time": "t", "voltage_left": "voltage_left", "voltage_right": "voltage_right"}
    frames = bp.Dataset.from_frames(
        {run.name: pd.read_csv(run.file) for run in files.runs},
        vehicle="diff_drive",
        signals={**columns, **{name: name for name in signals}, "yaw_rate": ("yaw_rate", "deg/s")},
        nominal={"mass": np.float64(0.5)},
        frame="FLU",
        roles=dict(zip([run.name for run in files.runs], roles, strict=True)),
        name=files.name,
    )
    assert frames.faults == files.faults != ()
    assert (frames.notes, frames.nominal, frames.signals) == (files.notes, files.nominal, files.signals)
    for one, other in zip(frames.runs, files.runs, strict=True):
        assert (one.name, one.role, one.gap_s) == (other.name, other.role, other.gap_s)
        pd.testing.assert_frame_equal(one.to_frame(), other.to_frame(), rtol=0, atol=0)


def test_a_printed_data_set_has_some_lines() -> None:
    text = repr(read(bench(), name="rig"))
    assert text.startswith("Dataset rig: motor, 2 runs, 0 faults")
    assert "low: 50 samples, 0.49 s" in text
    assert len(text) < 400
    many = bp.Dataset.from_frames({f"r{k}": bench() for k in range(40)}, vehicle="motor", signals=SIGNALS)
    assert len(str(many).splitlines()) < 15


def test_what_a_file_states_of_runs_can_be_stated_of_frames() -> None:
    dataset = read(
        bench(), gap_s={"high": 60.0}, replicate_of={"high": "low"}, initial={"low": {"speed": np.float64(2.0)}},
        input_timing="linear",
    )  # fmt: skip
    assert [run.gap_s for run in dataset.runs] == [0.0, 60.0]
    assert [run.replicate_of for run in dataset.runs] == [None, "low"]
    assert [run.initial for run in dataset.runs] == [{"speed": 2.0}, {}]
    assert dataset.input_timing == "linear"
    assert dataset.gap_s == 0.0
    assert {run.gap_s for run in read(bench(), gap_s=3.0).runs} == {3.0}


def test_a_stated_start_is_in_the_frame_of_the_data() -> None:
    drive = pd.DataFrame({"time": [0.0, 0.1], "voltage_left": [0.0, 1.0], "voltage_right": 0.0, "yaw_rate": 0.0})
    turning = {"drive": {"yaw_rate": 0.5, "surge": 0.2}}
    dataset = bp.Dataset.from_frames({"drive": drive}, vehicle="diff_drive", frame="FLU", initial=turning)
    assert dataset.runs[0].initial == {"yaw_rate": -0.5, "surge": 0.2}


def changed(row: int, column: str, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        frame[column] = frame[column].astype(object)
        frame.loc[row, column] = value
        return frame

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed(17, "rpm", "fast"), "run high, row 17: speed (column rpm): 'fast' is not a number"),
        (changed(17, "rpm", True), "run high, row 17: speed (column rpm): 'True' is not a number"),
        (changed(9, "rpm", np.inf), "run high, row 9: speed (column rpm): is too large for a number"),
        (changed(9, "rpm", 1e9), "run high, row 9: speed (column rpm): 1.047e+08 rad/s is beyond what is physical"),
        (changed(5, "time", 0.0), "run high, row 5: time: does not increase: 0 s after 0.04 s"),
        (changed(5, "time", None), "run high, row 5: time: is blank"),
        (lambda f: f.rename(columns={"rpm": "n"}), "run high: speed: no column 'rpm' among time, volts, n"),
        (lambda f: pd.concat([f, f[["rpm"]]], axis=1), "run high: rpm: column occurs more than once"),
        (lambda f: f.iloc[:0], "run high: holds no rows of data"),
        (lambda f: f.iloc[:1], "run high, row 0: a run needs at least two samples"),
        (lambda f: f.assign(time=pd.to_timedelta(f["time"], "s")), "run high: time (column time): holds timedelta64"),
        (lambda f: f.to_dict(), "run high: is a dict, not a DataFrame"),
    ],
)
def test_a_bad_frame_is_refused_with_run_row_and_column(
    change: Callable[[pd.DataFrame], pd.DataFrame], message: str
) -> None:
    with pytest.raises(bp.InputError, match=f"^{re.escape(message)}"):
        read(change(bench()))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vehicle": "boat"}, "from_frames: vehicle: 'boat' is not one of diff_drive, motor"),
        ({"signals": {"volts": "volts"}}, "from_frames: signals.volts: unknown signal"),
        (
            {"signals": {**SIGNALS, "speed": ("rpm", "1/s")}},
            "from_frames: signals.speed.unit: '1/s' is of another",
        ),
        (
            {"signals": {"speed": "rpm"}},
            "from_frames: signals: no input; one of voltage or duty or reference_speed is needed",
        ),
        ({"nominal": {"masss": 1.0}}, "from_frames: nominal.masss: "),
        ({"nominal": {"resistance": -1.0}}, "from_frames: nominal.resistance: -1.0 is outside"),
        ({"roles": {"hihg": "fit"}}, "from_frames: roles: no run 'hihg'; the runs are low, high"),
        ({"initial": {"hihg": {}}}, "from_frames: initial: no run 'hihg'; the runs are low, high"),
        ({"initial": {"high": {"spin": 1.0}}}, "from_frames: runs[1].initial.spin: unknown key; known: angle, "),
        ({"initial": {"high": 1.0}}, "from_frames: runs[1].initial: 1.0 is not a table"),
        ({"replicate_of": {"high": "high"}}, "from_frames: runs[1].replicate_of: 'high' is not another run"),
        ({"replicate_of": "low"}, "from_frames: replicate_of: 'low' is not a mapping of runs to values"),
        ({"gap_s": {"high": -1.0}}, "from_frames: runs[1].gap_s: -1.0 is outside"),
        ({"input_timing": "smooth"}, "from_frames: input_timing: 'smooth' is not one of held, linear, unknown"),
        ({"roles": {"high": "test"}}, "from_frames: runs[1].role: 'test' is not one of fit, held_out"),
    ],
)
def test_a_bad_statement_is_refused_with_its_key(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(bp.InputError, match=f"^{re.escape(message)}"):
        read(bench(), **changes)


def test_missing_cells_and_the_index_are_read() -> None:
    frame = changed(3, "rpm", None)(bench()).set_index("time")
    run = read(frame, signals={**SIGNALS, "speed": {"column": "rpm", "unit": "rpm", "noise_sd": 30.0}}).runs[1]
    assert run.outputs["speed"][4] == pytest.approx(4.0 * np.pi / 30)
    assert np.isnan(run.outputs["speed"][3])


def test_columns_with_the_names_of_signals_need_no_map() -> None:
    frame = bench().rename(columns={"volts": "voltage", "rpm": "speed"})
    dataset = bp.Dataset.from_frames({"only": frame}, vehicle="motor")
    assert list(dataset.signals) == ["time", "voltage", "speed"]
    assert dataset.to_frame()["samples"].tolist() == [50]
