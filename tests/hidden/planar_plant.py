"""The planar plant: a robot on brush tyres. It is derived from mechanics and shares no code with brickpilot's plant.

State: currents, wheel speeds, velocity of the axle's middle, wheel angles, heading, and the stretch of the tyres'
brushes (with backlash also the rotors). One matrix exponential per step advances the linear part (windings, tyres,
losses, masses) exactly, for all runs at once; the nonlinear part acts as torques and forces held over the step
(exponential Euler method, Hochbruck & Ostermann 2010, Acta Numerica 19). A tyre is a spring whose stretch decays as the
wheel rolls (brush model, Pacejka 2012, ch. 3): under load a tyre creeps by less than a thousandth of its speed. Dry
friction is a stiff spring that yields (Prandtl 1928), so that it holds a body at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hidden.recipe import GRAVITY, Floats, Vehicle

Hook = Callable[["Plant"], None]

# Tyres: a wheel whose force equals its load creeps by 1/300 of its speed, after a few millimetres of rolling.
CREEP_STIFFNESS = 300.0  # force over load, at a slip of 1
RELAXATION_M = 0.003
BRUSH_DAMPING = 0.6  # damping ratio of the wheel relative to the body, at rest

# Contacts: stiffness and damping as shares of the values that would stop the motion within one step.
SPRING_SHARE, DAMPER_SHARE = 0.2, 0.6  # dry friction
TEETH_SPRING, TEETH_DAMPER = 0.1, 0.9  # gear teeth: overdamped, so that they do not bounce

COPPER = 0.00393  # 1/K: relative change of copper's resistance
SUPPLY_FILTER_S = 0.001  # the drive's buffer capacitor
SUPPLY_FLOOR = 0.01  # least supply as a share of the nominal battery voltage

# Rows of the state.
CURRENT, WHEEL, BODY, ANGLE = slice(0, 2), slice(2, 4), slice(4, 7), slice(7, 9)
SURGE, SWAY, YAW, HEADING = 4, 5, 6, 9
BRUSH, SIDE_BRUSH, ROTOR, PLAY = slice(10, 12), 12, slice(13, 15), slice(15, 17)
# Inputs, counted from the end of the state.
VOLTAGE, TORQUE, GEAR, FORCE = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 9)
INPUTS = 9
LEFT_RIGHT = np.array([[1.0], [-1.0]])  # sign of a forward force's clockwise moment at the left and the right wheel


class Slider:
    """Dry friction of one motion: a stiff spring and damper with a limited force.

    Args:
        speeds: rows of the state with the speeds of the motion.
        forces: rows of the inputs on which the friction acts, one input for each speed.
        shares: (motions, speeds): how much a unit of each motion's friction adds to each input.
        shape: shape of the speeds that `force` or `planar` take.
    """

    def __init__(self, speeds: slice, forces: slice, shares: Sequence[Sequence[float]], shape: tuple[int, ...]) -> None:
        self.speeds, self.forces, self.shares = speeds, forces, np.array(shares)
        self.stretch = np.zeros(shape)  # the spring's force

    def tune(self, response: Floats) -> None:
        """Sets stiffness and damping. `response`: change of `speeds` in one step per unit of each of `forces`."""
        largest = (self.shares @ response @ self.shares.T).diagonal().max()
        self.spring, self.damping = SPRING_SHARE / largest, DAMPER_SHARE / largest

    def force(self, speed: Floats, against_forward: Floats | float, against_backward: Floats | float) -> Floats:
        """Returns the friction on the moving part, between -`against_forward` and `against_backward`."""
        force = self.stretch
        force += self.spring * speed
        np.clip(force, -against_backward, against_forward, out=force)
        total: Floats = -np.clip(force + self.damping * speed, -against_backward, against_forward)
        return total

    def planar(self, speed: Floats, bound: Floats | float) -> Floats:
        """Returns the friction (2, n) against a velocity (2, n); its magnitude is at most `bound`."""
        force = self.stretch
        force += self.spring * speed
        force *= np.minimum(1.0, bound / np.maximum(np.hypot(force[0], force[1]), 1e-30))
        total: Floats = -(force + self.damping * speed)
        total *= np.minimum(1.0, bound / np.maximum(np.hypot(total[0], total[1]), 1e-30))
        return total


class Plant:
    """One vehicle in several runs. All runs advance together.

    Effects change the build values and add hooks; then `assemble` is called once, and `advance_by` in each step. Hooks
    in ``drive`` change ``voltage``; hooks in ``loads`` add to ``torque`` (on the wheels), ``gear`` (on the motors' side
    of the play) and ``force`` (X, Y, N at the axle's middle); hooks in ``bounds`` add to ``bound``, the limit of the
    wheels' dry friction. Arrays are (2, runs), left and right, or (runs,); frame and units are as in `recipe.Hidden`.
    """

    def __init__(self, vehicle: Vehicle, runs: int, step: float) -> None:
        self.vehicle, self.runs, self.step = vehicle, runs, step
        self.mass, self.yaw_inertia, self.com = vehicle.mass, vehicle.yaw_inertia, np.zeros(2)
        self.radius = vehicle.wheel_radius * np.ones((2, 1))
        self.flux = np.ones((2, 1))
        self.creep: dict[str, float] = {}  # "wheel" (along), "side" (across) -> creep, m/(N s), in place of a brush
        self.rotor_share = 0.0  # share of the wheel's inertia on the motor's side of the play; 0: no play
        self.supply_slope = self.supply_resistance = self.supply_fade = 0.0
        self.heating: tuple[float, float] | None = None  # thermal resistance, time constant
        self.falls: list[Callable[[Plant], Floats]] = []  # further voltage losses of the supply
        self.command_delay = 0.0
        self.late_start: Floats | float = 0.0  # delay of the start, s: for all runs, or (runs,) for each run
        self.frames: tuple[float, float] | None = None  # delay and jitter, s, of the frames that carry commands
        self.against = np.zeros((2, 2, runs))  # wheels' dry friction: (against forward or backward, side, run)
        self.drive: list[Hook] = []
        self.loads: list[Hook] = []
        self.bounds: list[Hook] = []
        self.downhill = (0.0, 0.0)  # sine of the floor's fall along x and y
        self.waves: tuple[float, float] | None = None  # largest slope of the floor along x, and its wave length
        self.needs_position = False
        self.sliders: list[Slider] = []
        self.dry = self.slider("wheels")
        self.time = 0.0
        self.age = np.zeros(runs)  # s since power-on, at each run's start

    # ---- building

    def memory(self, rows: int) -> Floats:
        """Returns (rows, runs) of zeros, as the state of a hook."""
        return np.zeros((rows, self.runs))

    def slider(self, motion: str, forward: float = 0.0) -> Slider:
        """Returns the dry friction of a motion: of both "wheels", of the body's "yaw" or its "point" (forward, 0)."""
        made = {
            "wheels": Slider(WHEEL, TORQUE, [[1, 0], [0, 1]], (2, self.runs)),
            "yaw": Slider(BODY, FORCE, [[0, 0, 1]], (self.runs,)),
            "point": Slider(BODY, FORCE, [[1, 0, 0], [0, 1, forward]], (2, self.runs)),
        }[motion]
        self.sliders.append(made)
        return made

    def assemble(self, charge: Floats, heat: Floats) -> None:
        """Computes the exact step of the linear part, and sets a state at rest at the origin.

        Args:
            charge: (runs,) C drawn before each run.
            heat: (2, runs) temperature of both windings above the surroundings, K.
        """
        slope, gain = self._linear()
        size = len(slope)
        block = np.zeros((size + INPUTS, size + INPUTS))
        block[:size, :size], block[:size, size:] = slope, gain
        self.step_matrix = expm(block * self.step)[:size]
        self.everything = np.zeros((size + INPUTS, self.runs))
        self.next = np.zeros((size, self.runs))
        x, inputs = self.everything[:size], self.everything[size:]
        self.state, self.loading = x, inputs[2:]
        self.current, self.wheel, self.angle, self.brush = (
            x[CURRENT],
            x[WHEEL],
            x[ANGLE],
            x[BRUSH.start : SIDE_BRUSH + 1],
        )
        self.surge, self.sway, self.yaw, self.heading = x[SURGE], x[SWAY], x[YAW], x[HEADING]
        self.rotor = x[self.rotor_rows]
        self.voltage, self.torque, self.gear, self.force = (inputs[s] for s in (VOLTAGE, TORQUE, GEAR, FORCE))
        self.position = np.zeros((2, self.runs))
        self.charge, self.heat = charge.copy(), heat.copy()
        fallen = self.supply_slope * charge + self.supply_fade * self.age
        self.supply = np.maximum(self.vehicle.battery_voltage - fallen, self.supply_floor)
        self.supply_current = np.zeros(self.runs)
        self.is_dry = bool(self.bounds) or bool(self.against.any())
        self.rolled = self.step / RELAXATION_M * self.radius
        for slider in self.sliders:
            slider.tune(self.step_matrix[slider.speeds, size:][:, slider.forces])
        if self.rotor_share:
            apart = (
                self.step_matrix[WHEEL.start, size + TORQUE.start] + self.step_matrix[ROTOR.start, size + GEAR.start]
            )
            self.teeth = (TEETH_SPRING / (apart * self.step), TEETH_DAMPER / apart)

    @property
    def supply_floor(self) -> float:
        return SUPPLY_FLOOR * self.vehicle.battery_voltage

    def _linear(self) -> tuple[Floats, Floats]:
        """Returns A (n, n) and B (n, INPUTS) of x' = A x + B inputs."""
        v = self.vehicle
        size = PLAY.stop if self.rotor_share else SIDE_BRUSH + 1
        a, b = np.zeros((size, size)), np.zeros((size, INPUTS))
        wheel_inertia = (1 - self.rotor_share) * v.wheel_inertia
        driven_inertia = self.rotor_share * v.wheel_inertia or wheel_inertia
        inductance = max(v.inductance, 1e-5 * v.resistance)  # a stated 0 H becomes a winding that settles within 10 us
        for k, side in enumerate((1.0, -1.0)):
            current, wheel, rotor = CURRENT.start + k, WHEEL.start + k, self.rotor_rows.start + k
            a[current, current] = -v.resistance / inductance
            a[current, rotor] = -v.emf_constant * self.flux[k, 0] / inductance
            b[current, VOLTAGE.start + k] = 1 / inductance
            a[rotor, current] = v.torque_constant * self.flux[k, 0] / driven_inertia
            b[rotor, GEAR.start + k] = 1 / driven_inertia
            a[wheel, wheel] = -self.losses()[k, 0] / wheel_inertia
            b[wheel, TORQUE.start + k] = 1 / wheel_inertia
            a[ANGLE.start + k, wheel] = 1.0
            if self.rotor_share:
                a[PLAY.start + k, rotor], a[PLAY.start + k, wheel] = 1.0, -1.0
            self._tyre(a, k, side, wheel_inertia)
        self._side_tyre(a)
        a[HEADING, YAW] = 1.0
        # Forces at the axle's middle become accelerations there; the centre of mass may be elsewhere.
        forward, right = self.com
        m = self.mass
        inertias = np.array(
            [[m, 0, -m * right], [0, m, m * forward],
             [-m * right, m * forward, self.yaw_inertia + m * (forward**2 + right**2)]]
        )  # fmt: skip
        inverse = np.linalg.inv(inertias)
        a[BODY] = inverse @ a[BODY]
        b[BODY, FORCE] = inverse
        return a, b

    def losses(self) -> Floats:
        """Returns the losses (2, 1) of the wheels, N m s/rad: as in nominal values, each wheel bears all weight."""
        return self.vehicle.viscous_friction + self.mass * GRAVITY * self.vehicle.rolling_friction * self.radius**2

    def _tyre(self, a: Floats, k: int, side: float, inertia: float) -> None:
        """Adds the tyre force for the slip s = r_w w - (u +- b r). The body's rows of `a` hold forces here."""
        radius, track = self.radius[k, 0], self.vehicle.half_track
        slip = np.zeros(len(a))
        wheel, brush = WHEEL.start + k, BRUSH.start + k
        slip[wheel], slip[SURGE], slip[YAW] = radius, -1.0, -side * track
        if "wheel" in self.creep:
            force = slip / self.creep["wheel"]
        else:
            stiffness = self.brush_stiffness(0.5)
            lightest = 1 / (radius**2 / inertia + 1 / self.mass + track**2 / self.yaw_inertia)
            force = 2 * BRUSH_DAMPING * np.sqrt(stiffness * lightest) * slip
            force[brush] += stiffness
            a[brush] = slip
        a[wheel] -= force * radius / inertia
        a[SURGE] += force
        a[YAW] += side * track * force

    def _side_tyre(self, a: Floats) -> None:
        slip = np.zeros(len(a))
        slip[SWAY] = 1.0
        if "side" in self.creep:
            a[SWAY] -= slip / self.creep["side"]
            return
        stiffness = self.brush_stiffness(1.0)
        a[SWAY] -= 2 * BRUSH_DAMPING * np.sqrt(stiffness * self.mass) * slip
        a[SWAY, SIDE_BRUSH] -= stiffness
        a[SIDE_BRUSH] = slip

    def brush_stiffness(self, load_share: float) -> float:
        """Returns the stiffness of a brush, N/m, for a tyre with this share of the weight."""
        return CREEP_STIFFNESS * load_share * self.mass * GRAVITY / RELAXATION_M

    @property
    def rotor_rows(self) -> slice:
        return ROTOR if self.rotor_share else WHEEL

    # ---- running

    def advance_by(self, command: Floats, running: NDArray[np.bool_]) -> None:
        """Does one step with commanded voltages (2, runs). Finished runs (`running` False) draw no current."""
        self.command = command
        self.voltage[:] = command
        self._draw(running)
        u, v, r = self.surge, self.sway, self.yaw
        forward, right = self.com
        self.loading[:] = 0.0
        turn = self.mass * r
        self.force[0] = turn * (v + forward * r)
        self.force[1] = turn * (right * r - u)
        if forward or right:
            self.force[2] = -turn * (forward * u + right * v)
        for load in self.loads:
            load(self)
        if self.is_dry:
            self.bound = self.against.copy()
            for bound in self.bounds:
                bound(self)
            self.torque += self.dry.force(self.wheel, self.bound[0], self.bound[1])
        self._roll_tyres()
        if self.needs_position:
            cosine, sine = np.cos(self.heading), np.sin(self.heading)
            self.position += self.step * np.array([u * cosine - v * sine, u * sine + v * cosine])
        np.matmul(self.step_matrix, self.everything, out=self.next)
        self.state[:] = self.next
        self.time += self.step

    def _draw(self, running: NDArray[np.bool_]) -> None:
        """Turns commands into voltages at the motors, by supply, drive and warm windings; adds up charge and heat."""
        nominal = self.vehicle.battery_voltage
        falling = bool(self.supply_slope or self.supply_resistance or self.supply_fade or self.falls)
        if falling:
            fallen = self.supply_slope * self.charge + self.supply_fade * (self.age + self.time)
            wanted = nominal - fallen - self.supply_resistance * self.supply_current
            for fall in self.falls:
                wanted = wanted - fall(self)
            self.supply += (self.step / SUPPLY_FILTER_S) * (np.maximum(wanted, self.supply_floor) - self.supply)
            self.voltage *= self.supply / nominal
        for hook in self.drive:
            hook(self)
        if falling:
            self.supply_current = (self.voltage * self.current).sum(axis=0) / self.supply
            self.charge += self.step * running * self.supply_current
        if self.heating:
            thermal, constant = self.heating
            warmer = self.vehicle.resistance * COPPER * self.heat
            loss = (self.vehicle.resistance + warmer) * self.current**2
            self.heat += (self.step / constant) * running * (thermal * loss - self.heat)
            self.voltage -= warmer * self.current

    def _roll_tyres(self) -> None:
        """Reduces the stretch of the brushes as the wheels roll on."""
        rolled = 1.0 + self.rolled * np.abs(self.wheel)
        self.brush[:2] /= rolled
        self.brush[2] /= rolled.mean(axis=0)


def in_body(plant: Plant, x: Floats | float, y: Floats | float) -> tuple[Floats, Floats]:
    """Returns a vector given in the earth's axes as components ahead and to the right of each vehicle."""
    cosine, sine = np.cos(plant.heading), np.sin(plant.heading)
    return x * cosine + y * sine, y * cosine - x * sine
