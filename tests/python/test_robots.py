"""Drawn robots scatter by the fit's covariance, within physical ranges, and a seed gives the same robots again."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.campaign import robots
from brickpilot.campaign.robots import Allowed, Explanation
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.errors import InputError
from brickpilot.vehicle import model
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.spread import Spread

NOTHING: dict[str, float] = {}


def allowed(given: Spread | None, **more: object) -> Allowed:
    own = model.Model("own", "diff_drive", "coupled", rcx().parameters, {"coulomb_friction": {"torque": 0.01}})
    return dataclasses.replace(Allowed((Explanation("own", own),), given, NOTHING), **more)


def together(sd: float, correlation: float) -> Spread:
    """Returns a spread of mass and torque constant, in logarithms, and of friction, which may be 0, per 0.05 N m."""
    own = rcx().parameters
    covariance = sd**2 * np.array([[1.0, correlation, 0.0], [correlation, 1.0, 0.0], [0.0, 0.0, 1.0]])
    names = ("mass", "torque_constant", "coulomb_friction.torque")
    return Spread(names, (own["mass"], own["torque_constant"], 0.01), (None, None, 0.05), covariance)


def test_parameters_that_only_go_together_are_drawn_together() -> None:
    drawn = robots.draw(allowed(together(0.1, 0.99)), 0, 0, range(2000))
    own = rcx().parameters
    logs = np.log([[one.model.parameters[name] / own[name] for name in ("mass", "torque_constant")] for one in drawn])
    assert np.std(logs, axis=0) == pytest.approx([0.1, 0.1], rel=0.06)
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(0.99, abs=0.002)
    torques = np.array([one.model.effects["coulomb_friction"]["torque"] for one in drawn])
    assert torques.min() >= 0
    assert np.std(torques) == pytest.approx(0.005, rel=0.1)  # the normal distribution is cut off at 2 sd


def test_what_the_data_do_not_tell_goes_no_further_than_is_stated() -> None:
    drawn = robots.draw(allowed(together(3.0, 0.999)), 0, 0, range(1000))
    own = rcx().parameters
    mass, torque = (
        np.log([one.model.parameters[name] / own[name] for one in drawn]) for name in ("mass", "torque_constant")
    )
    assert np.std(mass + torque) / np.sqrt(2) == pytest.approx(robots.VAGUE_SD, rel=0.1)
    assert np.std(mass - torque) / np.sqrt(2) == pytest.approx(3.0 * np.sqrt(0.001), rel=0.1)


def test_what_nobody_measured_has_the_usual_spread_and_sensors_have_biases_of_their_own() -> None:
    one = allowed(None, shares=SD_SHARE, devices={"gyro_bias": 0.02, "bits": 10.0})
    drawn = robots.draw(one, 0, 0, range(1000))
    own = rcx().parameters
    for name, share in {**SD_SHARE, "battery_voltage": robots.BATTERY_SHARE}.items():
        if own[name]:
            assert np.std(np.log([each.model.parameters[name] for each in drawn])) == pytest.approx(share, rel=0.1)
    assert np.std([each.devices["gyro_bias"] for each in drawn if each.devices]) == pytest.approx(0.02, rel=0.1)
    assert {each.devices["bits"] for each in drawn if each.devices} == {10.0}
    assert len({each.seed for each in drawn}) == 1000


def test_a_robot_depends_on_seed_stream_and_place_alone() -> None:
    given = allowed(together(0.1, 0.5), shares=SD_SHARE)
    few, many = robots.draw(given, 7, 1, [3, 5]), robots.draw(given, 7, 1, range(8))
    assert few == [many[3], many[5]]
    assert robots.draw(given, 7, 2, [3])[0].model != many[3].model != robots.draw(given, 8, 1, [3])[0].model


def test_an_ambiguous_verdict_is_drawn_from_all_its_explanations(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    own = dataclasses.replace(rcx(), effects={"coulomb_friction": {"torque": 0.01}})
    model.save(own, path)
    rival = {"name": "gyro_scale", "nominal": {"mass": 0.7}, "effects": {"gyro_scale": {"error": 0.05}}}
    verdict = {"verdict": "ambiguous", "spread": None, "effects": [{"equivalents": [rival]}]}
    (tmp_path / "verdict.json").write_text(json.dumps(verdict))
    given = robots.read(model.load(path), path, NOTHING)
    drawn = robots.draw(given, 0, 0, range(400))
    of_rival = [one for one in drawn if one.explanation == "gyro_scale"]
    assert 160 < len(of_rival) < 240
    assert {tuple(one.model.effects) for one in of_rival} == {("gyro_scale",)}
    assert {one.model.parameters["mass"] for one in of_rival} == {0.7}
    verdict["verdict"] = "named"
    (tmp_path / "verdict.json").write_text(json.dumps(verdict))
    assert len(robots.read(model.load(path), path, NOTHING).explanations) == 1


def test_a_fit_writes_what_is_read_back(tmp_path: Path) -> None:
    time, known = np.arange(0.0, 2.0, 0.01), {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3}
    noise = np.random.default_rng(0).normal(0.0, 0.05, (2, len(time)))

    def step(volts: float, errors: np.ndarray) -> pd.DataFrame:
        speed = 3 * volts * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15)) + errors
        return pd.DataFrame({"time": time, "voltage": np.where(time >= 0.195, volts, 0.0), "speed": speed})

    runs = {"low": step(3.0, noise[0]), "back": step(-5.0, noise[1])}
    found = bp.calibrate(bp.Dataset.from_frames(runs, vehicle="motor", nominal={**known, "inductance": 0.0}))
    model.save(found.model, tmp_path / "model.toml")
    (tmp_path / "calibrate.json").write_text(json.dumps(found.to_json()))
    given = robots.read(model.load(tmp_path / "model.toml"), tmp_path / "model.toml", NOTHING)
    assert given.source == "calibrate.json"
    assert given.spread is not None
    assert given.spread.names == tuple(found.parameters)
    for name, unit, variance in zip(
        given.spread.names, given.spread.units, np.diag(given.spread.covariance), strict=True
    ):
        low, high = found.parameters[name].ci95 or (np.nan, np.nan)
        half = np.log(high / low) / 2 if unit is None else (high - low) / 2 / unit
        assert half / np.sqrt(variance) == pytest.approx(2.0, abs=0.2)  # Student's t at 95 %


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "is no result of calibrate or discover: Expecting"),
        ('{"spread": {"parameters": ["mass"]}}', "is no result of calibrate or discover: lacks 'values'"),
        (
            '{"spread": {"parameters": ["mass"], "values": [1], "units": [null], "covariance": [[-1]]}}',
            "negative variance",
        ),
        (
            '{"spread": {"parameters": ["mass"], "values": [1], "units": [null], "covariance": [[NaN]]}}',
            "without value, unit or covariance",
        ),
        (
            '{"spread": {"parameters": ["mass"], "values": [77], "units": [null], "covariance": [[1]]}}',
            "mass: 77 is not the value of model.toml beside it",
        ),
    ],
)
def test_a_wrong_file_beside_the_model_is_one_line(text: str, says: str, tmp_path: Path) -> None:
    model.save(rcx(), tmp_path / "model.toml")
    (tmp_path / "calibrate.json").write_text(text)
    with pytest.raises(InputError) as caught:
        robots.read(rcx(), tmp_path / "model.toml", NOTHING)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "calibrate.json"))


def test_data_that_allow_no_robot_are_refused() -> None:
    far = dataclasses.replace(together(0.1, 0.0), values=(1e-9, 1.0, 0.01))
    own = dataclasses.replace(rcx(), parameters={**rcx().parameters, "mass": 1e9})
    with pytest.raises(InputError, match="no robot within the physical ranges"):
        robots.draw(dataclasses.replace(allowed(far), explanations=(Explanation("own", own),)), 0, 0, [0])
