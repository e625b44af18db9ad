"""Each bad data set is refused with one line that names the place of the fault, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from bad_datasets import BAD, Bad, make_motor, write_good
from brickpilot.data.reading import read
from brickpilot.errors import InputError


def test_the_unspoilt_data_set_is_read(tmp_path: Path) -> None:
    assert [run.name for run in read(write_good(tmp_path)).runs] == ["straight", "spin"]


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    path = write_good(tmp_path) / "dataset.toml"
    path.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert read(tmp_path).name == "bench-7"


def test_the_unspoilt_motor_data_set_is_read(tmp_path: Path) -> None:
    make_motor(write_good(tmp_path))
    assert read(tmp_path).nominal["force_per_volt"].value == 35.15


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.name.replace(" ", "_"))
def test_a_bad_data_set_is_refused_with_its_place(bad: Bad, tmp_path: Path) -> None:
    folder = bad.write(tmp_path / "set")
    before = sorted(folder.iterdir())
    with pytest.raises(InputError) as caught:
        read(folder)
    message = str(caught.value)
    assert message.startswith(bad.place(folder) + " "), message
    assert bad.says in message.removeprefix(bad.place(folder))
    assert len(message.splitlines()) == 1
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("name", ["nowhere", "plain.txt/dataset.toml"])
def test_a_place_that_is_no_data_set_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "plain.txt").write_text("")
    with pytest.raises(InputError, match="no such data set"):
        read(tmp_path / name)


def test_the_table_is_long_enough_and_its_names_are_unique() -> None:
    assert len({bad.name for bad in BAD}) == len(BAD) >= 45
