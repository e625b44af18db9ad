"""What a rigid-body simulator can be told of a robot: masses, wheels, motors, losses and sensors, effects included.

Frame of Brickpilot: x forward, y right, yaw clockwise. Pairs are left and right; a motor uses the first alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from brickpilot import catalogue
from brickpilot.vehicle.model import Model

Pair = tuple[float, float]


@dataclass(frozen=True)
class Machine:
    """One robot, in SI.

    Attributes:
        values: the nominal parameters.
        com: m, centre of mass ahead and to the right of the axle's middle.
        rim: radius of each wheel over the nominal one.
        flux: factor of each motor's torque constant and back-EMF constant.
        gain: factor of each commanded voltage.
        limit: V, the largest voltage that a drive reaches; None: none.
        delay, lag: s, of the command.
        dry, viscous: N m and N m s/rad at each wheel, beside the nominal losses.
        load: N m at each wheel, against forward motion.
        body_drag, air: N s/m and N s^2/m^2 on the body.
        yaw_drag, yaw_dry: N m s/rad and N m on the body.
        slope: sine of the angle by which the floor falls along x and along y.
        imu: m, place of the accelerometers.
        late: s, by which the sensors are late.
    """

    values: Mapping[str, float]
    mass: float
    yaw_inertia: float
    com: Pair = (0.0, 0.0)
    rim: Pair = (1.0, 1.0)
    flux: Pair = (1.0, 1.0)
    gain: Pair = (1.0, 1.0)
    limit: float | None = None
    delay: float = 0.0
    lag: float = 0.0
    dry: Pair = (0.0, 0.0)
    viscous: Pair = (0.0, 0.0)
    load: Pair = (0.0, 0.0)
    body_drag: float = 0.0
    air: float = 0.0
    yaw_drag: float = 0.0
    yaw_dry: float = 0.0
    slope: Pair = (0.0, 0.0)
    imu: Pair = (0.0, 0.0)
    late: float = 0.0


def nominal(model: Model) -> Machine:
    """Returns the robot without its effects."""
    values = catalogue.presets(model.vehicle) | dict(model.parameters)
    air = 0.5 * values["air_density"] * values["drag_area"]
    return Machine(values, values["mass"], values["yaw_inertia"], air=air)


def radii(machine: Machine) -> Pair:
    """Returns the radius of each wheel, m."""
    return machine.values["wheel_radius"] * machine.rim[0], machine.values["wheel_radius"] * machine.rim[1]


def losses(machine: Machine) -> Pair:
    """Returns the losses of each wheel that are linear in its speed, N m s/rad: eq. 13 in eq. 14 of the paper."""
    values = machine.values
    weight = machine.mass * values["gravity"]
    left, right = (
        values["viscous_friction"] + weight * values["rolling_friction"] * radius**2 + more
        for radius, more in zip(radii(machine), machine.viscous, strict=True)
    )
    return left, right
