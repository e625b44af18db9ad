"""The packaged robot once more, as a text-book ODE for SciPy's `solve_ivp`: a peer in speed, at equal accuracy.

The equations are those of the plant's profile `coupled` (eq. 2, 5, 12 to 14), written here from the paper. `loosest`
looks for the tolerance that is just as accurate as the plant with its steps of 0.3 ms and 3 ms, so that neither is
charged for digits that the other does not have. Of SciPy's methods `METHODS` are the fastest here: LSODA where inputs
are held, by 1.6 times and more, and RK23 where each step begins anew, with half of RK45's evaluations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brickpilot.constants import STEP_S
from brickpilot.errors import SimulationError
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

METHODS = ("LSODA", "RK45", "RK23")
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
_EXACT = 1e-10

VOLTAGES = ((4.5, 3.0), (-3.0, 6.0), (6.0, 6.0))
"""V left and right of the manoeuvre, each for `HELD` steps: a curve, a turn nearly on the spot, and straight on."""

HELD = 333
_FIRST_STEP = STEP_S / 5  # of a step that begins anew: the fastest of six tried, from a tenth of it to the whole
STATES = 7


@dataclass(frozen=True)
class Manoeuvre:
    """Inputs held for some steps of `STEP_S`: ``held`` steps each, ``voltages`` (pieces, 2)."""

    held: int
    voltages: Array

    @property
    def seconds(self) -> float:
        return float(len(self.voltages) * self.held * STEP_S)


def held() -> Manoeuvre:
    """Returns `VOLTAGES`, each held for a second: SciPy at its best, for it takes long steps."""
    return Manoeuvre(HELD, np.array(VOLTAGES))


def controlled() -> Manoeuvre:
    """Returns the same as in a closed loop: a controller's voltages change a little in every step of 3 ms."""
    pieces = np.repeat(np.array(VOLTAGES), HELD, axis=0)
    ripple = 0.2 * np.sin(0.7 * np.arange(len(pieces)))
    return Manoeuvre(1, pieces + np.column_stack([ripple, -ripple]))


def slope_of(model: Model) -> Callable[..., list[float]]:
    """Returns the robot's slope(time, state, left, right): state is currents, wheel speeds, heading, x and y."""
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
        tolerance: rtol; atol is a thousandth of it.
        method: of `solve_ivp`.
    """
    slope = slope_of(model)
    state, found = [0.0] * STATES, []
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
        found.append(rows)
        state = rows[-1].tolist()
    return np.concatenate(found)


def simulate(model: Model, manoeuvre: Manoeuvre) -> Array:
    """Returns the plant's positions after each step, shape (steps, 2), m."""
    steps = len(manoeuvre.voltages) * manoeuvre.held
    inputs = np.repeat(manoeuvre.voltages, manoeuvre.held, axis=0)
    time_s = np.arange(steps + 1, dtype=np.float64) * STEP_S
    [run] = plant.simulate([(model, plant.OpenLoopRun(time_s, np.concatenate([inputs, inputs[-1:]])))])
    return np.column_stack([run.outputs["x"], run.outputs["y"]])[1:]


@dataclass(frozen=True)
class Setting:
    """A method and the tolerance of `loosest`, and the largest errors of position, m: the plant's and SciPy's."""

    method: str
    tolerance: float
    plant_m: float
    scipy_m: float

    def __str__(self) -> str:
        return f"{self.method}, rtol {self.tolerance:.0e}"


def loosest(model: Model, manoeuvre: Manoeuvre) -> list[Setting]:
    """Returns for each of `METHODS` the largest of `TOLERANCES` with which its position errs no more than the plant's.

    The errors are the largest over the manoeuvre, from a solution at a tolerance of 1e-10.

    Raises:
        SimulationError: no tolerance is as accurate.
    """
    exact = solve(model, manoeuvre, _EXACT, "LSODA")[:, 5:]
    plant_m = float(np.abs(simulate(model, manoeuvre) - exact).max())
    found = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            scipy_m = float(np.abs(solve(model, manoeuvre, tolerance, method)[:, 5:] - exact).max())
            if scipy_m <= plant_m:
                found.append(Setting(method, tolerance, plant_m, scipy_m))
                break
        else:
            raise SimulationError(f"no tolerance of SciPy's {method} errs by {plant_m:.1e} m at most")
    return found
