"""An import divides a log into several runs. A log with too few rows for its commands gets them from a second table."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data.input_timing import InputTiming
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers.split import pauses
from brickpilot.importers.table_log import with_events
from brickpilot.importers.writer import Imported
from importing import import_table
from serial_logs import DRIVES, HEADER, MAPPING, driven, lines_of, write_log


def imported(tmp_path: Path, lines: list[str], *split: str, mapping: list[str] = MAPPING, **options: str) -> Imported:
    log = write_log(tmp_path / "log.csv", lines)
    return import_table([log], tmp_path / "set", mapping, vehicle="diff_drive", frame="FLU", split=split, **options)


def test_a_log_is_split_at_its_rests_and_keeps_some_of_them(tmp_path: Path) -> None:
    made = imported(tmp_path, [HEADER, *lines_of(driven())], "rests")
    assert made.runs == ("straight_1", "spin_1", "straight_2", "curve_1")
    runs = read(made.folder).runs
    for run, (start, end, _, _) in zip(runs, DRIVES, strict=True):
        assert start - 0.62 <= run.time[0] <= start - 0.3
        assert end + 0.5 <= run.time[-1] <= end + 1.2
        assert run.inputs["duty_left"][0] == run.inputs["duty_left"][-1] == 0.0
        assert np.any(run.inputs["duty_left"] != 0.0)
    for before, after in pairwise(runs):
        assert after.gap_s == pytest.approx(after.time[0] - before.time[-1])
    assert any("split at its rests into 4 runs" in note for note in made.notes)


def test_a_gyro_with_an_offset_and_noise_alone_shows_the_rests(tmp_path: Path) -> None:
    log = driven()
    log[:, 5] += 3.0 + np.random.default_rng(0).normal(0, 0.4, len(log))
    mapping = [entry for entry in MAPPING if "angle" not in entry]
    assert len(imported(tmp_path, [HEADER, *lines_of(log)], "rests", mapping=mapping).runs) == 4


def test_a_vehicle_that_is_still_moving_does_not_rest(tmp_path: Path) -> None:
    log = driven()
    moving = (log[:, 0] > 3000) & (log[:, 0] < 5000)
    log[moving, 3] += np.cumsum(np.full(np.count_nonzero(moving), 30.0))
    log[log[:, 0] >= 5000, 3] += 30.0 * np.count_nonzero(moving)
    assert len(imported(tmp_path, [HEADER, *lines_of(log)], "rests").runs) == 3


def test_a_log_with_rests_that_is_not_split_says_so(tmp_path: Path) -> None:
    made = imported(tmp_path, [HEADER, *lines_of(driven())])
    assert made.runs == ("log",)
    assert any("holds 4 manoeuvres with rests between them; --split rests" in note for note in made.notes)


def test_stated_spans_become_runs(tmp_path: Path) -> None:
    made = imported(tmp_path, [HEADER, *lines_of(driven())], "0.5,4", "8.5,12")
    one, two = read(made.folder).runs
    assert (one.time[0], one.time[-1], two.time[0], two.time[-1]) == (0.5, 4.0, 8.5, 12.0)
    assert two.gap_s == pytest.approx(4.5)


@pytest.mark.parametrize(
    ("split", "says"),
    [
        (("4,3",), "--split 4,3: is neither rests nor FROM,TO in s"),
        (("rest",), "--split rest: is neither"),
        (("rests", "1,2"), "--split: rests stands alone"),
        (("100,200",), "--split 100,200: holds 0 rows of a log from 0 to 15.98 s"),
    ],
)
def test_a_bad_split_is_named_and_writes_nothing(tmp_path: Path, split: tuple[str, ...], says: str) -> None:
    with pytest.raises(InputError) as caught:
        imported(tmp_path, [HEADER, *lines_of(driven())], *split)
    assert says in str(caught.value)
    assert not (tmp_path / "set").exists()


def test_a_log_without_a_manoeuvre_cannot_be_split(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--split rests: finds no manoeuvre"):
        imported(tmp_path, [HEADER, *lines_of(driven(rows=40))], "rests")


def slow_log(tmp_path: Path) -> Path:
    """Writes a log that has every fifth row of `driven`, and a second table with the commands at each change of them.

    Returns the path of the second table.
    """
    log = driven()
    shifted = log[3::5]
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(shifted)])
    events = [f"{one:.0f},{left},{right}" for start, end, a, b in DRIVES for one, left, right in
              ((start * 1000, a, b), (end * 1000, 0, 0))]  # fmt: skip
    return write_log(tmp_path / "commands.csv", ["millis,pwmL,pwmR", *events])


def test_a_slow_log_gets_its_inputs_from_a_table_of_events(tmp_path: Path) -> None:
    commands = slow_log(tmp_path)
    made = import_table(
        [tmp_path / "log.csv"], tmp_path / "set", MAPPING, vehicle="diff_drive", frame="FLU", inputs=str(commands)
    )
    run = read(made.folder).runs[0]
    measured = np.isfinite(run.raw_outputs["yaw_rate"])
    assert np.count_nonzero(measured) == 160
    np.testing.assert_allclose(np.sort(run.time[~measured]), [second for drive in DRIVES for second in drive[:2]])
    full, fast = driven(), np.searchsorted(run.time, driven()[3:-2, 0] / 1000, side="right") - 1
    np.testing.assert_allclose(run.inputs["duty_left"][fast], full[3:-2, 1] / 255)
    said = "\n".join(made.notes)
    assert "8 rows are added where an input of commands.csv changes between two rows" in said
    assert "before the first event of commands.csv the inputs are taken as 0" in said


def test_an_input_holds_until_the_next_event() -> None:
    log = {"time": np.array([0.0, 10, 20, 30]), "duty": np.full(4, 9.0), "speed": np.arange(4.0)}
    events = {"time": np.array([-5.0, 5, 10, 28, 40]), "duty": np.array([1.0, 2, np.nan, 4, 5])}
    joined = with_events(log, events)
    np.testing.assert_array_equal(joined["time"], [0, 5, 10, 20, 28, 30])
    np.testing.assert_array_equal(joined["duty"], [1, 2, np.nan, np.nan, 4, 4])
    np.testing.assert_array_equal(joined["speed"], [0, np.nan, 1, 2, np.nan, 3])


@pytest.mark.parametrize("timing", ["held", "linear", "unknown"])
def test_the_timing_of_inputs_is_stated_in_the_data_set(tmp_path: Path, timing: InputTiming) -> None:
    made = imported(tmp_path, [HEADER, *lines_of(driven())], input_timing=timing)
    dataset = read(made.folder)
    assert dataset.input_timing == timing
    assert dataset.runs[0].time.size == 800 + (3 * 2 * len(DRIVES) if timing == "linear" else 0)
    assert any("is not known: they are taken as held" in note for note in made.notes) == (timing == "unknown")


@pytest.mark.parametrize(
    ("commands", "says"),
    [
        ("ms,pwmL,pwmR\n0,1,1\n9,1,1\n", "commands.csv:1: time: no column 'millis'"),
        ("millis,pwmL\n0,1\n9,1\n", "commands.csv:1: duty_right: no column 'pwmR' among millis, pwmL; did you mean"),
        ("millis,pwmL,pwmR\n5000,1,1\n5001,1,1\n0,1,1\n1,1,1\n", "commands.csv: its clock starts again"),
    ],
)
def test_a_bad_table_of_inputs_is_named(tmp_path: Path, commands: str, says: str) -> None:
    slow_log(tmp_path).write_text(commands)
    with pytest.raises(InputError) as caught:
        import_table(
            [tmp_path / "log.csv"], tmp_path / "set", MAPPING, vehicle="diff_drive",
            inputs=str(tmp_path / "commands.csv"),
        )  # fmt: skip
    assert says in str(caught.value)
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("split", [(), ("rests",)])
def test_a_pause_of_the_logger_in_motion_begins_a_new_run(split: tuple[str, ...], tmp_path: Path) -> None:
    """A new run begins after the pause: the inputs in the pause are unknown, so no run may contain it."""
    log = driven()
    middle = (DRIVES[0][0] + DRIVES[0][1]) / 2
    log[log[:, 0] > 1000 * middle, 0] += 12_000
    made = imported(tmp_path, [HEADER, *lines_of(log)], *split)
    first, second = read(made.folder).runs[:2]
    assert first.time[-1] == pytest.approx(middle, abs=0.05)
    assert second.time[0] == pytest.approx(middle + 12, abs=0.05)
    assert second.gap_s == pytest.approx(12, abs=0.05)
    assert any("pauses between its rows: 1, of 12 s at most; a new run begins behind each" in one for one in made.notes)


def test_a_log_of_changes_alone_has_no_pause() -> None:
    """A log with a row at each change has no pause, although most rows are seconds apart and a few close together."""
    changes = np.cumsum(np.random.default_rng(1).uniform(1.0, 6.0, 200))
    assert pauses(np.sort(np.concatenate([changes, changes[::10] + 0.01]))) == []
    assert pauses(np.array([0.0])) == pauses(np.array([0.0, 5.0])) == []
    rows = np.arange(0.0, 0.3, 0.01)
    assert pauses(np.concatenate([rows, rows + 0.8, rows + 2.2, rows])) == [
        60
    ]  # only the pause of 1.1 s counts, not the hole of 0.5 s or the clock that starts again
