"""The C sources of an FMU: plant and FMI layer, which are installed beside this module, and the robot's table."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

from brickpilot.catalogue import PROFILE_CODES, VEHICLE_CODES
from brickpilot.errors import WorkFailedError
from brickpilot.export.fmu_variables import Variable, effect_names
from brickpilot.vehicle.model import Model

HOME = Path(__file__).parent / "c"
ROBOT = "robot.c"

_FLAGS = ("-std=c99", "-O2", "-fPIC", "-ffp-contract=off", "-fvisibility=hidden")
_LIBRARY = {"win32": ".dll", "darwin": ".dylib"}


def files(version: str) -> dict[str, bytes]:
    """Returns path -> content of the sources for one version of FMI, without the table of the robot."""
    other = {"2.0": "fmi3", "3.0": "fmi2"}[version]
    left_out = (other, "lanes")  # an FMU advances one vehicle, and not several side by side
    found = {}
    for path in sorted(HOME.rglob("*.[ch]")):
        if not path.name.startswith(left_out):
            found[path.relative_to(HOME).as_posix()] = path.read_bytes()
    return found


def robot_table(model: Model, token: str, variables: Sequence[Variable]) -> str:
    """Returns the C file with the robot's variables. Numbers are hexadecimal, so that none is rounded."""
    rows = [
        f'    {{FMU_{one.kind}, "{one.name}", {one.effect}, {one.index}, {one.start.hex()}}}, /* {one.start!r} */'
        for one in variables
    ]
    effects = effect_names(model)
    names = ", ".join(f'"{name}"' for name in effects) or "NULL"
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


def place(version: str) -> tuple[str, str]:
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
        WorkFailedError: there is no compiler, or it fails.
    """
    compiler = os.environ.get("CC") or next((name for name in _compilers() if shutil.which(name)), None)
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


def _compilers() -> list[str]:
    """Returns compilers to try: that of this Python first, if it is one word."""
    own = (sysconfig.get_config_var("CC") or "").split()
    return [*own[:1], "cc", "gcc", "clang"]
