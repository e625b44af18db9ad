"""Measures our speed and a peer's speed in one process, because absolute times mean little on a shared machine.

A peer is another library that does the same work. One peer is SciPy's `solve_ivp`, which solves the packaged robot as a
text-book ODE at equal accuracy. The equations are those of the plant's profile `coupled` (eq. 2, 5, 12 to 14), written
here from the paper. `loosest` finds the largest tolerance at which SciPy is as accurate as the plant with its steps of
0.3 ms and 3 ms. `METHODS` are SciPy's fastest methods for this robot. If inputs are held, LSODA is at least 1.6 times
as fast as the other methods. If the solver restarts in each step, RK23 needs half as many evaluations as RK45.
"""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brickpilot import catalogue, compiled
from brickpilot.constants import MOTOR_STEP_S, STEP_S
from brickpilot.errors import InputError, SimulationError
from brickpilot.hil.checkout import in_lab
from brickpilot.vehicle import flight, plant, scenario
from brickpilot.vehicle.model import Model, rcx

Array = NDArray[np.float64]

_TIMES = "times real time"
_LANES = {"alone": 1, "many": plant.MOST_LANES}


@dataclass(frozen=True)
class Figure:
    """A speed of our program: ``value`` in ``unit``; it is ``ratio`` times the speed of ``peer`` in the same process.

    If the unit is a cost, such as cycles/step, the ratio is the peer's cost divided by our cost. So a ratio above 1
    always means that we are faster. Our program and the peer ran on ``machine``.
    """

    value: float
    unit: str
    peer: str
    ratio: float
    machine: str


@dataclass(frozen=True)
class LawFigure(Figure):
    """A step of the control law on a brick's processor; ``value`` and ``ratio`` are those of a typical step (median).

    Attributes:
        most, peer_most: the cost of the most expensive step, ours and the peer's, in ``unit``.
        flash_bytes, peer_flash_bytes: size of the law's code and constants, with the routines of its arithmetic.
        apart_v: the largest difference between the motor voltages of the two programs, in V.
    """

    most: int
    peer_most: int
    flash_bytes: int
    peer_flash_bytes: int
    apart_v: float


def _best(works: Mapping[str, Callable[[], float]], repeats: int = 5) -> dict[str, float]:
    """Returns each function's best speed of `repeats` runs: simulated s (its result) per s of processor time.

    The functions in `works` run in turn, so that other programs on the machine disturb all of them equally.
    """
    rates = dict.fromkeys(works, 0.0)
    for _ in range(repeats):
        for name, work in works.items():
            began = time.process_time()
            simulated = work()
            rates[name] = max(rates[name], simulated / (time.process_time() - began))
    return rates


def _full_loop() -> float:
    mission = scenario.load(scenario.packaged()["mission"])
    plan = flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=0)
    flight.fly(plan, columns=())
    return plan.steps * STEP_S


def _plant_alone(model: Model) -> float:
    time_s = np.arange(20_001, dtype=np.float64) * STEP_S
    inputs = np.tile([4.5, 3.0], (len(time_s), 1))
    plant.simulate([(model, plant.OpenLoopRun(time_s, inputs))])
    return float(time_s[-1])


def _many(model: Model, lanes: int) -> float:
    """Simulates one run of each of 16 robots on one thread, as in a fit; up to `lanes` runs are simulated together."""
    time_s = np.arange(2_001, dtype=np.float64) * STEP_S
    inputs = 6 * np.sin(np.outer(time_s, [1.0, 1.7])) + 3
    mass = model.parameters["mass"]
    robots = [dataclasses.replace(model, parameters={**model.parameters, "mass": mass + 0.01 * i}) for i in range(16)]
    jobs = [(robot, plant.OpenLoopRun(time_s, inputs)) for robot in robots]
    plant.simulate(jobs, signals=("yaw_rate", "wheel_speed_left", "wheel_speed_right"), lanes=lanes)
    return 16 * float(time_s[-1])


def _side_by_side(model: Model) -> dict[str, Figure]:
    """Returns the plant's speed for many runs side by side on one core, compared with the same runs one at a time."""
    figures = {}
    rubs = next(
        effect.name for effect in catalogue.effects() if effect.mechanism == "bearing" and not effect.variant_of
    )
    dry = dataclasses.replace(model, effects={**model.effects, rubs: {}})
    for name, robot in (("plant_lanes", model), ("plant_lanes_dry", dry)):
        rates = _best({lanes: partial(_many, robot, count) for lanes, count in _LANES.items()}, 9)
        alone, many = (rates[lanes] for lanes in _LANES)
        peer = f"the same 16 runs one at a time, {alone / MOTOR_STEP_S:.2e} motor steps/s"
        figures[name] = Figure(many / MOTOR_STEP_S, "motor steps/s", peer, many / alone, this_machine())
    return figures


_MUJOCO_ROBOT = f"""
<mujoco><option timestep="{MOTOR_STEP_S}" integrator="Euler" gravity="0 0 0" jacobian="dense">
<flag contact="disable" constraint="disable" gravity="disable" sensor="disable"/></option>
<default><geom type="cylinder" size=".04 .01" euler="90 0 0" mass=".02" contype="0" conaffinity="0"/></default>
<worldbody><body>
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>
<geom type="box" size=".1 .07 .03" euler="0 0 0" mass=".9"/>
<body pos="0 .07 0"><joint name="l" axis="0 1 0"/><geom/></body>
<body pos="0 -.07 0"><joint name="r" axis="0 1 0"/><geom/></body>
</body></worldbody><actuator><velocity joint="l" kv=".002"/><velocity joint="r" kv=".002"/></actuator></mujoco>
"""


@cache
def _mujoco_model() -> Any:
    """Returns the robot in MuJoCo, compiled once. For speed, functions that the robot does not need are off."""
    import mujoco

    return mujoco.MjModel.from_xml_string(_MUJOCO_ROBOT)


def _mujoco(seconds: float = 6.0) -> float:
    """Simulates a planar body with two driven wheels in MuJoCo, without contacts, at the plant's step of 0.3 ms."""
    import mujoco

    model = _mujoco_model()
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
    """Returns the speeds of the full loop (plant, sensors, controller), of the plant alone, and of a link, with peers.

    The plant takes motor steps of 0.3 ms and body steps of 3 ms. The peers are MuJoCo, if it is installed, and SciPy's
    solve_ivp at the plant's own accuracy. The inputs of both peers change every 3 ms for the full loop, and every
    second for the plant alone. Both peers simulate the robot without controller and sensors. The link is compared with
    real time.
    """
    model, on = rcx(), this_machine()
    ours: dict[str, Callable[[], float]] = {"full_loop": _full_loop, "plant": partial(_plant_alone, model)}
    scipy = {"full_loop": _scipy(model, controlled()), "plant": _scipy(model, held())}
    mujoco: dict[str, Callable[[], float]] = {}
    if find_spec("mujoco"):
        _mujoco_model()  # compiles before the clock starts
        mujoco = {"MuJoCo, planar body and two wheels without contacts, 0.3 ms": _mujoco}
    rates = _best(ours | mujoco | scipy["full_loop"] | scipy["plant"])
    first, by_scipy = {}, {}
    for name in ours:
        fastest = max(scipy[name], key=lambda peer: rates[peer])
        by_scipy[f"{name}_scipy"] = Figure(rates[name], _TIMES, fastest, rates[name] / rates[fastest], on)
        first[name] = by_scipy[f"{name}_scipy"]
        for peer in mujoco:
            first[name] = Figure(rates[name], _TIMES, peer, rates[name] / rates[peer], on)
    steps = max(_lockstep_pty() for _ in range(3))
    link = Figure(steps, "steps/s", "real time, one step in 3 ms", steps * STEP_S, on)
    return first | by_scipy | _side_by_side(model) | {"lockstep_pty": link}


def _scipy(model: Model, manoeuvre: Manoeuvre) -> dict[str, Callable[[], float]]:
    """Returns a SciPy method's description -> a function that solves the manoeuvre as accurately as the plant does."""

    def fly(setting: SolverSetting) -> float:
        solve(model, manoeuvre, setting.tolerance, setting.method)
        return manoeuvre.seconds

    held = f"inputs held for {manoeuvre.held * STEP_S:.3g} s"
    methods: dict[str, Callable[[], float]] = {}
    for setting in loosest(model, manoeuvre):
        errors = f"errs {setting.scipy_m:.0e} m where the plant errs {setting.plant_m:.0e} m"
        methods[f"SciPy solve_ivp, {setting}, {held}, {errors}"] = partial(fly, setting)
    return methods


def control_law() -> tuple[dict[str, LawFigure], list[str]]:
    """Returns the control law's cost on each brick's processor, compared with peers, and why a brick is missing.

    In a checkout, `tests/lab/control_peers.py` measures the cost.
    """
    try:
        done = in_lab("step_costs", "law", field="control law", stdout=subprocess.PIPE)
    except InputError as error:
        return {}, [str(error)]
    if done.returncode != 0:
        raise SimulationError("the control law could not be measured")
    law = json.loads(done.stdout)
    return {name: LawFigure(**figure) for name, figure in law["figures"].items()}, law["missing"]


def lines(figures: Mapping[str, Figure], laws: Mapping[str, LawFigure]) -> Iterator[str]:
    """Yields the speeds and the control law's costs as text: first the machine, then each ratio with its values."""
    yield f"on {next(iter(figures.values())).machine}; both sides of a ratio were measured in this run"
    for name, figure in figures.items():
        yield f"{figure.ratio:8.1f} x  {name}: {figure.value:.0f} {figure.unit}, beside {figure.peer}"
    for name, law in laws.items():
        yield f"{law.ratio:8.2f} x  {name}: {law.value:.0f} {law.unit} (at most {law.most}), beside {law.peer}"
        cost = f"{law.ratio * law.value:.0f} (at most {law.peer_most})"
        flash = f"{law.flash_bytes} and {law.peer_flash_bytes} bytes"
        yield f"{'':12}{cost}; flash {flash}; answers within {1e3 * law.apart_v:.0f} mV; {law.machine}"


METHODS = ("LSODA", "RK45", "RK23")
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
_EXACT = 1e-10

VOLTAGES = ((4.5, 3.0), (-3.0, 6.0), (6.0, 6.0))
"""Voltages (left, right) in V, each held for `HELD` steps: a curve, nearly a turn on the spot, a straight drive."""

HELD = 333
_FIRST_STEP = STEP_S / 5  # s: SciPy's first step within a control step; the fastest of six tried values
STATES = 7


@dataclass(frozen=True)
class Manoeuvre:
    """Inputs that change in steps: each row of ``voltages`` (pieces, 2) holds for ``held`` steps of `STEP_S`."""

    held: int
    voltages: Array

    @property
    def seconds(self) -> float:
        return float(len(self.voltages) * self.held * STEP_S)


def held() -> Manoeuvre:
    """Returns `VOLTAGES`, each held for a second: the best case for SciPy, because it can take long steps."""
    return Manoeuvre(HELD, np.array(VOLTAGES))


def controlled() -> Manoeuvre:
    """Returns `VOLTAGES` with a small change in every step of 3 ms, like a controller's voltages in a closed loop."""
    pieces = np.repeat(np.array(VOLTAGES), HELD, axis=0)
    ripple = 0.2 * np.sin(0.7 * np.arange(len(pieces)))
    return Manoeuvre(1, pieces + np.column_stack([ripple, -ripple]))


def slope_of(model: Model) -> Callable[..., list[float]]:
    """Returns the function slope(time, state, left, right); state: currents, wheel speeds, heading, x and y."""
    p = model.parameters
    resistance, inductance, radius, track = p["resistance"], p["inductance"], p["wheel_radius"], p["half_track"]
    torque, emf = p["torque_constant"], p["emf_constant"]
    loss = p["viscous_friction"] + p["mass"] * p["gravity"] * p["rolling_friction"] * radius**2
    inertia_sum = p["wheel_inertia"] + p["mass"] * radius**2 / 2
    inertia_difference = p["wheel_inertia"] + p["yaw_inertia"] * radius**2 / (2 * track**2)
    drag = 0.5 * p["drag_area"] * p["air_density"]

    def slope(_: float, s: Any, left: float, right: float) -> list[float]:
        i_l, i_r, w_l, w_r, heading = s[:5]
        torque_l, torque_r = torque * i_l - loss * w_l, torque * i_r - loss * w_r
        surge = radius * (w_l + w_r) / 2
        common = ((torque_l + torque_r) / 2 - radius * drag * surge * abs(surge) / 2) / inertia_sum
        difference = (torque_l - torque_r) / 2 / inertia_difference
        return [
            (left - resistance * i_l - emf * w_l) / inductance,
            (right - resistance * i_r - emf * w_r) / inductance,
            common + difference,
            common - difference,
            radius * (w_l - w_r) / (2 * track),
            surge * cos(heading),
            surge * sin(heading),
        ]

    return slope


def solve(model: Model, manoeuvre: Manoeuvre, tolerance: float, method: Any) -> Array:
    """Returns the robot's states after each step, shape (steps, `STATES`), SI units.

    Args:
        tolerance: rtol; atol is a thousandth of rtol.
        method: a method of `solve_ivp`.
    """
    slope = slope_of(model)
    state, states = [0.0] * STATES, []
    for index, (left, right) in enumerate(manoeuvre.voltages.tolist()):
        times = (index * manoeuvre.held + np.arange(manoeuvre.held + 1)) * STEP_S
        solved: Any = solve_ivp(
            slope,
            (times[0], times[-1]),
            state,
            method,
            args=(left, right),
            rtol=tolerance,
            atol=1e-3 * tolerance,
            t_eval=times[1:] if manoeuvre.held > 1 else None,
            first_step=_FIRST_STEP if manoeuvre.held == 1 else None,
        )
        rows = solved.y.T if manoeuvre.held > 1 else solved.y.T[-1:]
        states.append(rows)
        state = rows[-1].tolist()
    return np.concatenate(states)


def simulate_plant(model: Model, manoeuvre: Manoeuvre) -> Array:
    """Returns the plant's positions after each step, shape (steps, 2), m."""
    steps = len(manoeuvre.voltages) * manoeuvre.held
    inputs = np.repeat(manoeuvre.voltages, manoeuvre.held, axis=0)
    time_s = np.arange(steps + 1, dtype=np.float64) * STEP_S
    [run] = plant.simulate([(model, plant.OpenLoopRun(time_s, np.concatenate([inputs, inputs[-1:]])))])
    return np.column_stack([run.outputs["x"], run.outputs["y"]])[1:]


@dataclass(frozen=True)
class SolverSetting:
    """A method, the tolerance that `loosest` found, and the largest position errors of plant and SciPy, in m."""

    method: str
    tolerance: float
    plant_m: float
    scipy_m: float

    def __str__(self) -> str:
        return f"{self.method}, rtol {self.tolerance:.0e}"


def loosest(model: Model, manoeuvre: Manoeuvre) -> list[SolverSetting]:
    """Returns, for each of `METHODS`, the largest of `TOLERANCES` whose position error is at most the plant's.

    An error is the largest difference over the manoeuvre from a solution at a tolerance of 1e-10.

    Raises:
        SimulationError: no tolerance is as accurate as the plant.
    """
    exact = solve(model, manoeuvre, _EXACT, "LSODA")[:, 5:]
    plant_m = float(np.abs(simulate_plant(model, manoeuvre) - exact).max())
    settings = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            scipy_m = float(np.abs(solve(model, manoeuvre, tolerance, method)[:, 5:] - exact).max())
            if scipy_m <= plant_m:
                settings.append(SolverSetting(method, tolerance, plant_m, scipy_m))
                break
        else:
            raise SimulationError(f"no tolerance of SciPy's {method} errs by {plant_m:.1e} m at most")
    return settings


def this_machine() -> str:
    """Returns one line: "Intel(R) Xeon(R) Processor, 2 cores, gcc (Debian 12.2.0-14) 12.2.0"."""
    return f"{processor()}, {cores()} cores, {compiler()}"


def processor() -> str:
    """Returns the name of the processor, from Linux or Python's platform module."""
    cpuinfo = Path("/proc/cpuinfo")
    model = re.search(r"^model name\s*: (.+)$", cpuinfo.read_text(), re.MULTILINE) if cpuinfo.exists() else None
    return model[1].strip() if model else platform.processor() or platform.machine()


def cores() -> int:
    """Returns the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiler() -> str:
    """Returns the compiler's name and version, which it writes into the plant's library."""
    mark = re.search(rb"GCC: (\([^)\0]*\) [\d.]+)|(?:Apple )?clang version [\d.]+", compiled.library().read_bytes())
    if mark is None:
        return "a compiler that does not tell its name"
    return f"gcc {mark[1].decode()}" if mark[1] else mark[0].decode()
