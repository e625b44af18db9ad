"""A model as an FMU: the plant with its effects, as a co-simulation unit of FMI 2.0 or 3.0.

The FMU's C sources are the plant and the FMI layer, which are installed beside this module, and the robot's table.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

from brickpilot.catalogue import PROFILE_CODES, VEHICLE_CODES, effects_of
from brickpilot.data import whole_files
from brickpilot.errors import WorkFailedError, disk_named
from brickpilot.export import fmu_description
from brickpilot.export.fmu_description import Variable, variables
from brickpilot.vehicle.model import Model

VERSIONS = ("2.0", "3.0")
_EARLIEST = (1980, 1, 1, 0, 0, 0)  # zip's earliest time, given to all files, so that equal models give equal bytes


def archive(model: Model, version: str, *, binary: bool = True) -> bytes:
    """Returns the FMU: description, sources, and the library of this platform.

    Args:
        version: version of FMI, one of `VERSIONS`.
        binary: False leaves the library out, so that no compiler is needed.

    Raises:
        WorkFailedError: there is no C compiler, or the compiler fails.
        InputError, SimulationError: the plant refuses the model.
    """
    content = _content(model, version)
    if binary:
        folder, ending = binary_place(version)
        content[f"binaries/{folder}/{identifier(model)}{ending}"] = _compiled(content)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for name in sorted(content, key=lambda name: (name != "modelDescription.xml", name)):
            info = zipfile.ZipInfo(name, _EARLIEST)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            file.writestr(info, content[name])
    return buffer.getvalue()


def identifier(model: Model) -> str:
    """Returns the model's name as a C identifier."""
    word = whole_files.plain_name(model.name)
    return f"model_{word}" if word[0].isdigit() else word


def _content(model: Model, version: str) -> dict[str, bytes]:
    """Returns path -> content of all files except the library."""
    rows = variables(model)
    sources = source_files(version)
    token = _token(sources, robot_table(model, "", rows))
    sources[ROBOT] = robot_table(model, token, rows).encode()
    compiled = sorted(name for name in sources if name.endswith(".c"))
    description = fmu_description.description(model, version, identifier(model), token, rows, compiled)
    content = {f"sources/{name}": text for name, text in sources.items()}
    if version == "3.0":
        content["sources/buildDescription.xml"] = fmu_description.build_description(identifier(model), compiled)
    licence = metadata.distribution("brickpilot").read_text("licenses/LICENSE")
    if licence:
        content["documentation/licenses/license.txt"] = licence.encode()
    return {"modelDescription.xml": description, **content}


def _token(sources: Mapping[str, bytes], table: str) -> str:
    """Returns a token that changes with every change of the sources or of the robot."""
    digest = hashlib.sha256(table.encode())
    for name, text in sources.items():
        digest.update(name.encode() + b"\0" + text)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _compiled(content: Mapping[str, bytes]) -> bytes:
    """Returns the library of the FMU's sources for this machine."""
    with tempfile.TemporaryDirectory() as folder, disk_named(folder):
        for name, text in content.items():
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text)
        library = Path(folder, "binaries", "library")
        compile_library(Path(folder, "sources"), library)
        return library.read_bytes()


HOME = Path(__file__).parent / "c"
ROBOT = "robot.c"

_FLAGS = ("-std=c99", "-O2", "-fPIC", "-ffp-contract=off", "-fvisibility=hidden")
_LIBRARY = {"win32": ".dll", "darwin": ".dylib"}


def source_files(version: str) -> dict[str, bytes]:
    """Returns path -> content of the sources for one version of FMI, without the table of the robot."""
    other = {"2.0": "fmi3", "3.0": "fmi2"}[version]
    left_out = (other, "lanes")  # an FMU simulates only one vehicle
    sources = {}
    for path in sorted(HOME.rglob("*.[ch]")):
        if not path.name.startswith(left_out):
            sources[path.relative_to(HOME).as_posix()] = path.read_bytes()
    return sources


def robot_table(model: Model, token: str, variables: Sequence[Variable]) -> str:
    """Returns the C file with the robot's variables. Numbers are hexadecimal, so that no number is rounded."""
    rows = [
        f'    {{FMU_{row.kind}, "{row.name}", {row.effect}, {row.index}, {row.start.hex()}}}, /* {row.start!r} */'
        for row in variables
    ]
    effects = effects_of(model.effects)
    names = ", ".join(f'"{effect.name}"' for effect in effects) or "NULL"
    return "\n".join(
        [
            '#include "fmi/fmu.h"',
            "",
            f"static const char *const EFFECT[] = {{{names}}};",
            "",
            "static const fmu_variable_t VARIABLE[] = {",
            *rows,
            "};",
            "",
            "const fmu_robot_t fmu_robot = {",
            f'    .token = "{token}",',
            f"    .vehicle = {VEHICLE_CODES[model.vehicle]},",
            f"    .profile = {PROFILE_CODES[model.profile]},",
            f"    .effect_count = {len(effects)},",
            "    .effect = EFFECT,",
            f"    .variable_count = {len(variables)},",
            "    .variable = VARIABLE,",
            "};",
            "",
        ]
    )


def binary_place(version: str) -> tuple[str, str]:
    """Returns the folder of this machine's binary within an FMU, and the ending of a library."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    ending = _LIBRARY.get(sys.platform, ".so")
    if version == "2.0" and machine == "x86_64":
        return {"windows": "win64", "darwin": "darwin64", "linux": "linux64"}[system], ending
    return f"{machine}-{system}", ending


def compile_library(sources: Path, library: Path) -> None:
    """Compiles every C file below `sources` into a library, with the system's compiler.

    Raises:
        WorkFailedError: there is no compiler, or the compiler fails.
    """
    of_python = (sysconfig.get_config_var("CC") or "").split()[:1]  # Python's compiler, without options
    known = (name for name in [*of_python, "cc", "gcc", "clang"] if shutil.which(name))
    compiler = os.environ.get("CC") or next(known, None)
    if compiler is None:
        raise WorkFailedError(
            "an FMU needs a C compiler, such as gcc or clang; --sources-only makes one without a binary"
        )
    library.parent.mkdir(parents=True)
    names = sorted(path.relative_to(sources).as_posix() for path in sources.rglob("*.c"))
    command = [*compiler.split(), *_FLAGS, "-shared", "-I.", *names, "-lm", "-o", str(library.resolve())]
    try:
        done = subprocess.run(command, cwd=sources, capture_output=True, text=True, check=False)
    except OSError as error:
        raise WorkFailedError(f"the C compiler {compiler} does not start: {error.strerror}") from error
    if done.returncode != 0:
        first = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
        raise WorkFailedError(f"the C compiler {compiler} failed: {first.strip()}")
