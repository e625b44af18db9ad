"""An exported robot in MuJoCo: driven by voltages, or in place of the plant on a link. In Brickpilot's frame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from brickpilot import compiled
from brickpilot.constants import STEP_S
from brickpilot.hil.plant_end import PlantEnd, SensorFaults
from brickpilot.vehicle import flight
from numpy.typing import NDArray

Array = NDArray[np.float64]

X, Y, YAW = 0, 1, 3
"""Indices of the joints of a robot; the joints of its wheels follow."""


def load(text: str) -> tuple[Any, Any]:
    model: Any = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def drive(text: str, volts: Array, step: float = STEP_S) -> dict[str, Array]:
    """Returns name -> positions (rows of `volts`,), m or rad, at the start of each row; a row is held for `step` s."""
    model, data = load(text)
    count, motors = round(step / model.opt.timestep), volts.shape[1]
    assert count * model.opt.timestep == np.float64(step) or math.isclose(count * model.opt.timestep, step)
    rows = np.empty((len(volts), model.nq))
    for k, now in enumerate(volts):
        rows[k] = data.qpos
        data.ctrl[:motors] = now
        mujoco.mj_step(model, data, count)
    if motors == 1:
        return {"angle": rows[:, 0]}
    return {"x": rows[:, X], "y": -rows[:, Y], "yaw_angle": -rows[:, YAW], "left": rows[:, 4], "right": rows[:, 5]}


class MujocoEnd(PlantEnd):
    """A robot in MuJoCo instead of the plant. Its sensors are the true state."""

    def __init__(self, text: str, plan: flight.Plan) -> None:
        ffi, library = compiled.interface()
        super().__init__(library, None, ffi.new("bp_sensed *"), SensorFaults(()))
        self._model, self._data = load(text)
        self._battery = plan.model.parameters["battery_voltage"]
        self._gone = 0
        self.track: list[tuple[float, float]] = []

    def sense(self) -> None:
        position, speed, heading = self._data.qpos, self._data.qvel, -self._data.qpos[YAW]
        ahead = speed[X] * math.cos(heading) - speed[Y] * math.sin(heading)
        now: Any = self._sensed
        now.time_ms = round(self._gone * STEP_S * 1e3)
        now.imu_status = now.rotation_status = 1
        now.battery_mv = round(self._battery * 1e3)
        now.x_um, now.y_um = round(position[X] * 1e6), round(-position[Y] * 1e6)
        now.heading_bam16 = round(heading * 32768 / math.pi) & 0xFFFF
        now.speed_mm_s_q4, now.true_yaw_rate_mrad_s = round(ahead * 16e3), round(-speed[YAW] * 1e3)
        self.track.append((position[X], -position[Y]))

    def act(self, left: int, right: int) -> None:
        self._data.ctrl[:2] = left / 32767 * self._battery, right / 32767 * self._battery
        mujoco.mj_step(self._model, self._data, round(STEP_S / self._model.opt.timestep))
        self._gone += 1


@contextmanager
def opened(end: MujocoEnd) -> Iterator[MujocoEnd]:
    yield end
