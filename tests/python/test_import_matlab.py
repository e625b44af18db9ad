"""MATLAB files of each version become data sets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from brickpilot.data.dataset import motor_inputs
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers import mat_file, matlab
from importing import import_matlab
from scipy.io import savemat

SAMPLES = np.arange(50) * 0.01


MAPPING = ["time=t", "voltage=u:V", "position=log.q[1]:mm"]


def mat_content() -> dict[str, Any]:
    return {"t": SAMPLES, "u": np.cos(SAMPLES), "log": {"q": np.column_stack([SAMPLES, 1000 * SAMPLES**2])}}


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = SAMPLES[np.newaxis, :]
        file["u"] = np.cos(SAMPLES)[:, np.newaxis]
        file["log/q"] = np.column_stack([SAMPLES, 1000 * SAMPLES**2]).T
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


MAT_WRITERS: dict[str, Callable[[Path], None]] = {
    "v5": lambda path: savemat(path, mat_content(), do_compression=False),
    "v7": lambda path: savemat(path, mat_content(), do_compression=True, oned_as="column"),
    "v7.3": write_hdf5,
}


@pytest.mark.parametrize("version", MAT_WRITERS)
def test_a_mat_file_becomes_a_data_set(tmp_path: Path, version: str) -> None:
    MAT_WRITERS[version](tmp_path / "run1.mat")
    imported = import_matlab(
        [tmp_path / "run1.mat"], tmp_path / "set", MAPPING, vehicle="motor", nominal={"force_per_volt": 35.15}
    )
    dataset = read(imported.folder)
    assert (dataset.name, imported.runs) == ("set", ("run1",))
    np.testing.assert_array_equal(dataset.runs[0].time, SAMPLES)
    np.testing.assert_allclose(dataset.runs[0].outputs["position"], SAMPLES**2)
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset)[:, 0], np.cos(SAMPLES))


def test_nan_in_a_mat_file_becomes_a_blank(tmp_path: Path) -> None:
    content = mat_content()
    content["u"][3] = np.nan
    savemat(tmp_path / "a.mat", content)
    run = read(import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor").folder).runs[0]
    assert np.flatnonzero(np.isnan(run.inputs["voltage"])).tolist() == [3]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("position=x", "a.mat: position: no variable 'x' among"),
        ("position=log.z", "a.mat: position: no variable 'log.z'"),
        ("position=log.q", "is a matrix; name a column"),
        ("position=log.q[2]", "has no column 2"),
        ("position=log", "not a vector or matrix of real"),
        ("position=word", "not a vector or matrix of real"),
        ("position=short", "has 3 values where time has 50"),
        ("position=far", "infinite"),
    ],
)
def test_a_mat_variable_that_cannot_be_a_signal_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: str, says: str
) -> None:
    monkeypatch.setattr(matlab, "load", mat_file.parse)  # parses in this process, which saves time
    more = {"word": "abc", "short": np.ones(3), "far": np.where(SAMPLES > 0.2, np.inf, 0.0)}
    savemat(tmp_path / "a.mat", {**mat_content(), **more})
    with pytest.raises(InputError) as caught:
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", [*MAPPING[:2], entry], vehicle="motor")
    assert says in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mat"]


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0 MAT-file", b"\x00" * 600, b"junk" * 300])
def test_a_file_that_is_no_mat_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mat: (is not a readable \.mat file|time: no variable)"):
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor")


@pytest.mark.parametrize(("version", "at"), [("v5", 128), ("v5", 145), ("v7", 150), ("v7.3", 520)])
def test_a_damaged_mat_file_is_refused_even_where_it_crashes_the_reader(tmp_path: Path, version: str, at: int) -> None:
    MAT_WRITERS[version](tmp_path / "a.mat")
    content = bytearray((tmp_path / "a.mat").read_bytes())
    content[at] ^= 0xFF  # byte 145 of v5 makes scipy 1.17 crash
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mat: is not a readable \.mat file"):
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor")
    assert not (tmp_path / "set").exists()
