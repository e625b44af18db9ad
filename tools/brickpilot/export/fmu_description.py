"""modelDescription.xml of an FMU, for FMI 2.0 and 3.0, and the build description of FMI 3.0.

The variables of an FMU are the values that a simulator may set and read. A variable's value reference is its index in
the list of variables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from xml.etree import ElementTree as Xml

import pint

from brickpilot import __version__, catalogue
from brickpilot.constants import MOTOR_STEP_S, STEP_S
from brickpilot.vehicle.model import Model, output_names, unit_on

# Parameters that an FMU does not show. They determine the kind of vehicle, and so which outputs the vehicle has.
_NATURE = frozenset({"force_per_volt", "torque_per_volt"})

_MEANS = {
    "accel_surge": "specific force ahead, at the middle of the axle; mean over the last communication step",
    "accel_sway": "specific force to the right, at the middle of the axle; mean over the last communication step",
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

# The fields of bp_state in order: name, unit, meaning.
_STATE = (
    ("x", "m", "position of the axle's middle along x"),
    ("y", "m", "position of the axle's middle along y, to the right"),
    ("heading", "rad", "heading, clockwise seen from above"),
    ("surge", "m/s", "speed ahead; used if both wheel speeds are 0"),
    ("sway", "m/s", "speed to the right; 0 unless tyres slide"),
    ("yaw_rate", "rad/s", "yaw rate; used if both wheel speeds are 0"),
    ("current_left", "A", "current of the left motor"),
    ("current_right", "A", "current of the right motor"),
    ("wheel_speed_left", "rad/s", "speed of the left wheel"),
    ("wheel_speed_right", "rad/s", "speed of the right wheel"),
    ("wheel_angle_left", "rad", "angle of the left wheel"),
    ("wheel_angle_right", "rad", "angle of the right wheel"),
    ("age", "s", "time since power-on"),
    ("charge", "C", "charge drawn from the battery since power-on"),
    ("heat_left", "K", "windings of the left motor above their surroundings"),
    ("heat_right", "K", "windings of the right motor above their surroundings"),
    ("rest", "s", "time at rest before the start, in which the windings cool"),
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
        kind: a name of `fmu_kind_t` in the C layer, without the prefix FMU_.
        name: a structured name, such as ``effects.NAME.PARAMETER``.
        index, effect: the numbers of the variable's row and of its effect in the C layer.
        unit: the SI unit; empty for a boolean.
        start: the start value; 0 for an output.
        minimum, maximum: the limits; None: no limit.
        shown: whether the variable is in the description; False: only the C layer needs it.
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
    """Returns every variable of the model's FMU. The first variable is the time.

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


def _inputs(model: Model) -> list[Variable]:
    sides = [("_left", "the left motor"), ("_right", "the right motor")]
    if model.vehicle == "motor":
        sides = [("", "the motor")]
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
    rows = []
    for index, (name, unit) in enumerate(catalogue.outputs().items()):
        base = name.removesuffix("_left").removesuffix("_right")
        side = {"_left": ", left", "_right": ", right"}.get(name.removeprefix(base), "")
        if name in have:
            rows.append(Variable("OUTPUT", name, index, _MEANS[base] + side, unit))
    return rows


def _nominal(model: Model) -> list[Variable]:
    presets = catalogue.presets(model.vehicle)
    rows = []
    for index, info in enumerate(catalogue.parameters()):
        if info.name not in presets:
            continue
        name, start = f"parameters.{info.name}", float(model.parameters.get(info.name, presets[info.name]))
        ends = (min(info.minimum, start), info.maximum)  # a motor without a load has mass 0, below the minimum
        unit, shown = unit_on(model, info), info.name not in _NATURE
        rows.append(Variable("PARAMETER", name, index, info.meaning, unit, start, *ends, shown=shown))
    return rows


def _effects(model: Model) -> list[Variable]:
    rows = []
    for number, effect in enumerate(catalogue.effects_of(model.effects)):
        given = model.effects[effect.name]
        for index, info in enumerate(effect.parameters):
            name, start = f"effects.{effect.name}.{info.name}", float(given.get(info.name, info.preset))
            unit, ends = unit_on(model, info), (info.minimum, info.maximum)
            rows.append(Variable("EFFECT", name, index, info.meaning, unit, start, *ends, effect=number))
    return rows


def _initial(model: Model) -> list[Variable]:
    linear = model.parameters.get("force_per_volt", 0.0) > 0
    units = {"rad/s": "m/s", "rad": "m"} if linear else {}
    rows = []
    for place, (name, unit, meaning) in enumerate(_STATE):
        if model.vehicle != "motor":
            rows.append(Variable("INITIAL", f"initial.{name}", place, meaning, unit))
        elif name in _MOTOR_STATE:
            meaning = meaning.replace("the left motor", "the motor").replace("the left wheel", "the motor")
            rows.append(Variable("INITIAL", f"initial.{_MOTOR_STATE[name]}", place, meaning, units.get(unit, unit)))
    return rows


_BASE = {"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "radian": "rad"}
_SECONDS = 10.0


def description(
    model: Model, version: str, identifier: str, token: str, variables: Sequence[Variable], sources: Sequence[str]
) -> bytes:
    """Returns modelDescription.xml.

    Args:
        version: version of FMI, ``2.0`` or ``3.0``.
        identifier: the model's identifier, which is the name of its library.
        token: the FMU's identifier; the C layer refuses a description with another token.
        variables: the result of `variables`.
        sources: the C files; FMI 2.0 lists them in this file, and FMI 3.0 lists them in `build_description`.
    """
    is_2 = version == "2.0"
    head = {
        "fmiVersion": version,
        "modelName": model.name,
        "guid" if is_2 else "instantiationToken": token,
        "description": f"{model.vehicle.replace('_', ' ')}, profile {model.profile}, by Brickpilot",
        "license": "MIT",
        "generationTool": f"brickpilot {__version__}",
        "variableNamingConvention": "structured",
    }
    root = Xml.Element("fmiModelDescription", head)
    able = {"modelIdentifier": identifier, "canHandleVariableCommunicationStepSize": "true"}
    able["canGetAndSetFMUstate" if is_2 else "canGetAndSetFMUState"] = "true"
    if is_2:
        able["canNotUseMemoryManagementFunctions"] = "true"
    simulation = Xml.SubElement(root, "CoSimulation", able)
    if is_2:
        files = Xml.SubElement(simulation, "SourceFiles")
        for source in sources:
            Xml.SubElement(files, "File", name=source)
    _units(root, sorted({variable.unit for variable in variables if variable.unit}))
    categories = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(categories, "Category", name="logStatusError", description="why a call failed")
    stop = {"startTime": "0", "stopTime": repr(_SECONDS), "stepSize": repr(STEP_S)}
    Xml.SubElement(root, "DefaultExperiment", stop)
    shown = [(number, variable) for number, variable in enumerate(variables) if variable.shown]
    of_all = Xml.SubElement(root, "ModelVariables")
    for number, variable in shown:
        _variable(of_all, is_2, number, variable)
    _structure(root, is_2, shown)
    return _text(root)


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """Returns sources/buildDescription.xml of FMI 3.0."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = Xml.SubElement(configuration, "SourceFileSet", language="C99")
    for source in sources:
        Xml.SubElement(files, "SourceFile", name=source)
    Xml.SubElement(files, "IncludeDirectory", name=".")
    return _text(root)


def _text(root: Xml.Element) -> bytes:
    Xml.indent(root)
    text: bytes = Xml.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()


def _exponents(unit: str) -> dict[str, str] | None:
    """Returns the exponents of the base units; None: an exponent is not a whole number, so FMI cannot express it."""
    registry = _registry()
    base = registry.get_base_units(unit)[1] if unit != "1" else registry.Unit("")
    powers = {_BASE[str(name)]: f"{power:g}" for name, power in base._units.items()}
    if any("." in power for power in powers.values()):
        return None
    return {name: powers[name] for name in _BASE.values() if name in powers}


def _units(root: Xml.Element, units: Sequence[str]) -> None:
    definitions = Xml.SubElement(root, "UnitDefinitions")
    for name in units:
        unit = Xml.SubElement(definitions, "Unit", name=name)
        exponents = _exponents(name)
        if exponents is not None:
            Xml.SubElement(unit, "BaseUnit", exponents)


def _causality(variable: Variable) -> dict[str, str]:
    if variable.kind == "TIME":
        return {"causality": "independent", "variability": "continuous"}
    if variable.kind in ("VOLTAGE", "FLOATS"):
        return {"causality": "input", "variability": "continuous" if variable.kind == "VOLTAGE" else "discrete"}
    if variable.kind == "OUTPUT":
        return {"causality": "output", "variability": "continuous", "initial": "calculated"}
    return {"causality": "parameter", "variability": "fixed", "initial": "exact"}


def _variable(parent: Xml.Element, is_2: bool, number: int, variable: Variable) -> None:
    head = {
        "name": variable.name,
        "valueReference": str(number),
        "description": variable.meaning,
        **_causality(variable),
    }
    if variable.kind == "FLOATS":
        kind, values = "Boolean", {"start": "false"}
    else:
        kind, values = "Real" if is_2 else "Float64", {"unit": variable.unit}
        if variable.minimum is not None and variable.maximum is not None:
            values |= {"min": repr(variable.minimum), "max": repr(variable.maximum)}
        if variable.kind not in ("TIME", "OUTPUT"):
            values["start"] = repr(variable.start)
    if is_2:
        Xml.SubElement(Xml.SubElement(parent, "ScalarVariable", head), kind, values)
    else:
        Xml.SubElement(parent, kind, head | values)


def _structure(root: Xml.Element, is_2: bool, shown: Sequence[tuple[int, Variable]]) -> None:
    """Lists the outputs: FMI 2.0 by index, FMI 3.0 by value reference."""
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [(place, number) for place, (number, variable) in enumerate(shown, 1) if variable.kind == "OUTPUT"]
    for name in ("Output", "InitialUnknown"):
        group = Xml.SubElement(structure, f"{name}s") if is_2 else structure
        for place, number in outputs:
            if is_2:
                Xml.SubElement(group, "Unknown", index=str(place))
            else:
                Xml.SubElement(group, name, valueReference=str(number))
