"""Laws of `other_laws` for the vehicle that MuJoCo moves, and `coupled_inertia`, a law of the library with a state.

Each function takes a law's parameters, the number of the run and the vehicle, and returns a function that changes a
`Step`. The returned function may have a state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from hidden.by_run import place
from hidden.mujoco_effects import Step
from hidden.mujoco_model import DT
from hidden.recipe import GRAVITY, Vehicle, second_inertia

Parameters = Mapping[str, float]
Act = Callable[[Step], None]

LUGRE_DAMPING = 0.3  # damping ratio of a wheel on its bristles


def _ripple_rectified(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        for i in (0, 1):
            wave = 0.5 * math.pi * abs(math.sin(0.5 * p["order"] * s.angles[i])) - 1
            s.torque[i] *= 1 + p["amplitude"] * wave

    return act


def _cogging_sharp(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        for i in (0, 1):
            angle = p["order"] * s.angles[i]
            s.load[i] -= p["torque"] * (math.sin(angle) + 0.5 * math.sin(2 * angle))

    return act


def _backlash_soft(p: Parameters, _: int, __: Vehicle) -> Act:
    half = 0.5 * p["gap"]

    def act(s: Step) -> None:
        for i in (0, 1):
            play = s.motor_angles[i] - s.angles[i]
            beyond = play - max(-half, min(half, play))
            push = p["stiffness"] * beyond
            if beyond:
                push += p["damping"] * (s.motor_speeds[i] - s.speeds[i])
            s.torque[i] -= push
            s.load[i] += push

    return act


def _coulomb_tanh(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        for i in (0, 1):
            s.load[i] -= p["torque"] * math.tanh(s.speeds[i] / p["speed"])

    return act


def _bristles(stiffness: float, damping: float, bound: Callable[[float], float]) -> Act:
    """Returns the friction of bristles with bend z at wheel speed w.

    z' = w - stiffness |w| z / bound(w), torque = stiffness z + damping z'.
    LuGre: Canudas de Wit et al. 1995, IEEE TAC 40(3). Without damping and with a constant bound: Dahl 1968.
    """
    bent = [0.0, 0.0]

    def act(s: Step) -> None:
        for i in (0, 1):
            speed = s.speeds[i]
            yields = stiffness * abs(speed) / bound(speed)
            s.load[i] -= stiffness * bent[i] + damping * (speed - yields * bent[i])
            if yields > 0:
                end = speed / yields
                bent[i] = end + (bent[i] - end) * math.exp(-yields * DT)

    return act


def _friction_dahl(p: Parameters, _: int, __: Vehicle) -> Act:
    return _bristles(p["torque"] / p["stretch"], 0.0, lambda _: p["torque"])


def _friction_lugre(p: Parameters, _: int, vehicle: Vehicle) -> Act:
    stiffness = (p["coulomb"] + p["breakaway"]) / p["stretch"]
    damping = LUGRE_DAMPING * 2 * math.sqrt(stiffness * vehicle.wheel_inertia)
    return _bristles(
        stiffness, damping, lambda w: p["coulomb"] + p["breakaway"] * math.exp(-((w / p["stribeck_speed"]) ** 2))
    )


def _friction_by_load(p: Parameters, _: int, __: Vehicle) -> Act:
    """Dry friction that grows with the transmitted torque, mostly near rest: similar to model M4 of Duclusaud et al.
    2025, Extended friction models for the physics simulation of servo actuators."""

    def act(s: Step) -> None:
        for i in (0, 1):
            rest = 0.3 + 0.7 * math.exp(-((s.speeds[i] / p["speed"]) ** 2))
            s.dry[i] += p["share"] * abs(s.torque[i]) * rest

    return act


def _loss_that_levels_off(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        for i in (0, 1):
            s.load[i] += math.copysign(p["torque"], s.speeds[i]) * math.expm1(-abs(s.speeds[i]) / p["speed"])

    return act


def _loss_one_way(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        for i in (0, 1):
            s.load[i] -= p["torque"] * (max(s.speeds[i], 0.0) / p["speed"]) ** 2

    return act


def _offset_by_run(p: Parameters, number: int, _: Vehicle) -> Act:
    torque = p["torque"] * (1 + p["spread"] * place(number))

    def act(s: Step) -> None:
        s.load[0] -= torque
        s.load[1] -= torque

    return act


def _caster_viscous(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        aside = p["drag"] * (s.sway + p["forward"] * s.rate)
        s.force -= p["drag"] * s.surge
        s.side -= aside
        s.moment -= p["forward"] * aside

    return act


def _scrub_smooth(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        s.moment -= p["moment"] * math.tanh(s.rate / p["rate"])

    return act


def _curve_drag(p: Parameters, _: int, __: Vehicle) -> Act:
    """Induced drag: grows with the square of the tyres' side force."""

    def act(s: Step) -> None:
        s.force -= p["share"] * s.mass * (s.surge * s.rate) ** 2 / GRAVITY * math.copysign(1.0, s.surge)

    return act


def _drag_power(p: Parameters, _: int, __: Vehicle) -> Act:
    """Drag with exponent 1.5 in speed, between linear and quadratic drag."""

    def act(s: Step) -> None:
        s.force -= p["drag"] * s.surge * math.sqrt(abs(s.surge))

    return act


def _nap_viscous(p: Parameters, _: int, __: Vehicle) -> Act:
    def act(s: Step) -> None:
        s.force += p["force_x"] * s.cosine + p["force_y"] * s.sine - p["drag"] * s.surge
        s.side += p["force_y"] * s.cosine - p["force_x"] * s.sine - p["drag"] * s.sway

    return act


def _floor_wavy(p: Parameters, _: int, __: Vehicle) -> Act:
    """The floor rises and falls along x. `mujoco_engine` adds the slope to the accelerometers' readings."""

    def act(s: Step) -> None:
        pull = s.mass * GRAVITY * p["slope"] * math.sin(2 * math.pi * s.x / p["wave"])
        s.force += pull * s.cosine
        s.side -= pull * s.sine

    return act


def _coupled_inertia(p: Parameters, _: int, vehicle: Vehicle) -> Act:
    """The library's law, here because it has a state. With `stretch` the spring stiffens like rubber."""
    second = second_inertia(vehicle, p["share"], p["period"], p["damping"])
    twist, speed, stretch = [0.0, 0.0], [0.0, 0.0], p.get("stretch", math.inf)

    def act(s: Step) -> None:
        for i in (0, 1):
            bent = twist[i] * (1 + (twist[i] / stretch) ** 2)
            torque = second.stiffness * bent + second.damping * (s.speeds[i] - speed[i])
            s.load[i] -= torque
            speed[i] += DT * torque / second.inertia
            twist[i] += DT * (s.speeds[i] - speed[i])

    return act


def _inertia_on_rubber(p: Parameters, run: int, vehicle: Vehicle) -> Act:
    return _coupled_inertia(p, run, vehicle)


def _ballast_on_spring(p: Parameters, _: int, __: Vehicle) -> Act:
    """An elastically mounted weight on each wheel: gravity changes its angle on the wheel."""

    def act(s: Step) -> None:
        for i in (0, 1):
            s.load[i] -= p["torque"] * math.cos(s.angles[i] - p["give"] * math.cos(s.angles[i]))

    return act


LAWS: dict[str, Callable[[Parameters, int, Vehicle], Act]] = {
    make.__name__[1:]: make
    for make in (
        _ripple_rectified, _cogging_sharp, _backlash_soft, _coulomb_tanh, _friction_dahl, _friction_lugre,
        _friction_by_load, _loss_that_levels_off, _loss_one_way, _offset_by_run, _caster_viscous, _scrub_smooth,
        _curve_drag, _drag_power, _nap_viscous, _floor_wavy, _coupled_inertia, _inertia_on_rubber,
        _ballast_on_spring,
    )
}  # fmt: skip
