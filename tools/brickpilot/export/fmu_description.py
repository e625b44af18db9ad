"""modelDescription.xml of an FMU, for FMI 2.0 and 3.0, and the build description of FMI 3.0."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from xml.etree import ElementTree as Xml

import pint

from brickpilot import __version__
from brickpilot.constants import STEP_S
from brickpilot.export.fmu_variables import INPUTS, Variable
from brickpilot.vehicle.model import Model

_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "radian": "rad",
}
_SECONDS = 10.0


def description(model: Model, version: str, identifier: str, token: str, variables: Sequence[Variable]) -> bytes:
    """Returns modelDescription.xml.

    Args:
        version: of FMI, ``2.0`` or ``3.0``.
        identifier: of the model, which is the name of its library.
        token: that the C layer knows.
    """
    root = Xml.Element("fmiModelDescription")
    root.attrib.update(
        {
            "fmiVersion": version,
            "modelName": model.name,
            "guid" if version == "2.0" else "instantiationToken": token,
            "description": f"{model.vehicle.replace('_', ' ')}, profile {model.profile}, by Brickpilot",
            "license": "MIT",
            "generationTool": f"brickpilot {__version__}",
            "variableNamingConvention": "structured",
        }
    )
    _co_simulation(root, version, identifier)
    _units(root, sorted({one.unit for one in variables if one.unit}))
    categories = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(categories, "Category", name="logStatusError", description="why a call failed")
    stop = {"startTime": "0", "stopTime": repr(_SECONDS), "stepSize": repr(STEP_S)}
    Xml.SubElement(root, "DefaultExperiment", stop)
    shown = [(number, one) for number, one in enumerate(variables) if one.shown]
    of_all = Xml.SubElement(root, "ModelVariables")
    for number, one in shown:
        (_variable_2 if version == "2.0" else _variable_3)(of_all, number, one)
    _structure(root, version, shown)
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


def _co_simulation(root: Xml.Element, version: str, identifier: str) -> None:
    state = "canGetAndSetFMUstate" if version == "2.0" else "canGetAndSetFMUState"
    able = {"modelIdentifier": identifier, "canHandleVariableCommunicationStepSize": "true", state: "true"}
    if version == "2.0":
        able["canNotUseMemoryManagementFunctions"] = "true"
    Xml.SubElement(root, "CoSimulation", able)


def add_sources(description: bytes, sources: Sequence[str]) -> bytes:
    """Returns modelDescription.xml of FMI 2.0 with the list of source files, which FMI 3.0 has elsewhere."""
    root = Xml.fromstring(description)
    simulation = root.find("CoSimulation")
    assert simulation is not None
    files = Xml.SubElement(simulation, "SourceFiles")
    for source in sources:
        Xml.SubElement(files, "File", name=source)
    return _text(root)


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()


def _exponents(unit: str) -> dict[str, str] | None:
    """Returns the exponents of the base units, or None where one is no whole number, which FMI cannot say."""
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


def _causality(one: Variable) -> dict[str, str]:
    if one.kind == "TIME":
        return {"causality": "independent", "variability": "continuous"}
    if one.kind in INPUTS:
        return {"causality": "input", "variability": "continuous" if one.kind == "VOLTAGE" else "discrete"}
    if one.kind == "OUTPUT":
        return {"causality": "output", "variability": "continuous", "initial": "calculated"}
    return {"causality": "parameter", "variability": "fixed", "initial": "exact"}


def _numbers(one: Variable) -> dict[str, str]:
    """Returns unit, range and start of a real variable."""
    found = {"unit": one.unit}
    if one.minimum is not None and one.maximum is not None:
        found |= {"min": repr(one.minimum), "max": repr(one.maximum)}
    if one.kind not in ("TIME", "OUTPUT"):
        found["start"] = repr(one.start)
    return found


def _variable_2(parent: Xml.Element, number: int, one: Variable) -> None:
    head = {"name": one.name, "valueReference": str(number), "description": one.meaning, **_causality(one)}
    variable = Xml.SubElement(parent, "ScalarVariable", head)
    if one.kind == "FLOATS":
        Xml.SubElement(variable, "Boolean", start="false")
    else:
        Xml.SubElement(variable, "Real", _numbers(one))


def _variable_3(parent: Xml.Element, number: int, one: Variable) -> None:
    head = {"name": one.name, "valueReference": str(number), "description": one.meaning, **_causality(one)}
    if one.kind == "FLOATS":
        Xml.SubElement(parent, "Boolean", {**head, "start": "false"})
    else:
        Xml.SubElement(parent, "Float64", {**head, **_numbers(one)})


def _structure(root: Xml.Element, version: str, shown: Sequence[tuple[int, Variable]]) -> None:
    """Lists the outputs, by place in FMI 2.0 and by value reference in FMI 3.0."""
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [(place, number) for place, (number, one) in enumerate(shown, 1) if one.kind == "OUTPUT"]
    if version == "2.0":
        for name in ("Outputs", "InitialUnknowns"):
            group = Xml.SubElement(structure, name)
            for place, _ in outputs:
                Xml.SubElement(group, "Unknown", index=str(place))
    else:
        for name in ("Output", "InitialUnknown"):
            for _, number in outputs:
                Xml.SubElement(structure, name, valueReference=str(number))
