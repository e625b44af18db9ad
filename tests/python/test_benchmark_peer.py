"""The peer of the blind test, sparse regression: scored by the same rules, tuned and tried on runs of the plant."""

from __future__ import annotations

import dataclasses

import pytest
from benchmark_results import ENCODERS, effect, result
from brickpilot import catalogue
from brickpilot.benchmark import sindy, sindy_tune, table
from brickpilot.data import reading
from brickpilot.errors import InputError
from brickpilot.vehicle.replay import Replay
from synthetic import robot, write


def peer(name, gain, method="FROLS"):
    path = {"names": [name], "gains": [gain]}
    return {f"{w:g}": {"STLSQ": path, "FROLS": path} for w in sindy.WINDOWS_S}


def test_the_peer_is_scored_by_the_same_rules_on_what_its_library_names() -> None:
    high = 1e6
    named = result(["coulomb_friction"], "named", effect("coulomb_friction"), peer=peer("coulomb_friction", high))
    misnamed = result(["coulomb_friction"], "named", effect("coulomb_friction"), peer=peer("yaw_scrub", high))
    beyond = result(["gear_backlash"], "named", effect("gear_backlash"), peer=peer("yaw_scrub", high))
    clean = result([], "none", peer=peer("yaw_scrub", 1e-6))
    rows = {row["what"]: row for row in table.side_by_side([named, misnamed, beyond, clean])}
    single = rows["single, clearly visible, wheel speeds measured: right name"]
    assert single["of"] == 2
    assert (single["by"]["brickpilot"]["value"], single["by"]["PySINDy FROLS"]["value"]) == (1.0, 0.5)
    false = rows["nothing hidden: an effect is named or suspected"]["by"]
    assert false["PySINDy STLSQ"]["value"] == 0.0
    assert false[f"PySINDy {sindy.BIC_ALONE}"]["value"] == 1.0


def test_a_terms_gate_ends_the_peers_path() -> None:
    setting = sindy.Setting(0.24, 0.0, {ENCODERS: 10.0})
    path = {"names": ["a", "b", "a", "c"], "gains": [50.0, 20.0, 12.0, 9.9]}
    given = result(["a"], "none", peer={"0.24": {"FROLS": path}})
    assert [one["name"] for one in sindy.verdict_of(given, "FROLS", setting)["effects"]] == ["a", "b"]
    setting = sindy.Setting(0.24, 0.5, {ENCODERS: 10.0})
    assert [one["name"] for one in sindy.verdict_of(given, "FROLS", setting)["effects"]] == ["a"]


def test_tuning_lets_two_clean_sets_of_a_hundred_pass() -> None:
    clean = [result([], "none", peer=peer("yaw_scrub", 10.0 + i)) for i in range(100)]
    single = [result(["yaw_scrub"], "none", peer=peer("yaw_scrub", gain)) for gain in (50.0, 107.5, 300.0, 400.0)]
    for one in sindy_tune.tune([*clean, *single]):
        assert one.setting.gate[ENCODERS] == pytest.approx(107.0, rel=2e-3)
        assert one.false.value == 0.02
        assert one.right.value == 0.75
    with pytest.raises(InputError, match="clean sets"):
        sindy_tune.tune(single)


def hidden_robot(folder, effects):
    """Writes eight runs of the packaged robot with `effects`. The nominal values are the true ones."""
    truth = dataclasses.replace(robot(), effects=effects)
    noise = {"accel_surge": 0.025, "accel_sway": 0.025, "yaw_rate": 0.014, "wheel_speed_left": 0.05,
             "wheel_speed_right": 0.05}  # fmt: skip
    volts = ((4, 4), (-6, -6), (2, 2), (4, -4), (-3, 3), (6, 3), (2.5, 6), (-3, -6))
    manoeuvres = {f"run_{i}": (float(left), float(right)) for i, (left, right) in enumerate(volts)}
    nominal = "\n".join(f"{name} = {value:.9g}" for name, value in truth.parameters.items() if name in NOMINAL)
    write(folder, truth, noise, nominal, manoeuvres=manoeuvres, roles=["fit", "held_out"] * 4)
    return reading.read(folder), dataclasses.replace(robot(), effects={}), noise


NOMINAL = ("mass", "yaw_inertia", "half_track", "wheel_radius", "wheel_inertia", "resistance", "torque_constant",
           "emf_constant", "viscous_friction", "rolling_friction", "battery_voltage", "inductance")  # fmt: skip


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("coulomb_friction", {"torque": 0.006}),
        ("motor_asymmetry", {"difference": 0.08}),
        ("gyro_bias", {"bias": 0.1}),
        ("yaw_scrub", {"moment": 0.01}),
        ("accel_misalignment", {"angle": 0.2}),
    ],
)
def test_the_peer_names_what_its_library_holds(tmp_path, name, parameters) -> None:
    pytest.importorskip("pysindy")
    data, nominal, noise = hidden_robot(tmp_path / "data", {name: parameters})
    simulated = Replay(data).simulate([nominal])[0]
    roles = {run.name: str(run.role) for run in data.runs}
    found_ = sindy.paths(data, nominal, simulated, roles, noise, (0.24,))["0.24"]
    assert found_["FROLS"]["names"][0] == name
    assert found_["FROLS"]["gains"][0] > 50
    assert name in found_["STLSQ"]["names"]


def test_the_peer_finds_nothing_where_nothing_is_hidden(tmp_path) -> None:
    pytest.importorskip("pysindy")
    data, nominal, noise = hidden_robot(tmp_path / "data", {})
    simulated = Replay(data).simulate([nominal])[0]
    roles = {run.name: str(run.role) for run in data.runs}
    found_ = sindy.paths(data, nominal, simulated, roles, noise, (0.24,))["0.24"]
    assert found_["FROLS"]["gains"][0] < 5


def test_the_peers_library_names_effects_of_the_catalogue() -> None:
    known = {one.name for one in catalogue.effects()}
    assert known >= sindy.NOT_IN_LIBRARY
    assert not sindy.nameable(["coulomb_friction", "cogging"])
    assert sindy.nameable(["coulomb_friction"])
