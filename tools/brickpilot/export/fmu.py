"""A model as an FMU: the plant with its effects, as a co-simulation unit of FMI 2.0 or 3.0."""

from __future__ import annotations

import hashlib
import io
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from brickpilot.errors import disk_named
from brickpilot.export import files, fmu_description, fmu_sources
from brickpilot.export.fmu_variables import variables
from brickpilot.vehicle.model import Model

VERSIONS = ("2.0", "3.0")
_EARLIEST = (1980, 1, 1, 0, 0, 0)  # that a zip file can say: the same model gives the same bytes


def archive(model: Model, version: str, *, binary: bool = True) -> bytes:
    """Returns the FMU: description, sources, and the library of this platform.

    Args:
        version: of FMI, one of `VERSIONS`.
        binary: False leaves the library out, so that no compiler is needed.

    Raises:
        WorkFailedError: there is no C compiler, or it fails.
        InputError, SimulationError: the plant refuses the model.
    """
    content = _content(model, version)
    if binary:
        folder, ending = fmu_sources.place(version)
        content[f"binaries/{folder}/{identifier(model)}{ending}"] = _compiled(content)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for name in sorted(content, key=lambda one: (one != "modelDescription.xml", one)):
            info = zipfile.ZipInfo(name, _EARLIEST)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            file.writestr(info, content[name])
    return buffer.getvalue()


def identifier(model: Model) -> str:
    """Returns the model's name as a C identifier."""
    word = files.plain_name(model.name)
    return f"model_{word}" if word[0].isdigit() else word


def _content(model: Model, version: str) -> dict[str, bytes]:
    """Returns path -> content of everything but the library."""
    rows = variables(model)
    sources = fmu_sources.files(version)
    token = _token(sources, fmu_sources.robot_table(model, "", rows))
    sources[fmu_sources.ROBOT] = fmu_sources.robot_table(model, token, rows).encode()
    compiled = sorted(name for name in sources if name.endswith(".c"))
    description = fmu_description.description(model, version, identifier(model), token, rows)
    content = {f"sources/{name}": text for name, text in sources.items()}
    if version == "2.0":
        description = fmu_description.add_sources(description, compiled)
    else:
        content["sources/buildDescription.xml"] = fmu_description.build_description(identifier(model), compiled)
    licence = metadata.distribution("brickpilot").read_text("licenses/LICENSE")
    if licence:
        content["documentation/licenses/license.txt"] = licence.encode()
    return {"modelDescription.xml": description, **content}


def _token(sources: Mapping[str, bytes], table: str) -> str:
    """Returns a token that any change of the sources or of the robot changes."""
    digest = hashlib.sha256(table.encode())
    for name, text in sources.items():
        digest.update(name.encode() + b"\0" + text)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _compiled(content: Mapping[str, bytes]) -> bytes:
    with tempfile.TemporaryDirectory() as folder, disk_named(folder):
        for name, text in content.items():
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text)
        library = Path(folder, "binaries", "library")
        fmu_sources.compile_library(Path(folder, "sources"), library)
        return library.read_bytes()
