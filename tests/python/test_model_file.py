"""A model file reads back as it was written; a file with an error is refused with the place of the error."""

import dataclasses
import tomllib
from pathlib import Path

import pytest
from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model, load, output_names, rcx, save

HEAD = 'name = "m"\nvehicle = "diff_drive"\nprofile = "coupled"\n'
MOTOR = HEAD.replace("diff_drive", "motor")
MODELS = Path(__file__).parents[2] / "sim_host" / "models"


def test_packaged_robot_is_the_plants_preset() -> None:
    has = catalogue.presets("diff_drive")
    presets = {info.name: (info.preset, info.unit) for info in catalogue.parameters() if info.name in has}
    written = tomllib.loads((MODELS / "rcx.toml").read_text())["parameters"]
    for name, entry in written.items():
        assert (entry["value"], entry["unit"]) == presets[name]
    assert rcx().parameters == {name: value for name, (value, _) in presets.items()}


def test_a_saved_model_is_read_back_exactly(tmp_path: Path) -> None:
    effects = {"coulomb_friction": {"torque": 0.1 + 0.2}, "battery_sag": {"resistance": 1 / 3}}
    before = dataclasses.replace(
        rcx(), name="näme = [odd]", parameters={**rcx().parameters, "mass": 2 / 3}, effects=effects
    )
    save(before, tmp_path / "model.toml")
    assert load(tmp_path / "model.toml") == before
    assert [path.name for path in tmp_path.iterdir()] == ["model.toml"]


def test_a_saved_motor_is_read_back_exactly(tmp_path: Path) -> None:
    before = Model("axis", "motor", "coupled", {**catalogue.presets("motor"), "force_per_volt": 35.15, "mass": 95.0})
    save(before, tmp_path / "axis.toml")
    assert load(tmp_path / "axis.toml") == before


def test_a_force_or_torque_of_zero_per_volt_is_none(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(MOTOR + "[parameters]\nforce_per_volt = 0\ntorque_per_volt = 0\n")
    assert {"speed", "current"} <= output_names(load(tmp_path / "m.toml"))


def test_a_mass_at_a_radius_stands_in_for_the_inertia(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(MOTOR + "[parameters]\nwheel_inertia = 0\nmass = 1.0\nwheel_radius = 0.1\n")
    assert load(tmp_path / "m.toml").parameters["wheel_inertia"] == 0


def test_every_value_is_written_with_its_unit(tmp_path: Path) -> None:
    save(dataclasses.replace(rcx(), effects={"coulomb_friction": {"torque": 0.004}}), tmp_path / "model.toml")
    written = tomllib.loads((tmp_path / "model.toml").read_text())
    assert written["parameters"]["mass"]["unit"] == "kg"
    assert written["parameters"]["mass"]["basis"].startswith("estimate")
    assert written["effects"]["coulomb_friction"] == {"torque": {"value": 0.004, "unit": "N m"}}


def test_what_a_file_leaves_out_is_preset(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(HEAD + "[parameters]\nmass = 0.7\n[effects.coulomb_friction]\n")
    found = load(tmp_path / "m.toml")
    assert found.parameters == {**catalogue.presets("diff_drive"), "mass": 0.7}
    friction = next(effect for effect in catalogue.effects() if effect.name == "coulomb_friction")
    assert found.effects == {"coulomb_friction": {"torque": friction.parameters[0].preset}}


def test_a_model_the_plant_refuses_is_not_written(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text("before")
    with pytest.raises(InputError):
        save(dataclasses.replace(rcx(), parameters={"mass": -1.0}), tmp_path / "m.toml")
    assert (tmp_path / "m.toml").read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "m.toml"
    target.write_text("before")
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        save(rcx(), target)
    assert [path.name for path in tmp_path.iterdir()] == ["m.toml"]
    assert target.read_text() == "before"


BAD = {
    "no name": ('vehicle = "diff_drive"\nprofile = "coupled"\n', r"m.toml: name: is missing"),
    "unknown vehicle": (
        HEAD.replace("diff_drive", "boat"),
        r"m.toml:2: vehicle: 'boat' is not one of diff_drive, motor",
    ),
    "unknown profile": (HEAD.replace("coupled", "loose"), r"m.toml:3: profile: 'loose'"),
    "unknown key": (HEAD + "colour = 1\n", r"m.toml:4: colour: unknown key"),
    "unknown parameter": (HEAD + "[parameters]\nmas = 1.0\n", r"m.toml:5: parameters.mas: unknown key"),
    "wrong unit": (
        HEAD + '[parameters]\nmass = {value = 1.0, unit = "g"}\n',
        r"m.toml:5: parameters.mass.unit: 'g' should be 'kg'",
    ),
    "no value": (HEAD + '[parameters]\nmass = {unit = "kg"}\n', r"m.toml:5: parameters.mass: value is missing"),
    "text for a number": (HEAD + '[parameters]\nmass = "1"\n', r"m.toml:5: parameters.mass: '1' is not a number"),
    "out of range": (HEAD + "[parameters]\nmass = -1\n", r"m.toml:5: parameters.mass: -1 is outside 0.001..100000 kg"),
    "nothing to move": (
        MOTOR + "[parameters]\nresistance = 2.0\nwheel_inertia = 0\n",
        r"m.toml:6: parameters.wheel_inertia: 0 leaves nothing to move",
    ),
    "a mass without a lever": (
        MOTOR + "[parameters]\nwheel_inertia = 0\nmass = 1.0\n",
        r"m.toml:5: parameters.wheel_inertia: 0 leaves nothing to move",
    ),
    "a force without a mass": (
        MOTOR + "[parameters]\nwheel_inertia = 1e-4\nforce_per_volt = 30\n",
        r"m.toml:6: parameters.force_per_volt: .* needs a mass",
    ),
    "a force on no mass": (
        MOTOR + "[parameters]\nforce_per_volt = 30\nmass = 0\n",
        r"m.toml:6: parameters.mass: .* needs a mass above 0",
    ),
    "no mass": (HEAD + "[parameters]\nmass = 0\n", r"m.toml:5: parameters.mass: 0 is outside"),
    "not finite": (HEAD + "[parameters]\nmass = nan\n", r"m.toml:5: parameters.mass: nan is outside"),
    "unknown effect": (HEAD + "[effects.glue]\n", r"m.toml:4: effects.glue: unknown key"),
    "effect no table": (
        HEAD + "[effects]\ncoulomb_friction = 3\n",
        r"m.toml:5: effects.coulomb_friction: 3 is not a table",
    ),
    "unknown effect parameter": (
        HEAD + "[effects.coulomb_friction]\nforce = 1.0\n",
        r"m.toml:5: effects.coulomb_friction.force: unknown key",
    ),
    "effect out of range": (
        HEAD + "[effects.coulomb_friction]\ntorque = -1\n",
        r"m.toml:5: effects.coulomb_friction.torque: -1",
    ),
    "not TOML": (HEAD + "[effects\n", r"m.toml:4: is not TOML"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_with_its_line(case: str, tmp_path: Path) -> None:
    text, place = BAD[case]
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match=place):
        load(tmp_path / "m.toml")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"m.toml: no such file"):
        load(tmp_path / "m.toml")
