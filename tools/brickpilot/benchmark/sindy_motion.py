"""What the library of the peer is computed from: the nominal model as two modes, and the motion of one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brickpilot import catalogue
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

GRAVITY = catalogue.parameter("gravity").preset
_HEATING_S = 25.0  # time constant of a winding


@dataclass(frozen=True)
class Modes:
    """The nominal model as two modes. At one wheel: inertias kg m^2, `losses` N m s/rad, `drive` (K_t / R) N m/V."""

    mass: float
    radius: float
    half_track: float
    yaw_inertia: float
    mean_inertia: float
    difference_inertia: float
    losses: float
    drive: float
    emf: float
    torque_constant: float
    resistance: float
    battery: float

    @property
    def decay(self) -> tuple[float, float]:
        """Decay rates of the mean and of the difference, 1/s."""
        stiffness = self.drive * self.emf + self.losses
        return stiffness / self.mean_inertia, stiffness / self.difference_inertia


def modes(model: Model) -> Modes:
    """Returns the modes of the fitted nominal model, with rolling friction as in eq. 14 of the paper."""
    p = model.parameters
    square = p["wheel_radius"] ** 2
    return Modes(
        mass=p["mass"],
        radius=p["wheel_radius"],
        half_track=p["half_track"],
        yaw_inertia=p["yaw_inertia"],
        mean_inertia=p["wheel_inertia"] + 0.5 * p["mass"] * square,
        difference_inertia=p["wheel_inertia"] + 0.5 * p["yaw_inertia"] * square / p["half_track"] ** 2,
        losses=p["viscous_friction"] + p["mass"] * GRAVITY * p["rolling_friction"] * square,
        drive=p["torque_constant"] / p["resistance"],
        emf=p["emf_constant"],
        torque_constant=p["torque_constant"],
        resistance=p["resistance"],
        battery=p["battery_voltage"],
    )


@dataclass(frozen=True)
class Motion:
    """One run: arrays (n,) on an even grid of `step` s, SI, in the frame of the paper.

    Speeds are smoothed measurements if wheels were measured, else those of the nominal model. Accelerations are those
    of the nominal model. At the start of the run, `age` is s since power-on, `charge` is A s drawn, `heat` is K for a
    thermal resistance of 1 K/W.
    """

    step: float
    left: Array
    right: Array
    volts_left: Array
    volts_right: Array
    left_rate: Array
    right_rate: Array
    surge_accel: Array
    sway_accel: Array
    yaw_accel: Array
    age: float
    charge: float
    heat: tuple[float, float]


def winding_heat(amps: Array, resistance: float, start: float, step: float) -> Array:
    """Returns K above the surroundings for a thermal resistance of 1 K/W."""
    kept = np.exp(-step / _HEATING_S)
    return np.asarray(lfilter([1 - kept], [1, -kept], resistance * amps**2, zi=[kept * start])[0])


def carried(of: Modes, run: Motion) -> tuple[float, tuple[float, float]]:
    """Returns charge and heat at the end of `run`, with which the next one begins."""
    amps = [(v - of.emf * w) / of.resistance for v, w in ((run.volts_left, run.left), (run.volts_right, run.right))]
    supply = np.abs(run.volts_left * amps[0] + run.volts_right * amps[1]) / of.battery
    heat = [winding_heat(i, of.resistance, start, run.step)[-1] for i, start in zip(amps, run.heat, strict=True)]
    return run.charge + float(supply.sum()) * run.step, (float(heat[0]), float(heat[1]))
