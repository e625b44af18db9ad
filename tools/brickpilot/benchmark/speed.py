"""Speed, side by side with a peer in the same process, because absolute times on a shared machine mean little."""

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
    """``value`` in ``unit``; ``peer`` ran beside it, and we were ``ratio`` times faster."""

    value: float
    unit: str
    peer: str
    ratio: float


def _best(work: Callable[[], float], repeats: int = 5) -> float:
    """Times real time of `work`, which returns simulated seconds: the best, least disturbed, of several runs."""
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
    """The same robot as a text-book ODE under SciPy's LSODA, inputs renewed every 3 ms as the plant's are."""
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
    """A free planar body with two driven wheels in MuJoCo, contacts off, at the same 0.3 ms step."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_MUJOCO_ROBOT)
    data = mujoco.MjData(model)
    data.ctrl[:] = 16.0, 10.0
    mujoco.mj_step(model, data, round(seconds / MOTOR_STEP_S))
    return seconds


def _lockstep_pty() -> float:
    """Control steps per second of the mission's first 15 s, the brick a process at the other end of a pty."""
    from brickpilot.hil import ends
    from brickpilot.hil import fly as hil

    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=15.0)
    plan = flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0)
    with ends.both_ends("serial:pty") as both:
        flown = hil.fly(both, "serial:pty", plan, pace="lockstep", telemetry_every=10, progress=lambda *_: None)
    return flown.flight.times_real_time / STEP_S


def host() -> dict[str, Figure]:
    """The full loop (plant, sensors, controller), the plant alone, 0.3 ms motor and 3 ms body steps, and a link.

    The peer is MuJoCo where it is installed, else SciPy's LSODA; that of the link is real time.
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
