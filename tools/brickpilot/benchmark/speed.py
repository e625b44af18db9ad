"""Speed beside a peer in the same process: on a shared machine absolute times mean little."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brickpilot.constants import MOTOR_STEP_S, STEP_S
from brickpilot.vehicle import flight, plant, scenario
from brickpilot.vehicle.model import Model, rcx


@dataclass(frozen=True)
class Figure:
    """One speed: ``value`` in ``unit``, ``ratio`` times that of ``peer``, which ran in the same process."""

    value: float
    unit: str
    peer: str
    ratio: float


def _best(work: Callable[[], float], repeats: int = 5) -> float:
    """Returns the best speed of several runs, in times real time. `work` returns simulated seconds."""
    rates = []
    for _ in range(repeats):
        began = time.perf_counter()
        simulated = work()
        rates.append(simulated / (time.perf_counter() - began))
    return max(rates)


def _full_loop() -> float:
    mission = scenario.load(scenario.packaged()["mission"])
    plan = flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0)
    return flight.fly_unlogged(plan)


def _plant_alone(model: Model) -> float:
    time_s = np.arange(20_001, dtype=np.float64) * STEP_S
    inputs = np.tile([4.5, 3.0], (len(time_s), 1))
    plant.simulate([(model, plant.OpenLoopRun(time_s, inputs))])
    return float(time_s[-1])


def _scipy(model: Model, seconds: float = 3.0) -> float:
    """Simulates the same robot as a text-book ODE with SciPy's LSODA. Inputs change every 3 ms, as the plant's do."""
    p = model.parameters
    resistance, inductance, radius, track = p["resistance"], p["inductance"], p["wheel_radius"], p["half_track"]
    loss = p["viscous_friction"] + p["mass"] * p["gravity"] * p["rolling_friction"] * radius**2
    inertia_sum = p["wheel_inertia"] + p["mass"] * radius**2 / 2
    inertia_difference = p["wheel_inertia"] + p["yaw_inertia"] * radius**2 / (2 * track**2)
    drag = 0.5 * p["drag_area"] * p["air_density"]

    def slope(_: float, s: NDArray[np.float64], left: float, right: float) -> list[float]:
        i_l, i_r, w_l, w_r, heading = s[:5]
        torque_l, torque_r = (p["torque_constant"] * i - loss * w for i, w in ((i_l, w_l), (i_r, w_r)))
        surge = radius * (w_l + w_r) / 2
        common = ((torque_l + torque_r) / 2 - radius * drag * surge * abs(surge) / 2) / inertia_sum
        difference = (torque_l - torque_r) / 2 / inertia_difference
        return [
            (left - resistance * i_l - p["emf_constant"] * w_l) / inductance,
            (right - resistance * i_r - p["emf_constant"] * w_r) / inductance,
            common + difference,
            common - difference,
            radius * (w_l - w_r) / (2 * track),
            surge * np.cos(heading),
            surge * np.sin(heading),
        ]

    state = [0.0] * 7
    for step in range(round(seconds / STEP_S)):
        solved: Any = solve_ivp(slope, (step * STEP_S, (step + 1) * STEP_S), state, "LSODA", args=(4.5, 3.0), rtol=1e-6)
        state = solved.y[:, -1].tolist()
    return seconds


_MUJOCO_ROBOT = f"""
<mujoco><option timestep="{MOTOR_STEP_S}" integrator="implicitfast" gravity="0 0 0"/>
<default><geom type="cylinder" size=".04 .01" euler="90 0 0" mass=".02" contype="0" conaffinity="0"/></default>
<worldbody><body>
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>
<geom type="box" size=".1 .07 .03" euler="0 0 0" mass=".9"/>
<body pos="0 .07 0"><joint name="l" axis="0 1 0"/><geom/></body>
<body pos="0 -.07 0"><joint name="r" axis="0 1 0"/><geom/></body>
</body></worldbody><actuator><velocity joint="l" kv=".002"/><velocity joint="r" kv=".002"/></actuator></mujoco>
"""


def _mujoco(seconds: float = 6.0) -> float:
    """Simulates a planar body with two driven wheels in MuJoCo, without contacts, at the same step of 0.3 ms."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_MUJOCO_ROBOT)
    data = mujoco.MjData(model)
    data.ctrl[:] = 16.0, 10.0
    mujoco.mj_step(model, data, round(seconds / MOTOR_STEP_S))
    return seconds


def _lockstep_pty() -> float:
    """Returns control steps per second over 15 s of the mission. The brick is a process at the other end of a pty."""
    from brickpilot.hil import ends
    from brickpilot.hil import fly as hil

    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=15.0)
    plan = flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0)
    with ends.both_ends("serial:pty") as both:
        flown = hil.fly(both, "serial:pty", plan, pace="lockstep", telemetry_every=10, progress=lambda *_: None)
    return flown.flight.times_real_time / STEP_S


def host() -> dict[str, Figure]:
    """Returns the speeds of the full loop (plant, sensors, controller), of the plant alone, and of a link.

    The plant takes motor steps of 0.3 ms and body steps of 3 ms. The peer is MuJoCo if it is installed, else SciPy's
    LSODA. The peer of the link is real time.
    """
    model = rcx()
    if find_spec("mujoco"):
        peer, rate = "MuJoCo, planar body and two wheels without contacts, 0.3 ms", _best(_mujoco)
    else:
        peer, rate = "SciPy LSODA, the same equations, rtol 1e-6", _best(lambda: _scipy(model), 3)
    steps = max(_lockstep_pty() for _ in range(3))
    full, alone = _best(_full_loop), _best(lambda: _plant_alone(model))
    return {
        "full_loop": Figure(full, "times real time", peer, full / rate),
        "plant": Figure(alone, "times real time", peer, alone / rate),
        "lockstep_pty": Figure(steps, "steps/s", "real time, one step in 3 ms", steps * STEP_S),
    }
