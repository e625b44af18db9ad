"""Tables are imported as loggers write them; each omission and change is counted and reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from brickpilot.data.reading import read
from brickpilot.data.rows import CsvFormat, read_columns
from brickpilot.errors import InputError
from brickpilot.importers.table_log import resets, unwrap
from brickpilot.importers.text_table import read_table
from brickpilot.importers.writer import Imported
from command import brickpilot
from importing import import_table
from serial_logs import COUNTS, HEADER, MAPPING, driven, lines_of, write_log


def imported(tmp_path: Path, lines: list[str], **options: object) -> Imported:
    log = write_log(tmp_path / "log.csv", lines)
    return import_table([log], tmp_path / "set", MAPPING, vehicle="diff_drive", frame="FLU", **options)  # type: ignore[arg-type]


def test_the_commonest_log_comes_in_with_one_command(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(driven())])
    maps = [word for entry in MAPPING for word in ("--map", entry)]
    done = brickpilot(
        "import", "table", "log.csv", "--vehicle", "diff_drive", "--frame", "FLU", *maps, "--out", "set", cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    run = read(tmp_path / "set").runs[0]
    log = driven()
    np.testing.assert_allclose(run.time, log[:, 0] / 1000)
    np.testing.assert_allclose(run.inputs["duty_left"], log[:, 1] / 255)
    np.testing.assert_allclose(run.raw_outputs["wheel_angle_right"], log[:, 4] / COUNTS * 2 * np.pi)
    np.testing.assert_allclose(run.raw_outputs["yaw_rate"], -np.radians(log[:, 5]))


def test_what_a_serial_monitor_adds_is_skipped_and_counted(tmp_path: Path) -> None:
    rows = lines_of(driven())
    rows[99] = rows[99][:14]
    rows[199] = rows[199].replace(",", "\ufffd", 2)
    rows[399] = rows[399].replace("0.1", "0.x")
    rows[499] = "4" + rows[499].replace("-0.2", "-0.2.5")
    lines = ["0.1,-0.3,0.0", "Booting v1.2", "IMU ok, calibrating", HEADER, *rows[:300], HEADER, *rows[300:]]
    path = write_log(tmp_path / "log.csv", lines)
    path.write_bytes(path.read_bytes() + b"430,12,1")
    made = import_table([path], tmp_path / "set", MAPPING, vehicle="diff_drive", frame="FLU")
    run = read(made.folder).runs[0]
    assert run.time.size == 797  # of 800 rows; cells of columns that no signal uses may hold anything
    kept = np.delete(driven(), [99, 199, 499], axis=0)
    np.testing.assert_allclose(run.inputs["duty_left"], kept[:, 1] / 255)
    said = "\n".join(made.notes)
    assert "3 lines before the first row are skipped, the first is '0.1,-0.3,0.0'" in said
    assert "1 repeated headers are left out, the first is line 305" in said
    assert "2 broken lines are left out, the first is line 104" in said
    assert "cells that are no numbers" not in said  # a repeated header counts once
    assert "1 rows have a time out of line with the rows around them and are left out, the first is line 505" in said
    assert "line 806 is the last and has no end" in said


def test_a_cell_of_a_used_column_that_is_no_number_leaves_its_row_out(tmp_path: Path) -> None:
    rows = lines_of(driven())
    rows[10] = rows[10].replace(",-0.2,0.00", ",-0.2,0.x0")
    made = imported(tmp_path, [HEADER, *rows])
    assert read(made.folder).runs[0].time.size == 799
    assert any(
        "1 rows with cells that are no numbers are left out, the first is line 12" in note for note in made.notes
    )


TABLES = {
    "decimal commas": "t;u;w\n0,0;1,5;2\n0,1;2,5;3\n0,2;-2,5;nan\n",
    "tabs": "t\tu\tw\n0\t1.5\t2\n0.1\t2.5\t3\n0.2\t-2.5\t\n",
    "blanks": "# a log\n# t u w\n  0   1.5 2\n0.1\t2.5 3\n0.2 -2.5   nan\n",
    "bars": "t | u | w\n0 | 1.5 | 2\n0.1 | 2.5 | 3\n0.2 | -2.5 | \n",
    "a line of units": "t,u,w\ns,V,rad/s\n0,1.5,2\n0.1,2.5,3\n0.2,-2.5,\n",
    "quotes": '"t","u","w, x","w"\r\n"0","1.5","a, b","2"\r\n"0.1","2.5","c","3"\r\n"0.2","-2.5","d",""\r\n',
    "a delimiter at the end": "t,u,w,\n0,1.5,2,\n0.1,2.5,3,\n0.2,-2.5,,\n",
    "times of day": "12:30:01.1 -> t,u,w\n12:30:01.2 -> 0,1.5,2\n12:30:01.3 -> 0.1,2.5,3\n12:30:01.4 -> 0.2,-2.5,\n",
    "text beside": "mode,t,u,w\nGO,0,1.5,2\nGO,0.1,2.5,3\nSTOP,0.2,-2.5,\n",
    "blank lines and comments": "t,u,w\n\n0,1.5,2\n# half way\n\n0.1,2.5,3\n0.2,-2.5,\n\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("kind", TABLES)
def test_layouts_are_found(tmp_path: Path, kind: str, encoding: str) -> None:
    (tmp_path / "a.txt").write_bytes(TABLES[kind].encode(encoding))
    import_table([tmp_path / "a.txt"], tmp_path / "set", ["time=t", "voltage=u", "speed=w"], vehicle="motor")
    run = read(tmp_path / "set").runs[0]
    np.testing.assert_array_equal(run.time, [0, 0.1, 0.2])
    np.testing.assert_array_equal(run.inputs["voltage"], [1.5, 2.5, -2.5])
    np.testing.assert_array_equal(run.raw_outputs["speed"], [2, 3, np.nan])


@pytest.mark.parametrize(
    ("content", "mapping", "says"),
    [
        ("hello\nworld\n", ["time=t"], "a.csv: holds no rows of data"),
        ("", ["time=t"], "a.csv: is empty"),
        ("t,u,u\n0,1,2\n1,2,3\n", ["time=t"], "a.csv:1: u: column occurs more than once"),
        ("t,u,w\n0,GO,2\n1,STOP,3\n", ["time=t", "voltage=u", "speed=w"], "a.csv:2: voltage (column u): 'GO' is not"),
        ("t,u,w\n0,1,2\n1,2,3\n", ["time=t", "voltage=U", "speed=w"], "a.csv:1: voltage: no column 'U' among"),
        ("t,u,w\n0,1,2\n1,2\n1,2\n2,2,3\n", ["time=t"], "a.csv:3: is no row of the table, as 2 of 4 lines"),
        ("t,u,w\n0,1,2\n1,2,3\n", ["time=t", "voltage=1/(u-1)", "speed=w"], "a.csv: voltage: '1/(u-1)' is no number"),
        ("t,u,w\n0,1,2\n1,2,3\n", ["time=t", "voltage=u*", "speed=w"], "--map voltage=u*: is no formula: it ends"),
    ],
)
def test_a_bad_table_is_named_by_line_and_field(tmp_path: Path, content: str, mapping: list[str], says: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    maps = [word for entry in mapping for word in ("--map", entry)]
    done = brickpilot("import", "table", "a.csv", "--vehicle", "motor", *maps, "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert says in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv"]


@pytest.mark.parametrize(("bits", "signed"), [(16, False), (16, True), (32, False), (32, True)])
def test_counters_and_clocks_are_counted_on_where_they_overflow(tmp_path: Path, bits: int, signed: bool) -> None:
    log, span = driven(), 2.0**bits
    low = -span / 2 if signed else 0.0
    wrapped = log.copy()
    for column, start in ((0, -8000), (3, -700), (4, -300)):
        wrapped[:, column] = (log[:, column] + start) % span + low
    made = imported(tmp_path, [HEADER, *lines_of(wrapped)])
    run = read(made.folder).runs[0]
    np.testing.assert_allclose(run.time - run.time[0], log[:, 0] / 1000)
    for side, column in (("left", 3), ("right", 4)):
        angle = run.raw_outputs[f"wheel_angle_{side}"]
        np.testing.assert_allclose(angle - angle[0], (log[:, column] - log[0, column]) / COUNTS * 2 * np.pi, atol=1e-6)
    kind = f"{'signed' if signed else 'unsigned'} {bits}-bit"
    assert sum(f"is a counter, {kind}, that overflows" in note for note in made.notes) >= 2


@pytest.mark.parametrize(
    "counts",
    [
        [100, 140, 180, 60000, 60040, 60080],  # the jump does not lead to an end of the range
        [65000, 65040, 65080, 0, 40, 80],  # reset to 0 far from the end of the range
        [0, 0, 0, 65535, 65535, 0.5],  # no whole numbers
        [4000, 4040, 4080, 24, 64, 104],  # one jump by the range of an angle sensor: it may be real
        [30000, 30040, 0, 30120, 30160, 30200],  # one lost reading
        [1, 40000, 3, 40000, 5, 40000],  # steps as large as half the range
    ],
)
def test_a_jump_that_may_be_real_is_not_unwrapped(counts: list[float]) -> None:
    values = np.array(counts, dtype=np.float64)
    found = unwrap(values)
    np.testing.assert_array_equal(found.values, values)
    assert not found.rows


def test_an_angle_sensor_that_overflows_again_and_again_is_counted_on() -> None:
    true = np.cumsum(np.full(200, 150.0))
    found = unwrap(true % 4096)
    np.testing.assert_array_equal(found.values, true)
    assert (found.kind, len(found.rows)) == ("unsigned 12-bit", 7)


@pytest.mark.parametrize(("low", "unit"), [(0.0, "deg"), (-180.0, "deg"), (-np.pi, "rad")])
def test_a_heading_goes_on_where_it_jumps_by_a_turn(tmp_path: Path, low: float, unit: str) -> None:
    turn = 360.0 if unit == "deg" else 2 * np.pi
    log = driven()
    heading = np.cumsum(log[:, 5]) * 0.02 * turn / 360
    log[:, 5] = np.round((heading - low) % turn + low, 2)
    made = import_table(
        [write_log(tmp_path / "log.csv", [HEADER, *lines_of(log)])], tmp_path / "set",
        [*MAPPING[:5], f"yaw_angle=gz:{unit}"], vehicle="diff_drive", frame="FLU",
    )  # fmt: skip
    yaw = -read(made.folder).runs[0].raw_outputs["yaw_angle"] * turn / (2 * np.pi)
    np.testing.assert_allclose(yaw - yaw[0], heading - heading[0], atol=0.02)
    assert any("yaw_angle jumps by a turn" in note for note in made.notes)


def test_a_counter_that_is_set_to_0_starts_a_run(tmp_path: Path) -> None:
    log = driven()
    log[450:, 3:5] -= log[450, 3:5]
    made = imported(tmp_path, [HEADER, *lines_of(log)])
    assert made.runs == ("part_1", "part_2")
    assert [run.time.size for run in read(made.folder).runs] == [450, 350]
    assert any("is set to 0 in line 452: a new run begins there" in note for note in made.notes)


def test_a_reading_of_0_that_comes_back_is_no_reset() -> None:
    values = np.cumsum(np.full(100, 40.0))
    values[50:52] = 0.0
    assert resets(values) == []
    values[50:] = np.arange(50) * 40.0
    assert resets(values) == [50]


def test_a_logger_that_starts_again_starts_a_run(tmp_path: Path) -> None:
    lines = lines_of(driven())
    made = imported(tmp_path, [HEADER, *lines[:500], "boot", HEADER, *lines[:300]])
    assert [run.time.size for run in read(made.folder).runs] == [500, 300]
    assert any("time starts again in line 504" in note for note in made.notes)


def test_a_header_below_the_first_rows_is_found(tmp_path: Path) -> None:
    lines = lines_of(driven())
    made = imported(tmp_path, [*lines[400:500], HEADER, *lines[:300]])
    assert [run.time.size for run in read(made.folder).runs] == [100, 300]


def test_stamps_that_stand_still_or_are_misread_are_left_out(tmp_path: Path) -> None:
    log = driven()
    log[100, 0] = log[99, 0]
    log[200, 0] = 7
    log[300, 0] += 1e6
    made = imported(tmp_path, [HEADER, *lines_of(log)])
    assert read(made.folder).runs[0].time.size == 797
    assert any("1 rows have the time of the row before" in note and "line 102" in note for note in made.notes)
    assert any("2 rows have a time out of line" in note and "line 202" in note for note in made.notes)


def test_a_first_row_whose_time_was_cut_is_left_out(tmp_path: Path) -> None:
    log = driven()
    log[:, 0] += 123_000
    lines = lines_of(log)
    lines[0] = lines[0][3:]
    log_file = write_log(tmp_path / "log.csv", lines)
    mapping = ["time=0:ms", "duty_left=c1/255", "duty_right=c2/255", "yaw_rate=7:deg/s"]
    run = read(import_table([log_file], tmp_path / "set", mapping, vehicle="diff_drive").folder).runs[0]
    assert (run.time.size, run.time[0]) == (799, pytest.approx(123.02))


def test_numbers_of_a_file_are_those_that_python_reads(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    cells = [
        [repr(float(one)) for one in row] for row in (rng.normal(size=(500, 3)) * 10.0 ** rng.integers(-9, 9, (500, 3)))
    ]
    cells[7][1], cells[8][2], cells[9][0] = "", "+1.5E3", "17"
    text = "a,b,c\n" + "\n".join(map(",".join, cells)) + "\n"
    columns = {"x": "c", "y": "b"}
    for written in (text, text.replace("\n17,", '\n"17",'), text.replace("\n", "\r\n")):
        (tmp_path / "a.csv").write_bytes(written.encode())
        found = read_columns(tmp_path / "a.csv", columns, CsvFormat())
        for name, position in (("x", 2), ("y", 1)):
            np.testing.assert_array_equal(found.values[name], [float(row[position] or "nan") for row in cells])
        assert list(found.lines) == list(range(2, 502))
    for bad, says in (
        ("1,2", "has 2 cells instead of 3"),
        ("1,2,3,4", "has 4 cells instead of 3"),
        ("", "has 0 cells instead of 3"),
        ("1,x,2", "y (column b): 'x' is not a number"),
        ("1,2e,3", "y (column b): '2e' is not a number"),
        ("1,--2,3", "y (column b): '--2' is not a number"),
        ("1,+-2,3", "y (column b): '+-2' is not a number"),
        ("1,2-3,3", "y (column b): '2-3' is not a number"),
        ("1,2,nan", "x (column c): 'nan' is not a number"),
        ("1,2,inf", "x (column c): 'inf' is not a number"),
        ("1,-,2", "y (column b): '-' is not a number"),
        ("1,\u0663,2", "y (column b): '\u0663' is not a number"),
    ):
        (tmp_path / "a.csv").write_text(text + bad + "\n1,2,3\n", encoding="utf-8")
        with pytest.raises(InputError) as caught:
            read_columns(tmp_path / "a.csv", columns, CsvFormat())
        assert f"a.csv:502: {says}" in str(caught.value), bad


def test_a_cell_of_a_column_with_decimal_commas_that_is_no_number_leaves_only_its_row_out(tmp_path: Path) -> None:
    rows = [f"{0.1 * k:.1f};{k},5;{k}.25" for k in range(10)]
    rows[3] = "0.3;3,5,5;3.25"
    rows[4] = "0.4;4.5;'.25"
    table = read_table(write_log(tmp_path / "log.csv", ["t;u;w", *rows]))
    (u, wrong), (w, damaged) = table.column("voltage", "u"), table.column("speed", "w")
    assert (np.flatnonzero(wrong).tolist(), np.flatnonzero(damaged).tolist()) == ([3, 4], [4])
    np.testing.assert_array_equal(u[5:], np.arange(5, 10) + 0.5)
    np.testing.assert_array_equal(w[5:], np.arange(5, 10) + 0.25)


@pytest.mark.parametrize("text", ["t,u\n0,1", "0,1\n", "0 1"])
def test_a_header_without_rows_holds_no_rows(tmp_path: Path, text: str) -> None:
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError, match=r"log\.csv: holds no rows of data"):
        read_table(tmp_path / "log.csv", header=True)


def test_a_row_that_lacks_the_delimiter_at_its_end_is_a_row(tmp_path: Path) -> None:
    rows = [f"{k}\t1.5\t\t" for k in range(20)]
    rows[7] = "7\t1.5\t2"
    table = read_table(write_log(tmp_path / "log.txt", ["t\tu\tw\t", *rows]))
    assert table.names == ("t", "u", "w")
    np.testing.assert_array_equal(table.column("time", "t")[0], np.arange(20))
    np.testing.assert_array_equal(np.flatnonzero(~np.isnan(table.column("speed", "w")[0])), [7])


def test_a_column_of_words_for_true_and_false_is_1_and_0(tmp_path: Path) -> None:
    table = read_table(write_log(tmp_path / "log.csv", ["t,u,on", "0,1,True", "1,2,False", "2,3,True"]))
    np.testing.assert_array_equal(table.column("voltage", "on")[0], [1, 0, 1])
