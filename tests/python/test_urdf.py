"""The exported URDF opens in two independent programs, which read the values of the model from it."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yourdfpy
from brickpilot import catalogue
from brickpilot.export import urdf
from brickpilot.vehicle import model as models
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from command import brickpilot
from test_mjcf import large, robot, small

CHANGED = {
    "coulomb_friction": {"torque": 0.006},
    "viscous_loss": {"drag": 4e-4},
    "wheel_radius_mismatch": {"mismatch": 0.02},
    "com_forward_offset": {"forward": 0.02},
    "payload_mass": {"mass": 0.2, "forward": -0.02, "right": 0.02},
    "imu_lever_arm": {"x": 0.03, "y": 0.01},
}


def opened(model: Model) -> Any:
    return yourdfpy.URDF.load(io.BytesIO(urdf.write(model).text.encode()), load_meshes=False, build_scene_graph=True)


@pytest.mark.parametrize("make", [models.rcx, small, large, lambda: small(**CHANGED)])
def test_the_links_together_have_the_robots_mass_and_inertia(make: Any) -> None:
    """The masses, places and inertias of the links are those that MuJoCo reads from the URDF."""
    model = make()
    engine = mujoco.MjModel.from_xml_string(fused(urdf.write(model).text))
    data = mujoco.MjData(engine)
    mujoco.mj_forward(engine, data)
    payload = model.effects.get("payload_mass", {"mass": 0.0, "forward": 0.0, "right": 0.0})
    ahead = model.effects.get("com_forward_offset", {}).get("forward", 0.0)
    own = model.parameters["mass"]
    mass = own + payload["mass"]
    com = np.array([own * ahead + payload["mass"] * payload["forward"], payload["mass"] * payload["right"]]) / mass
    places, masses = data.xipos, engine.body_mass
    assert masses.sum() == pytest.approx(mass)
    centre = masses @ places / mass
    assert centre[:2] == pytest.approx([com[0], -com[1]], abs=1e-9)
    turned = data.ximat.reshape(-1, 3, 3)
    about = [(turned[k] @ np.diag(engine.body_inertia[k]) @ turned[k].T)[2, 2] for k in range(engine.nbody)]
    around = masses @ ((places[:, :2] - centre[:2]) ** 2).sum(axis=1)
    apart = own * ((ahead - com[0]) ** 2 + com[1] ** 2)
    apart += payload["mass"] * ((payload["forward"] - com[0]) ** 2 + (payload["right"] - com[1]) ** 2)
    assert sum(about) + around == pytest.approx(model.parameters["yaw_inertia"] + apart, rel=1e-9)


def fused(text: str) -> str:
    """Returns the URDF with an option for MuJoCo, which otherwise drops links that do not move."""
    return re.sub(r"(<robot [^>]*>)", r'\1<mujoco><compiler fusestatic="false"/></mujoco>', text, count=1)


@pytest.mark.parametrize("make", [models.rcx, small, large, lambda: small(**CHANGED)])
def test_wheels_stand_on_the_floor_where_the_model_has_them(make: Any) -> None:
    model = make()
    found = opened(model)
    mismatch = model.effects.get("wheel_radius_mismatch", {}).get("mismatch", 0.0)
    for side, sign in (("left", 1), ("right", -1)):
        (shape,) = found.link_map[f"{side}_wheel"].collisions
        radius = model.parameters["wheel_radius"] * (1 + sign * mismatch / 2)
        assert shape.geometry.cylinder.radius == pytest.approx(radius)
        place = found.get_transform(f"{side}_wheel", "base_footprint")[:3, 3]
        assert place == pytest.approx([0, sign * model.parameters["half_track"], radius])
        assert found.link_map[f"{side}_wheel"].inertial.inertia[1, 1] == model.parameters["wheel_inertia"]
        assert found.joint_map[f"{side}_wheel_joint"].type == "continuous"
    assert found.validate()


def test_limits_are_what_the_plant_reaches() -> None:
    """The limits are the speed at full voltage without rolling losses, and the torque at rest."""
    values = {"wheel_inertia": 1e-3, "viscous_friction": 3e-4}
    motor = Model("bench", "motor", "coupled", values)
    limit = opened(motor).joint_map["load_joint"].limit
    time = np.arange(0.0, 20.0, 0.01)
    (run,) = plant.simulate([(motor, plant.OpenLoopRun(time, np.full((len(time), 1), 9.0)))])
    assert run.outputs["speed"][-1] == pytest.approx(limit.velocity, rel=1e-6)
    assert limit.effort == pytest.approx(9.0 / 22.0 * 0.195)


def test_losses_and_sensors_stand_in_their_joints() -> None:
    found, model = opened(small(**CHANGED)), small(**CHANGED)
    dynamics = found.joint_map["left_wheel_joint"].dynamics
    radius = model.parameters["wheel_radius"] * 1.01
    rolling = 0.5 * model.parameters["gravity"] * model.parameters["rolling_friction"] * radius**2
    assert float(dynamics.damping) == pytest.approx(2e-4 + 4e-4 + rolling)
    assert float(dynamics.friction) == 0.006
    assert found.get_transform("imu_link", "base_link")[:3, 3] == pytest.approx([0.03, -0.01, 0])


SAID = {
    "motor_asymmetry", "supply_saturation", "torque_constant_asymmetry", "coulomb_friction", "viscous_loss",
    "com_forward_offset", "com_lateral_offset", "payload_mass", "wheel_radius_mismatch", "imu_lever_arm",
}  # fmt: skip


@pytest.mark.parametrize("name", [effect.name for effect in catalogue.effects()])
def test_every_effect_is_said_or_listed(name: str) -> None:
    made = urdf.write(robot("one", {}, **{name: {}}))
    assert (name in made.left_out) == (name not in SAID)
    assert all(line in made.text for line in made.left_out)
    assert opened(robot("one", {}, **{name: {}})).validate()


def test_its_check_would_find_a_wheel_without_its_link() -> None:
    text = urdf.write(models.rcx()).text.replace('child link="left_wheel"', 'child link="third_wheel"')
    with pytest.raises(ValueError, match="parent or child missing"):
        mujoco.MjModel.from_xml_string(text)


def test_a_force_slides_its_mass() -> None:
    sled = Model("sled", "motor", "coupled", {"mass": 90.0, "force_per_volt": 35.0, "viscous_friction": 200.0})
    joint = opened(sled).joint_map["load_joint"]
    assert joint.type == "prismatic"
    assert (joint.limit.effort, float(joint.dynamics.damping)) == (9 * 35.0, 200.0)
    assert opened(sled).link_map["load"].inertial.mass == 90.0


def test_the_command_prints_what_is_left_out(tmp_path: Path) -> None:
    models.save(small(battery_sag={}), tmp_path / "small.toml")
    done = brickpilot("export", "urdf", "--model", "small.toml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"not in the file: (.*)", done.stdout)[0] == "battery_sag"
    assert yourdfpy.URDF.load(str(tmp_path / "small.urdf"), load_meshes=False).validate()
    thin = {**models.rcx().parameters, "yaw_inertia": 1e-5}
    models.save(Model("thin", "diff_drive", "coupled", thin), tmp_path / "thin.toml")
    done = brickpilot("export", "urdf", "--model", "thin.toml", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "parameters.yaw_inertia: is too small" in done.stderr
    done = brickpilot("export", "urdf", "--out", "..", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "brickpilot: ..: is a folder; name a file\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.toml", "small.urdf", "thin.toml"]
