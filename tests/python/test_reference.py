"""The docstring of a module that reads a user's file is the file's manual: it names each key, and its example works."""

from __future__ import annotations

import importlib
import re
import textwrap
from pathlib import Path
from typing import Any

import pytest
import reference
import tomlkit
from brickpilot.campaign import file as campaign
from brickpilot.data import description
from brickpilot.data.toml_file import TomlFile
from brickpilot.vehicle import compensation, gains, model, scenario

KEYS: dict[str, set[str]] = {
    "data.description": {*description._TOP, *description._SIGNAL, *description._RUN, "sampling"},
    "vehicle.model": {*model._TOP_KEYS, *model._ENTRY_KEYS},
    "vehicle.scenario": set(scenario._KEYS),
    "campaign.file": {*campaign._KEYS, *campaign.COUNTS, *campaign.COUNTS.values()},
    "vehicle.gains": {"value", "unit", "raw", "gains"},
    "vehicle.compensation": {"name", "left_out", "limited", "remarks", "parameters", "raw", "format", "from"},
}
READERS: dict[str, Any] = {
    "data.description": lambda path: description.describe(TomlFile(path)).dataset,
    "vehicle.model": model.load,
    "vehicle.scenario": scenario.load,
    "vehicle.gains": gains.load,
    "vehicle.compensation": compensation.load,
}


def manual(name: str) -> str:
    return importlib.import_module(f"brickpilot.{name}").__doc__ or ""


def example(text: str) -> str:
    """Returns the indented lines of a manual."""
    lines = [line for line in text.splitlines() if not line or line.startswith("    ")]
    return textwrap.dedent("\n".join(lines))


@pytest.mark.parametrize("name", reference.FILES)
def test_the_manual_of_a_file_names_every_key(name: str) -> None:
    assert KEYS[name] - set(re.findall(r"\w+", manual(name))) == set()


@pytest.mark.parametrize("name", READERS)
def test_the_example_of_a_file_is_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "straight_half.csv").write_text("t_s,v_left,v_right,yaw_rate\n0,0,0,0\n")
    path = tmp_path / "file.toml"
    path.write_text(example(manual(name)))
    assert READERS[name](path).name == tomlkit.parse(path.read_text())["name"]


def test_the_pages_of_files_and_of_the_verdict_show_what_their_sources_hold() -> None:
    files = reference.files_page()
    for name in reference.FILES:
        assert all(line in files for line in example(manual(name)).splitlines())
    assert "| `wheel_angle_left` | output | rad | diff_drive, skid_steer |" in files
    assert "| `dataflash` | .bin |" in files
    verdict = reference.verdict_page()
    assert "| `proof.draws` | How often stretches of the held-out runs" in verdict
    assert "See [effect](#effect)." in verdict
    assert "## `brickpilot.data.audit`" in reference.rooms_page()
