"""Simulates a skid-steered rover with four wheels in MuJoCo, whose contacts are not the plant's, and makes its logs.

Lengths, masses and the floor's friction are values of the Clearpath Jackal (jackal_description/urdf/jackal.urdf.xacro
of github.com/jackal/jackal). No values of its motors are published, so the motors here are invented: two equal motors
on each side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

WHEELBASE, TRACK, RADIUS, WIDTH = 0.262, 0.37559, 0.098, 0.04
CHASSIS, WHEEL = 16.523, 0.477
MASS = CHASSIS + 4 * WHEEL
YAW_INERTIA = 0.4485 + 4 * (0.0013 + WHEEL * (WHEELBASE**2 + TRACK**2) / 4)
EMF, RESISTANCE, ROTOR, VISCOUS = 1.0, 3.0, 0.1, 0.05  # of each of the four motors, at its wheel
BATTERY = 24.0
ROW_S = 0.02
_STEP_S = 5e-4
_SOLREF = "0.01 1"  # time constant, s, and damping ratio of the contacts: stiffer than MuJoCo's preset
_LEFT, _RIGHT = ("front_left", "rear_left"), ("front_right", "rear_right")

NOMINAL: dict[str, Any] = {
    "mass": MASS, "yaw_inertia": {"value": YAW_INERTIA, "sd": 0.05}, "wheel_radius": RADIUS, "wheelbase": WHEELBASE,
    "half_track": {"value": 0.19, "sd": 0.02}, "wheel_inertia": {"value": 0.2, "sd": 0.05},
    "resistance": RESISTANCE / 2, "emf_constant": EMF, "torque_constant": EMF, "battery_voltage": BATTERY,
    "viscous_friction": {"value": 0.15, "sd": 0.1}, "rolling_friction": 0.0,
}  # fmt: skip
"""The nominal values of the rover's builder. The two motors of a side are in parallel. Of the contacts, only the
positions are known."""


@dataclass(frozen=True)
class Hidden:
    """The effects that the nominal model lacks.

    Attributes:
        dry: dry friction of the left and of the right side, N m.
        viscous: added viscous friction of each side, N m s/rad.
    """

    dry: tuple[float, float] = (0.0, 0.0)
    viscous: float = 0.0


def text(hidden: Hidden, friction: float = 0.5) -> str:
    wheels, motors = "", ""
    for name in (*_LEFT, *_RIGHT):
        x = WHEELBASE / 2 * (1 if "front" in name else -1)
        y = TRACK / 2 * (1 if "left" in name else -1)
        dry = hidden.dry["right" in name] / 2
        wheels += f"""
      <body name="{name}" pos="{x} {y} 0">
        <joint name="{name}" axis="0 1 0" damping="{VISCOUS + hidden.viscous / 2}" frictionloss="{dry}"
          armature="{ROTOR}"/>
        <inertial pos="0 0 0" mass="{WHEEL}" diaginertia="0.0013 0.0024 0.0013"/>
        <geom type="ellipsoid" size="{RADIUS} {WIDTH / 2} {RADIUS}"/>
      </body>"""
        motors += f"""
    <general joint="{name}" gainprm="{EMF / RESISTANCE}" biastype="affine" biasprm="0 0 {-EMF * EMF / RESISTANCE}"/>"""
    return f"""<mujoco>
  <option timestep="{_STEP_S}" cone="elliptic" impratio="10" integrator="implicitfast"/>
  <default>
    <geom friction="{friction} 0.005 0.0001" condim="3" contype="1" conaffinity="2" solref="{_SOLREF}"/>
  </default>
  <worldbody>
    <geom type="plane" size="100 100 1" contype="2" conaffinity="1"/>
    <body pos="0 0 {RADIUS}">
      <freejoint/>
      <inertial pos="0 0 0.03" mass="{CHASSIS}" diaginertia="0.3136 0.3922 0.4485"/>{wheels}
    </body>
  </worldbody>
  <actuator>{motors}
  </actuator>
</mujoco>"""


def drive(volts: Array, hidden: Hidden, friction: float = 0.5) -> Array:
    """Returns (n, 3): mean speed of the left and of the right wheels, rad/s, and yaw rate, rad/s clockwise.

    Args:
        volts: (n, 2) voltage of the left and of the right motors; row k acts after row k of the result is read.
    """
    model: Any = mujoco.MjModel.from_xml_string(text(hidden, friction))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)  # the rover settles on its wheels
    rows = np.empty((len(volts), 3))
    for k, (left, right) in enumerate(volts):
        wheel = data.qvel[6:]
        rows[k] = wheel[:2].mean(), wheel[2:].mean(), -data.qvel[5]
        data.ctrl[:] = left, left, right, right
        mujoco.mj_step(model, data, round(ROW_S / _STEP_S))
    return rows


def commands(seed: int) -> Mapping[str, Array]:
    """Returns run -> (n, 2) voltages, left and right: straight runs, turns on the spot, arcs and chirps."""
    time = np.arange(0.0, 6.0, ROW_S)
    on = ((time > 0.3) & (time < 4.5)).astype(float)
    draw = np.random.default_rng(seed)
    a, b, c = draw.uniform(0.8, 1.2, 3)
    chirp = np.sin(2 * np.pi * (0.1 * time + 0.05 * time**2))
    late = np.clip((time - 0.3) / 3, 0, 1) * on
    return {
        "ahead": np.column_stack([8 * a * on, 8 * a * on]),
        "back": np.column_stack([-11 * b * on, -11 * b * on]),
        "right": np.column_stack([10 * c * on, -10 * c * on]),
        "left": np.column_stack([-13 * a * late, 13 * a * late]),
        "arc": np.column_stack([14 * b * on, 6 * b * on]),
        "other_arc": np.column_stack([3 * c * on, 12 * c * on]),
        "chirp": np.column_stack([9 * a * chirp, 9 * a * np.roll(chirp, 60)]) * on[:, np.newaxis],
        "weave": np.column_stack([8 + 5 * chirp, 8 - 5 * chirp]) * on[:, np.newaxis],
    }


def logs(hidden: Hidden | None = None, seed: int = 1, friction: float = 0.5) -> dict[str, pd.DataFrame]:
    """Returns run -> log with noise: time, voltages, wheel speeds, rad/s, and yaw rate, rad/s; frame FRD."""
    noise = np.random.default_rng(seed + 1)
    made = {}
    for name, volts in commands(seed).items():
        rows = drive(volts, hidden or Hidden(), friction)
        rows = rows + noise.normal(0.0, [0.03, 0.03, 0.01], rows.shape)
        made[name] = pd.DataFrame(
            {
                "time": ROW_S * np.arange(len(rows)),
                "voltage_left": volts[:, 0],
                "voltage_right": volts[:, 1],
                "wheel_speed_left": rows[:, 0],
                "wheel_speed_right": rows[:, 1],
                "yaw_rate": rows[:, 2],
            }
        )
    return made
