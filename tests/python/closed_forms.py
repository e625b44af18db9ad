"""The robot of the blind tests in closed form: the results that an engine has to give if no other law acts."""

from __future__ import annotations

from hidden.manoeuvre import Manoeuvre, steps
from hidden.recipe import BENCH
from scipy.optimize import brentq

CONDUCTANCE = BENCH.torque_constant / BENCH.resistance  # N m/V
DAMPING = BENCH.wheel_damping() + CONDUCTANCE * BENCH.emf_constant  # N m s/rad, back EMF and losses
FREE = CONDUCTANCE / DAMPING  # rad/s per V, without a load
RADIUS, TRACK = BENCH.wheel_radius, BENCH.half_track


def hold(left: float, right: float, seconds: float = 3.0) -> Manoeuvre:
    return steps("hold", seconds, (0.0, left, right))


def balance(volts: float, load) -> float:
    """Returns the speed w, rad/s, at which a wheel's motor balances load(w), N m, and its own losses."""
    return brentq(lambda w: CONDUCTANCE * volts - DAMPING * w - load(w), -60, 60, xtol=1e-12)
