"""A campaign of `robots = "data"` flies robots that agree with data."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from brickpilot.campaign import file, robots, runs
from brickpilot.campaign.file import Campaign
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.errors import InputError
from brickpilot.vehicle import model
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.spread import Spread
from command import brickpilot
from test_campaign import SHORT

TEXT = """[campaign]
name = "allowed"
runs = 8
seed = 4
scenario = "short.toml"
sensors = "imu+encoders"
model = "model.toml"
robots = "data"
"""
LENGTHS = Spread(("mass", "half_track"), (0.9, 0.07), (None, None), np.array([[1.0, 0.99], [0.99, 1.0]]) * 0.05**2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    own = dataclasses.replace(
        rcx(), parameters={**rcx().parameters, "mass": 0.9, "half_track": 0.07}, effects={"yaw_scrub": {"moment": 0.01}}
    )
    model.save(own, tmp_path / "model.toml")
    (tmp_path / "calibrate.json").write_text(json.dumps({"spread": LENGTHS.to_json()}))
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "allowed.toml").write_text(TEXT)
    return tmp_path


def loaded(folder: Path, text: str = TEXT, **more: Any) -> Campaign:
    (folder / "allowed.toml").write_text(text)
    return file.load(folder / "allowed.toml", shares=SD_SHARE, **more)


def flights(given: Campaign) -> list[runs.Run]:
    return [run for part in runs.parts(given) for run in runs.planned(part.argument)]


def test_each_run_has_a_robot_that_depends_on_seed_and_number_alone(folder: Path) -> None:
    few, many = loaded(folder, count=8), loaded(folder, count=300)
    assert [one.plan for one in flights(few)] == [one.plan for one in flights(many)][:8]
    assert runs.single_run(many, 5).plan == flights(few)[5].plan
    other = loaded(folder, count=8, seed=5)
    mass, track = ([one.plan.model.parameters[name] for one in flights(many)] for name in ("mass", "half_track"))
    assert not {one.plan.model.parameters["mass"] for one in flights(other)} & set(mass)
    assert np.std(np.log(mass)) == pytest.approx(0.05, rel=0.15)
    assert np.corrcoef(np.log(mass), np.log(track))[0, 1] == pytest.approx(0.99, abs=0.005)
    biases = [(one.plan.devices or {})["gyro_bias"] for one in flights(many)]
    assert len(set(biases)) == 300


def test_vary_goes_before_the_data_and_a_block_shares_its_robot(folder: Path) -> None:
    varied = "[vary]\nparameter.mass = [0.8, 1.0]\neffect.yaw_scrub.chance = 0.5\n"
    text = TEXT.replace("runs = 8", 'design = "saltelli"\nsamples = 4') + varied
    given = loaded(folder, text)
    found = flights(given)
    assert {one.plan.model.parameters["mass"] for one in found} == {0.8, 1.0}
    for block in range(4):
        assert len({one.plan.model.parameters["half_track"] for one in found[4 * block : 4 * block + 4]}) == 1
    rows = [runs.of_robot(given, one) for one in found]
    assert "robot.mass" not in rows[0]
    assert {row["robot.yaw_scrub.moment"] is None for row in rows} == {True, False}


def test_the_command_writes_the_robots_and_refuses_to_go_on_with_other_data(folder: Path) -> None:
    def fly() -> tuple[int, str]:
        done = brickpilot("campaign", "allowed.toml", "--out", "found", "--jobs", "1", cwd=folder)
        return done.returncode, done.stderr

    assert fly()[0] == 0
    table = pq.read_table(folder / "found" / "runs.parquet")
    assert table.schema.field("robot.mass").metadata == {b"unit": b"kg"}
    planned = [run.plan.model.parameters["mass"] for run in flights(loaded(folder))]
    assert table["robot.mass"].to_pylist() == planned
    again = brickpilot("campaign", "allowed.toml", "--replay", "3", "--out", "again", "--json", cwd=folder)
    assert json.loads(again.stdout)["inputs"]["robot.mass"] == planned[3]
    wider = dataclasses.replace(LENGTHS, covariance=LENGTHS.covariance * (1 + 1e-12))
    (folder / "calibrate.json").write_text(json.dumps({"spread": wider.to_json()}))
    assert fly() == (2, "brickpilot: found: holds another campaign: name another folder, or remove this one\n")


def test_robots_need_a_model(folder: Path) -> None:
    (folder / "allowed.toml").write_text(TEXT.replace('model = "model.toml"\n', ""))
    done = brickpilot("campaign", "allowed.toml", "--out", "found", cwd=folder)
    line = (
        "brickpilot: allowed.toml:7: campaign.robots: needs campaign.model: a file that calibrate or discover wrote\n"
    )
    assert (done.returncode, done.stderr) == (2, line)


def test_values_that_only_the_explanations_tell_apart_are_columns_too(folder: Path) -> None:
    rival = {"name": "gyro_scale", "nominal": {"wheel_radius": 0.03}, "effects": {"gyro_scale": {"error": 0.05}}}
    verdict = {"verdict": "ambiguous", "spread": None, "effects": [{"equivalents": [rival]}]}
    (folder / "calibrate.json").unlink()
    (folder / "verdict.json").write_text(json.dumps(verdict))
    given = robots.read(model.load(folder / "model.toml"), folder / "model.toml", {})
    assert given.open == ("wheel_radius", "battery_voltage", "yaw_scrub.moment", "gyro_scale.error")


@pytest.mark.parametrize(
    "verdict",
    [
        '{"spread": {"parameters": ["mass"], "values": [BIG], "units": [1], "covariance": [[1]]}}',
        '{"spread": {"parameters": ["mass"], "values": [1], "units": [1], "covariance": [[BIG]]}}',
        '{"verdict": "ambiguous", "effects": [{"equivalents": [{"name": "x", "nominal": {"mass": BIG}, '
        '"effects": {}}]}]}',
        '{"verdict": "ambiguous", "effects": [{"equivalents": [{"name": "x", "nominal": {"mass": 1}, '
        '"effects": {"yaw_scrub": {"moment": BIG}}}]}]}',
    ],
)
def test_a_number_that_no_double_holds_is_one_line(verdict: str, folder: Path) -> None:
    (folder / "calibrate.json").unlink()
    (folder / "verdict.json").write_text(verdict.replace("BIG", "9" * 400))
    with pytest.raises(InputError, match=r"verdict.json: spread: is no result of calibrate or discover"):
        robots.read(model.load(folder / "model.toml"), folder / "model.toml", {})
