"""All that a row of a campaign depends on is part of the campaign's identity: after a change the folder is refused."""

from __future__ import annotations

import dataclasses
from importlib import metadata
from pathlib import Path

import pytest
from brickpilot.campaign import designs, file, store, workers
from brickpilot.campaign.run_campaign import run_campaign
from brickpilot.errors import InputError
from brickpilot.vehicle import compensation, model
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import rcx
from test_campaign import SHORT

TEXT = """[campaign]
name = "own"
runs = 2
scenario = "short.toml"
sensors = "imu+encoders"
model = "model.toml"
gains = "gains.toml"
compensation = "compensation.toml"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "own.toml").write_text(TEXT)
    (tmp_path / "short.toml").write_text(SHORT)
    heavy = dataclasses.replace(rcx(), parameters={**rcx().parameters, "resistance": 11.0})
    model.save(heavy, tmp_path / "model.toml")
    made = compensation.from_model(heavy)
    assert made is not None
    made.save(tmp_path / "compensation.toml")
    Gains("own", {"heading_kp": 200}).save(tmp_path / "gains.toml")
    return tmp_path


def conducted(folder: Path) -> None:
    run_campaign(file.load(folder / "own.toml"), folder / "found", workers.Here(), lambda *_: None, "")


def changed(folder: Path, name: str) -> None:
    """Changes one number of one file."""
    path = folder / name
    if name == "model.toml":
        model.save(
            dataclasses.replace(model.load(path), parameters={**model.load(path).parameters, "mass": 0.91}), path
        )
    elif name == "gains.toml":
        Gains("own", {"heading_kp": 201}).save(path)
    elif name == "compensation.toml":
        known = compensation.load(path)
        first = next(key for key, raw in known.raw.items() if raw > 1)
        dataclasses.replace(known, raw={**known.raw, first: known.raw[first] - 1}).save(path)
    elif name == "short.toml":
        path.write_text(SHORT.replace("0.2]", "0.21]"))
    else:
        path.write_text(TEXT + "[vary]\nparameter.mass = 0.9\n")


@pytest.mark.parametrize("name", ["own.toml", "short.toml", "model.toml", "gains.toml", "compensation.toml"])
def test_a_folder_is_refused_when_a_file_has_another_number(name: str, folder: Path) -> None:
    conducted(folder)
    conducted(folder)  # without a change the campaign continues
    changed(folder, name)
    with pytest.raises(InputError, match="holds another campaign"):
        conducted(folder)


@pytest.mark.parametrize("library", ["numpy", "scipy", "pyarrow"])
def test_a_folder_is_refused_when_a_library_has_another_version(
    library: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    conducted(folder)
    other = dataclasses.replace(store.versions_here(), **{library: "0.0"})
    monkeypatch.setattr(store, "versions_here", lambda: other)
    with pytest.raises(InputError, match=f"was begun with {library} .*, not 0.0"):
        conducted(folder)


def test_neighbouring_large_seeds_are_two_seeds(folder: Path) -> None:
    seeds = []
    for seed in (2**60, 2**60 + 1):
        (folder / "own.toml").write_text(TEXT + f"seed = {seed}\n")
        seeds.append(file.load(folder / "own.toml").seed)
    assert seeds == [2**60, 2**60 + 1]


def test_a_design_of_salib_depends_on_its_version(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = TEXT.replace("runs = 2", 'design = "morris"\ntrajectories = 2') + "[vary]\nparameter.mass = [0.8, 0.9]\n"
    (folder / "own.toml").write_text(text)
    conducted(folder)
    assert designs.made_by(file.load(folder / "own.toml")) == metadata.version("SALib")
    monkeypatch.setattr(designs, "version", lambda _: "0.0")
    with pytest.raises(InputError, match="holds another campaign"):
        conducted(folder)
