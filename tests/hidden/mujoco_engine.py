"""Engine "mujoco": a free chassis on two driven wheels and two skids, in contact with a floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from hidden import electrics, measure, mujoco_effects, mujoco_laws, mujoco_model
from hidden.electrics import Electrics, arriving
from hidden.manoeuvre import Manoeuvre
from hidden.mujoco_effects import Step
from hidden.mujoco_model import DT, SIDE_SLIP_RETURN, build, deflate, soften
from hidden.recipe import GRAVITY, Floats, Hidden, Track, Vehicle

SETTLE_S = 0.5
KNOWN = (
    mujoco_effects.EFFECTS.keys()
    | mujoco_laws.LAWS.keys()
    | mujoco_model.EFFECTS
    | electrics.EFFECTS
    | measure.SENSOR_EFFECTS
)


def simulate(
    vehicle: Vehicle, hidden: Hidden, runs: Sequence[Manoeuvre], seed: int, sample_s: float = 0.003
) -> list[Track]:
    """Drives the runs: see `recipe.Engine`. `seed` has no effect, because this engine is deterministic.

    Raises:
        ValueError: this engine does not know an effect, cannot combine two effects, or gets values of which MuJoCo
            cannot make a vehicle.
    """
    del seed
    unknown = hidden.keys() - KNOWN
    if unknown:
        raise ValueError(f"{', '.join(sorted(unknown))}: no such effect")
    bench = _Bench(vehicle, hidden)
    return [bench.drive(run, sample_s, number) for number, run in enumerate(runs)]


class _Bench:
    """A vehicle in MuJoCo. `age` (s since power-on) and `electrics` (charge, heat) carry over to the next run."""

    def __init__(self, vehicle: Vehicle, hidden: Hidden) -> None:
        self.hidden, self.vehicle = hidden, vehicle
        self.model, self.names = build(vehicle, hidden)
        self.data = mujoco.MjData(self.model)
        self.electrics = Electrics(vehicle, hidden, DT)
        self.age = 0.0
        self.constant = np.zeros(self.model.nv)
        for dof, force in self.names.loads.items():
            self.constant[dof] = force
        self.rest = self._settle()
        self.advance: Callable[[mujoco.MjModel, mujoco.MjData], None] = mujoco.mj_step
        if self.names.slip is not None:
            soften(self.model, self.data, self.names.slip)
            self.across = self.names.slip.across
            self.advance = self._slipping_step

    def _settle(self) -> Floats:
        """Lets the vehicle settle on level ground. Returns MuJoCo's `qpos` at rest, with x, y, heading and angles 0."""
        gravity = self.model.opt.gravity.copy()
        self.model.opt.gravity[:2] = 0.0
        self.data.qfrc_applied[:] = self.constant
        for _ in range(round(SETTLE_S / DT)):
            mujoco.mj_step(self.model, self.data)
        self.model.opt.gravity[:] = gravity
        rest = self.data.qpos.copy()
        rest[[0, 1, 6]] = 0.0
        rest[3] = math.sqrt(1 - rest[4] ** 2 - rest[5] ** 2)
        rest[[i for i in range(7, len(rest)) if i not in self.names.slides]] = 0.0
        return np.asarray(rest, dtype=float)

    def _slipping_step(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Does the same as mj_step, but with contact tangents along the vehicle's axes instead of the world's axes."""
        mujoco.mj_step1(model, data)
        heading = 2 * math.atan2(data.qpos[6], data.qpos[3]) + (0.5 * math.pi if self.across else 0.0)
        cosine, sine = math.cos(heading), math.sin(heading)
        for i in range(data.ncon):
            contact = data.contact[i]
            if contact.dim == 3:
                contact.frame[3:] = cosine, sine, 0.0, -sine, cosine, 0.0
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_step2(model, data)

    def drive(self, run: Manoeuvre, sample_s: float, number: int = 0) -> Track:
        model, data, advance = self.model, self.data, self.advance
        deflate(model, self.vehicle, self.hidden, self.age)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = self.rest
        data.qfrc_applied[:] = self.constant
        self.electrics.start_run()
        command = _per_step(run, sample_s)
        fed_left, fed_right = (arriving(side, self.hidden, DT, number).tolist() for side in command)
        steps = len(fed_left) - 1
        positions, speeds, electric = (
            np.empty((steps + 1, model.nq)),
            np.empty((steps + 1, model.nv)),
            np.empty((steps + 1, 3)),
        )
        # The loop below runs 1000 times per simulated second. For speed, it uses views of MuJoCo's arrays and floats.
        qpos, qvel, forces = data.qpos, data.qvel, data.qfrc_applied
        left, right = self.names.motor_dof
        motors, current = self.electrics.step, self.electrics.current
        extras = _Extras(self, number)
        positions[0], speeds[0], electric[0] = qpos, qvel, (0.0, 0.0, self.electrics.battery)
        before_left = before_right = 0.0
        for k in range(steps):
            speed_left, speed_right = qvel[left], qvel[right]
            torque = motors(
                fed_left[k], fed_right[k], 1.5 * speed_left - 0.5 * before_left, 1.5 * speed_right - 0.5 * before_right
            )
            before_left, before_right = speed_left, speed_right
            if extras.acts or extras.laws:
                extras.act(self.age + k * DT, torque, fed_left[k], fed_right[k])
            forces[left], forces[right] = torque
            advance(model, data)
            positions[k + 1], speeds[k + 1] = qpos, qvel
            electric[k + 1] = current[0], current[1], self.electrics.battery
        self.age += steps * DT
        return _track(self, command, positions, speeds, electric)


def _per_step(run: Manoeuvre, sample_s: float) -> tuple[Floats, Floats]:
    """Returns the commanded voltages, left and right, V, (steps + 1,) each; the last sample lasts for one step."""
    hold = round(sample_s / DT)
    _, left, right = run.held(sample_s)
    return np.repeat(left, hold)[: (len(left) - 1) * hold + 1], np.repeat(right, hold)[: (len(left) - 1) * hold + 1]


class _Extras:
    """Applies the hidden effects of `mujoco_effects` and `mujoco_laws` to MuJoCo's arrays."""

    def __init__(self, bench: _Bench, number: int) -> None:
        self.bench, self.step = bench, Step()
        self.step.mass = bench.names.mass
        self.acts = [
            (mujoco_effects.EFFECTS[name], p) for name, p in bench.hidden.items() if name in mujoco_effects.EFFECTS
        ]
        self.laws = [
            mujoco_laws.LAWS[name](p, number, bench.vehicle)
            for name, p in bench.hidden.items()
            if name in mujoco_laws.LAWS
        ]

    def act(self, age: float, torque: list[float], volts_left: float, volts_right: float) -> None:
        """Changes `torque` (left, right; N m) in place, and sets MuJoCo's other forces and frictions of the next step.

        Args:
            age: time since power-on, s.
        """
        names, data, s = self.bench.names, self.bench.data, self.step
        qpos, qvel = data.qpos, data.qvel
        (left, right), (left_angle, right_angle) = names.wheel_dof, names.wheel_angle
        s.age, s.torque, s.volts = age, torque, [volts_left, volts_right]
        s.x, s.y = qpos[0], -qpos[1]
        s.heading = heading = -2 * math.atan2(qpos[6], qpos[3])
        s.cosine, s.sine = cosine, sine = math.cos(heading), math.sin(heading)
        s.surge, s.rate = qvel[0] * cosine - qvel[1] * sine, -qvel[5]
        s.sway = -qvel[0] * sine - qvel[1] * cosine
        s.speeds, s.angles = [qvel[left], qvel[right]], [qpos[left_angle], qpos[right_angle]]
        s.motor_speeds = [qvel[i] for i in names.motor_dof]
        s.motor_angles = [qpos[i] for i in names.motor_angle]
        s.force = s.side = s.moment = 0.0
        s.load, s.dry = [0.0, 0.0], [names.coulomb, names.coulomb]
        for effect, parameters in self.acts:
            effect(s, parameters)
        for law in self.laws:
            law(s)
        applied = data.qfrc_applied
        applied[0] = s.force * cosine - s.side * sine
        applied[1] = -s.force * sine - s.side * cosine
        applied[5] = -s.moment
        if names.wheel_dof == names.motor_dof:
            torque[0] += s.load[0]
            torque[1] += s.load[1]
        else:
            applied[left], applied[right] = s.load
        friction = self.bench.model.dof_frictionloss
        friction[left], friction[right] = s.dry


def _track(bench: _Bench, command: tuple[Floats, Floats], positions: Floats, speeds: Floats, electric: Floats) -> Track:
    """Returns the track in the paper's frame. Its accelerations are specific forces: acceleration minus gravity.

    Args:
        positions, speeds: (n, nq) and (n, nv), MuJoCo's `qpos` and `qvel` at each step.
        electric: (n, 3), current of the left and the right motor, A, and battery voltage, V.
    """
    heading = np.unwrap(2 * np.arctan2(positions[:, 6], positions[:, 3]))
    # A step turns the velocity towards the direction that the wheels have at the start of the step: see
    # SIDE_SLIP_RETURN. A difference of two speeds is the acceleration in the middle between two steps.
    lean = 1 / SIDE_SLIP_RETURN
    cosine, sine = np.cos(_back(heading, lean)), np.sin(_back(heading, lean))
    w, x, y, z = _back(positions[:, 3:7], lean + 0.5).T
    felt = -bench.model.opt.gravity + np.diff(speeds[:, :3], axis=0, prepend=speeds[:1, :3]) / DT
    # forward and left axis of the body in the world's frame: the first two columns of the rotation matrix
    ahead = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    aside = np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    if "floor_wavy" in bench.hidden:
        waves = bench.hidden["floor_wavy"]
        felt[:, 0] -= GRAVITY * waves["slope"] * np.sin(2 * np.pi * positions[:, 0] / waves["wave"])
    left, right = bench.names.wheel_dof
    return Track(
        time=np.arange(len(speeds), dtype=float) * DT,
        command_left=command[0],
        command_right=command[1],
        surge=speeds[:, 0] * cosine + speeds[:, 1] * sine,
        sway=speeds[:, 0] * sine - speeds[:, 1] * cosine,
        yaw_rate=-speeds[:, 5],
        yaw_angle=-heading,
        accel_surge=np.sum(felt * ahead, axis=1),
        accel_sway=-np.sum(felt * aside, axis=1),
        yaw_accel=-np.diff(speeds[:, 5], prepend=speeds[0, 5]) / DT,
        wheel_speed_left=speeds[:, left].copy(),
        wheel_speed_right=speeds[:, right].copy(),
        current_left=electric[:, 0],
        current_right=electric[:, 1],
        battery=electric[:, 2],
        x=positions[:, 0].copy(),
        y=-positions[:, 1],
    )


def _back(values: Floats, steps: float) -> Floats:
    """Returns `values` (n, ...) delayed by `steps` (0 to below 2), linear between steps; repeats the first value."""
    padded = np.concatenate([values[:1], values[:1], values])
    whole = int(steps)
    part = steps - whole
    later = padded[2 - whole : 2 - whole + len(values)]
    return (1 - part) * later + part * padded[1 - whole : 1 - whole + len(values)]
