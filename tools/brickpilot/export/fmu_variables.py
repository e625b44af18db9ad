"""The variables of an FMU: what a simulator may set and read. The place in the list is the value reference."""

from __future__ import annotations

from dataclasses import dataclass

from brickpilot import catalogue
from brickpilot.constants import MOTOR_STEP_S, STEP_S
from brickpilot.vehicle.model import Model, output_names, unit_on

INPUTS = frozenset({"VOLTAGE", "FLOATS"})

# Of a vehicle's nature: another value would give it other outputs.
_NATURE = frozenset({"force_per_volt", "torque_per_volt"})

_MEANS = {
    "accel_surge": "specific force ahead, at the middle of the axle; mean over the plant's last body step",
    "accel_sway": "specific force to the right, at the middle of the axle; mean over the last body step",
    "yaw_rate": "as the gyro reads it, clockwise seen from above",
    "yaw_angle": "the gyro's rate, summed up",
    "wheel_speed": "speed of the wheel",
    "wheel_angle": "angle of the wheel",
    "wheel_travel": "angle of the wheel times the nominal radius",
    "wheel_velocity": "speed of the wheel times the nominal radius",
    "current": "current of the motor",
    "battery_voltage": "voltage at the drives",
    "speed": "speed of the motor's axle",
    "angle": "angle of the motor's axle",
    "position": "of the load",
    "velocity": "of the load",
    "force": "of the motor on its load",
    "x": "true position of the axle's middle, along the x axis",
    "y": "true position of the axle's middle, along the y axis, which points to the right of x",
    "surge": "true speed ahead",
    "sway": "true speed to the right",
}

# Field of bp_state, its place in it, unit of a vehicle and of a linear motor, meaning.
_STATE = (
    ("x", 0, "m", "position of the axle's middle along x"),
    ("y", 1, "m", "position of the axle's middle along y, to the right"),
    ("heading", 2, "rad", "heading, clockwise seen from above"),
    ("surge", 3, "m/s", "speed ahead; counts if both wheel speeds are 0"),
    ("sway", 4, "m/s", "speed to the right; 0 unless tyres slide"),
    ("yaw_rate", 5, "rad/s", "yaw rate; counts if both wheel speeds are 0"),
    ("current_left", 6, "A", "current of the left motor"),
    ("current_right", 7, "A", "current of the right motor"),
    ("wheel_speed_left", 8, "rad/s", "speed of the left wheel"),
    ("wheel_speed_right", 9, "rad/s", "speed of the right wheel"),
    ("wheel_angle_left", 10, "rad", "angle of the left wheel"),
    ("wheel_angle_right", 11, "rad", "angle of the right wheel"),
    ("age", 12, "s", "time since power-on"),
    ("charge", 13, "C", "charge drawn from the battery since power-on"),
    ("heat_left", 14, "K", "windings of the left motor above their surroundings"),
    ("heat_right", 15, "K", "windings of the right motor above their surroundings"),
    ("rest", 16, "s", "time at rest before the start, in which the windings cool"),
)
_MOTOR_STATE = {
    "current_left": "current",
    "wheel_speed_left": "speed",
    "wheel_angle_left": "angle",
    "age": "age",
    "charge": "charge",
    "heat_left": "heat",
    "rest": "rest",
}


@dataclass(frozen=True)
class Variable:
    """One variable of an FMU.

    Attributes:
        kind: of `fmu_kind_t` in the C layer, without FMU_.
        name: structured, as in ``effects.NAME.PARAMETER``.
        index, effect: of the row in the C layer.
        unit: SI; empty for a boolean.
        start: 0 for an output.
        minimum, maximum: None: no limit.
        shown: False for a value that only the C layer needs.
    """

    kind: str
    name: str
    index: int
    meaning: str
    unit: str = ""
    start: float = 0.0
    minimum: float | None = None
    maximum: float | None = None
    effect: int = 0
    shown: bool = True


def variables(model: Model) -> list[Variable]:
    """Returns every variable of the model's FMU. The first one is time.

    Raises:
        InputError, SimulationError: the plant refuses the model.
    """
    return [
        Variable("TIME", "time", 0, "simulated time", "s"),
        *_inputs(model),
        *_outputs(model),
        *_nominal(model),
        *_effects(model),
        *_initial(model),
        Variable(
            "STEP_LIMIT", "steps.motor_step", 0, "longest step of motors and wheels", "s", MOTOR_STEP_S, 1e-6, 1.0
        ),
        Variable("STEP_LIMIT", "steps.body_step", 1, "longest step of the body", "s", STEP_S, 1e-6, 1.0),
    ]


def effect_names(model: Model) -> list[str]:
    """Returns the effects that are on, in the table's order."""
    return [one.name for one in catalogue.effects_of(model.effects)]


def _inputs(model: Model) -> list[Variable]:
    sides = (
        [("", "the motor")]
        if model.vehicle == "motor"
        else [("_left", "the left motor"), ("_right", "the right motor")]
    )
    volts = [
        Variable("VOLTAGE", f"voltage{end}", k, f"commanded to {motor}; 0 shorts it, NaN lets it float", "V")
        for k, (end, motor) in enumerate(sides)
    ]
    floats = [
        Variable("FLOATS", f"floats{end}", k, f"true: {motor} floats, whatever its voltage")
        for k, (end, motor) in enumerate(sides)
    ]
    return volts + floats


def _outputs(model: Model) -> list[Variable]:
    have = output_names(model)
    found = []
    for index, (name, unit) in enumerate(catalogue.output_table()):
        base = name.removesuffix("_left").removesuffix("_right")
        side = {"_left": ", left", "_right": ", right"}.get(name.removeprefix(base), "")
        if name in have:
            found.append(Variable("OUTPUT", name, index, _MEANS[base] + side, unit))
    return found


def _nominal(model: Model) -> list[Variable]:
    presets = catalogue.presets(model.vehicle)
    found = []
    for index, info in enumerate(catalogue.parameters()):
        name, start = f"parameters.{info.name}", float(model.parameters.get(info.name, presets[info.name]))
        ends = (min(info.minimum, start), info.maximum)  # a motor may be without a load, and then has a mass of 0
        unit, shown = unit_on(model, info), info.name not in _NATURE
        found.append(Variable("PARAMETER", name, index, info.meaning, unit, start, *ends, shown=shown))
    return found


def _effects(model: Model) -> list[Variable]:
    found = []
    for number, effect in enumerate(catalogue.effects_of(model.effects)):
        given = model.effects[effect.name]
        for index, info in enumerate(effect.parameters):
            name, start = f"effects.{effect.name}.{info.name}", float(given.get(info.name, info.preset))
            unit, ends = unit_on(model, info), (info.minimum, info.maximum)
            found.append(Variable("EFFECT", name, index, info.meaning, unit, start, *ends, effect=number))
    return found


def _initial(model: Model) -> list[Variable]:
    if model.vehicle != "motor":
        return [Variable("INITIAL", f"initial.{name}", at, text, unit) for name, at, unit, text in _STATE]
    linear = model.parameters.get("force_per_volt", 0.0) > 0
    units = {"rad/s": "m/s", "rad": "m"} if linear else {}
    return [
        Variable("INITIAL", f"initial.{_MOTOR_STATE[name]}", at, text.replace("the left motor", "the motor")
                 .replace("the left wheel", "the motor"), units.get(unit, unit))
        for name, at, unit, text in _STATE
        if name in _MOTOR_STATE
    ]  # fmt: skip
