"""Measures what a compensation improves: the mission on plants with effects, without and with the compensation.

Prints the table of firmware/README.md: `.venv/bin/python tests/loop/compensation_study.py`.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from brickpilot import catalogue
from brickpilot.vehicle import compensation, flight, flight_figures, scenario
from brickpilot.vehicle.model import Model, rcx

SEEDS = 12
CROSS, POSITION = "cross_track_rms_m", "position_estimate_error_m"
PRESETS = {effect.name: {info.name: info.preset for info in effect.parameters} for effect in catalogue.effects()}


def robot(effects: dict[str, dict[str, float]], **parameters: float) -> Model:
    """Returns the packaged robot with these effects and nominal values; an effect's absent parameters are 0."""
    chosen = {name: {**dict.fromkeys(PRESETS[name], 0.0), **on} for name, on in effects.items()}
    return dataclasses.replace(rcx(), parameters={**rcx().parameters, **parameters}, effects=chosen)


def compensation_of(model: Model) -> compensation.Compensation:
    """Returns the compensation of a robot."""
    nothing = compensation.Compensation(model.name, dict.fromkeys(compensation.FORMATS, 0))
    return compensation.from_model(model) or nothing


@dataclasses.dataclass(frozen=True)
class Mission:
    """Flights of some plants. `shrinks`: the errors whose mean the compensation has to reduce."""

    title: str
    plants: tuple[Model, ...]
    sensors: str
    rest: float = 1.0  # rest before the start, s
    shrinks: tuple[str, ...] = (CROSS, POSITION)

    def fly(self, known: bool, seeds: int) -> list[dict[str, Any]]:
        """Returns the figures of each flight, with the compensation if `known`."""
        mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), start_at=self.rest)
        return [
            flight_figures.summary(
                flight.fly(
                    flight.plan(
                        mission,
                        model,
                        sensors=self.sensors,
                        seed=seed,
                        compensation=compensation_of(model) if known else None,
                    )
                )
            )
            for model in self.plants
            for seed in range(seeds)
        ]


def _of(name: str, parameter: str, size: float, beside: dict[str, dict[str, float]] | None = None) -> tuple[Model, ...]:
    """Returns a plant with an effect for each sign that its size may have, because the mission favours one sign."""
    info = next(i for e in catalogue.effects() if e.name == name for i in e.parameters if i.name == parameter)
    signs = (1, -1) if info.minimum < 0 else (1,)
    return tuple(robot({name: {parameter: sign * size}, **(beside or {})}) for sign in signs)


ANOTHER = robot(
    {"coulomb_friction": {"torque": 0.005}},
    mass=0.6,
    yaw_inertia=0.002,
    wheel_radius=0.028,
    wheel_inertia=5e-4,
    viscous_friction=1e-4,
    torque_constant=0.25,
    emf_constant=0.25,
)
_HELD = {"coulomb_friction": {"torque": 0.008}}  # without friction a constant load moves the robot at rest
_COULOMB, _DEADBAND = _of("coulomb_friction", "torque", 0.005), _of("actuator_deadband", "voltage", 0.5)
_MISMATCH = _of("wheel_radius_mismatch", "mismatch", 0.1)
_MOTORS = _of("motor_asymmetry", "difference", 0.2)
_FLUXES = _of("torque_constant_asymmetry", "difference", 0.1)
_LARGER = tuple(robot({}, wheel_radius=0.0408 * share) for share in (1.02, 0.98))

# After 6 s at rest the gyro's bias is known well enough to show the small errors that the asymmetries cause.
MISSIONS = (
    Mission("`coulomb_friction` 5 mN m", _COULOMB, "imu", shrinks=(POSITION,)),  # the firmware learns this friction
    Mission("the same", _COULOMB, "imu+encoders", shrinks=(CROSS,)),
    Mission("`stiction_stribeck`, preset", (robot({"stiction_stribeck": PRESETS["stiction_stribeck"]}),), "imu"),
    Mission("`rolling_sqrt` 2 mN m", _of("rolling_sqrt", "torque", 0.002), "imu"),
    Mission("`direction_asymmetry` +-6 mN m", _of("direction_asymmetry", "torque", 0.006), "imu"),
    Mission("`constant_offset` +-6 mN m, friction 8", _of("constant_offset", "torque", 0.006, _HELD), "imu"),
    Mission("`actuator_deadband` 0.5 V", _DEADBAND, "imu"),
    Mission("the same", _DEADBAND, "imu+encoders", shrinks=(CROSS,)),
    Mission("`motor_asymmetry` +-20 %", _MOTORS, "imu", 6.0),
    Mission("`torque_constant_asymmetry` +-10 %", _FLUXES, "imu", 6.0),
    Mission("`wheel_radius_mismatch` +-10 %", _MISMATCH, "imu", 6.0),
    Mission("the same", _MISMATCH, "imu+encoders", 6.0),
    Mission("`battery_sag` 16 ohm", _of("battery_sag", "resistance", 16.0), "imu", 6.0),
    Mission("`gyro_bias` +-0.2 rad/s", _of("gyro_bias", "bias", 0.2), "imu+encoders"),
    Mission("`gyro_bias` +-0.1 rad/s", _of("gyro_bias", "bias", 0.1), "imu+encoders", 0.0),
    Mission("`gyro_scale` +-10 %", _of("gyro_scale", "error", 0.1), "imu+encoders"),
    Mission("`encoder_scale` +-10 %", _of("encoder_scale", "error", 0.1), "imu+encoders"),
    Mission("wheels 2 % larger or smaller", _LARGER, "imu+encoders", shrinks=(POSITION,)),
    Mission("another robot, with friction", (ANOTHER,), "imu+encoders"),
)

# In these missions sensors and feedback already remove the errors: a compensation improves them hardly more than they
# scatter between seeds.
COMPENSATED_ANYWAY = (
    Mission("`motor_asymmetry` +-20 %", _MOTORS, "imu+encoders", 6.0),
    Mission("`torque_constant_asymmetry` +-10 %", _FLUXES, "imu+encoders", 6.0),
    Mission("`battery_sag` 4 ohm", _of("battery_sag", "resistance", 4.0), "imu", 6.0),
    Mission("`gyro_bias` +-0.1 rad/s", _of("gyro_bias", "bias", 0.1), "imu+encoders"),
    Mission("nothing", (rcx(),), "imu", 6.0),
)


def mean(figures: list[dict[str, Any]], measure: str) -> float:
    """Returns the mean of one figure over flights."""
    return float(np.mean([flown[measure] for flown in figures]))


def main() -> None:
    print("| plant | sensors | rest | waypoints | cross-track rms, mm | error of the position estimate, rms, mm |")
    print("|---|---|---|---|---|---|")
    for mission in (*MISSIONS, *COMPENSATED_ANYWAY):
        before, after = (mission.fly(known, SEEDS) for known in (False, True))
        waypoints = " -> ".join(f"{mean(figures, 'waypoints_reached'):.1f}" for figures in (before, after))
        errors = (
            " -> ".join(f"{1e3 * mean(figures, measure):.1f}" for figures in (before, after))
            for measure in (CROSS, POSITION)
        )
        print(
            f"| {mission.title} | {mission.sensors} | {mission.rest:g} s | {waypoints} | {' | '.join(errors)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
