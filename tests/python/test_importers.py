"""Logs of other tools become data sets that read back as what was logged; bad logs leave nothing behind."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers.mapping import parse_mapping, parse_nominal
from brickpilot.importers.text_table import read_table
from importing import import_matlab, import_table, import_wpilib
from other_logs import old_log, write_json
from test_import_matlab import MAPPING


def test_tables_become_runs_of_a_data_set(tmp_path: Path) -> None:
    for name, sign in (("go", 1), ("back", -1)):
        (tmp_path / f"{name}.txt").write_text("".join(f"  {k}   {sign * 3}\t{sign * k * 90}\n" for k in range(5)))
    mapping = ["time=0:ms", "voltage=1", "angle=2:deg"]
    imported = import_table(
        [tmp_path / "go.txt", tmp_path / "back.txt"],
        tmp_path / "set",
        mapping,
        vehicle="motor",
        delimiter=" ",
        name="n",
    )
    dataset = read(imported.folder)
    assert [run.name for run in dataset.runs] == ["go", "back"]
    np.testing.assert_allclose(dataset.runs[1].outputs["angle"], -np.arange(5) * math.pi / 2)
    np.testing.assert_allclose(dataset.runs[1].time, np.arange(5) * 1e-3)


def test_a_table_with_a_header_is_mapped_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t;v left;v right;r\n0;1;2;90\n1;;2;90\n")
    mapping = ["time=t", "voltage_left=v left", "voltage_right=v right", "yaw_rate=r:deg/s"]
    out = tmp_path / "set"
    import_table([tmp_path / "a.csv"], out, mapping, vehicle="diff_drive", frame="FLU", delimiter=";", header=True)
    run = read(out).runs[0]
    np.testing.assert_array_equal(run.inputs["voltage_left"], [1.0, math.nan])
    np.testing.assert_allclose(run.outputs["yaw_rate"], -math.pi / 2)


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        (["time"], "--map time: is not SIGNAL"),
        (["time=0", "speed=1:furlong"], "--map speed=1:furlong: unknown unit"),
        (["time=0", "spin=1"], "--map spin=1: unknown signal"),
        (["time=0", "time=1"], "--map time=1: time is mapped already"),
        (["voltage=0"], "--map: time is not mapped"),
        (["time=0", "voltage=v"], "--map voltage: v is not a column number"),
        (["time=0", "voltage=9"], "a.csv:1: voltage: no column 9"),
        (["time=0", "voltage=1"], "a.csv: makes no valid data set: dataset.toml:6: signals: no output"),
        (["time=1", "voltage=0", "speed=2"], "a.csv: makes no valid data set: a.csv:3: time: does not increase"),
    ],
)
def test_a_mapping_that_makes_no_data_set_is_named_and_leaves_nothing(
    tmp_path: Path, mapping: list[str], says: str
) -> None:
    (tmp_path / "a.csv").write_text("0,1,2\n1,1,2\n")
    with pytest.raises(InputError) as caught:
        import_table([tmp_path / "a.csv"], tmp_path / "set", mapping, vehicle="motor")
    assert says in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv"]


def test_nominal_options_are_numbers() -> None:
    assert parse_nominal(["mass=0.6", "resistance=22"]) == {"mass": 0.6, "resistance": 22.0}
    for entry in ("mass", "mass=heavy", "=1", "mass=inf"):
        with pytest.raises(InputError, match="NAME=NUMBER"):
            parse_nominal([entry])


def test_a_unit_left_out_is_the_si_unit() -> None:
    assert parse_mapping(["time=t", "speed=w"])["speed"].unit == "rad/s"


def test_an_unknown_nominal_parameter_is_named(tmp_path: Path) -> None:
    file = write_json(tmp_path / "log.json", old_log())
    with pytest.raises(InputError, match=r"nominal\.weight: unknown nominal parameter"):
        import_wpilib([file], tmp_path / "set", nominal={"weight": 1.0})
    assert not (tmp_path / "set").exists()


def test_what_is_there_already_is_not_overwritten(tmp_path: Path) -> None:
    file = write_json(tmp_path / "log.json", old_log())
    (tmp_path / "set").mkdir()
    import_wpilib([file], tmp_path / "set")  # an empty folder may be filled
    before = (tmp_path / "set" / "dataset.toml").read_bytes()
    for out in (tmp_path / "set", file):
        with pytest.raises(InputError, match="exists already"):
            import_wpilib([file], out)
    assert (tmp_path / "set" / "dataset.toml").read_bytes() == before


def test_missing_files_and_doubled_names_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nil\.json: no such file"):
        import_wpilib([tmp_path / "nil.json"], tmp_path / "set")
    with pytest.raises(InputError, match=r"nil\.mat: no such file"):
        import_matlab([tmp_path / "nil.mat"], tmp_path / "set", MAPPING, vehicle="motor")
    with pytest.raises(InputError, match="two files would both make run 'a'"):
        import_table([tmp_path / "a.csv", tmp_path / "b" / "a.csv"], tmp_path / "set", ["time=0"], vehicle="motor")
    with pytest.raises(InputError, match="no file to import"):
        import_table([], tmp_path / "set", ["time=0"], vehicle="motor")


@pytest.mark.parametrize("delimiter", ["tab", r"\t", "\t"])
def test_a_tab_may_be_spelt_out(delimiter: str, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0\t1\t2\n1\t1\t3\n", encoding="utf-8")
    mapping = ["time=0", "voltage=1", "speed=2"]
    imported = import_table([tmp_path / "a.txt"], tmp_path / "set", mapping, vehicle="motor", delimiter=delimiter)
    np.testing.assert_array_equal(read(imported.folder).runs[0].outputs["speed"], [2.0, 3.0])


def test_a_delimiter_that_is_none_is_refused_with_the_spellings_of_a_tab(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--delimiter: 'tabs' is not one of .*tab or \\t"):
        import_table([tmp_path / "a.txt"], tmp_path / "set", ["time=0"], vehicle="motor", delimiter="tabs")


@pytest.mark.parametrize("digits", [309, 400, 4300, 5000])
def test_a_cell_of_hundreds_of_digits_is_no_number(digits: int, tmp_path: Path) -> None:
    """pandas reads such a cell as an integer that is too large for a double."""
    rows = [f"{0.01 * row:.2f},{row}" for row in range(30)]
    rows[27] = f"0.27,{'9' * digits}"
    (tmp_path / "log.csv").write_text("\n".join(["t,v", *rows]) + "\n")
    table = read_table(tmp_path / "log.csv")
    values, wrong = table.column("voltage", "v")
    assert list(np.flatnonzero(wrong)) == [27]
    assert math.isnan(values[27])
    assert values[26] == 26
