"""Who may include whom: the rules of the house, checked on every include and import."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)

# Layer of a file -> include prefixes it may use.
ALLOWED = {
    "firmware/core": {"core"},
    "firmware/model": {"core", "model"},
    "firmware/estimator": {"core", "estimator"},
    "firmware/autopilot": {"core", "autopilot"},
    "firmware/control": {"core", "control"},
    "firmware/mixer": {"core", "mixer"},
    "firmware/app": {"core", "model", "estimator", "autopilot", "control", "mixer", "app", "hal.h", "wire"},
    "hal/h8": set(),
    "hal/include": {"wire"},
    "hal/wire": {"wire"},
    "hal/sil": {"hal.h", "wire", "sil"},
    "hal/link": {"hal.h", "wire", "link"},
    "hal/rcx": {"hal.h", "wire", "rcx"},
    "hal/template": {"hal.h", "wire", "template"},
    "hal/h8sim": {"hal.h", "wire", "h8sim"},
    "firmware/targets/rcx": {"app", "targets", "hal.h", "wire", "rcx"},
    "firmware/targets/h8sim": {"app", "targets", "hal.h", "wire", "link", "h8sim"},
    "sim_host/include": set(),
    "sim_host/models": set(),
    "sim_host/plant": {"plant", "effects", "brickpilot_sim.h", "models"},
    "sim_host/effects": {"effects", "brickpilot_sim.h"},
    "sim_host/sensors": {"sensors", "brickpilot_sim.h", "models"},
    "sim_host/brick": {"brick", "app", "wire", "link", "brickpilot_brick.h"},
    "sim_host/run": {
        "run",
        "plant",
        "effects",
        "sensors",
        "brickpilot_sim.h",
        "app",
        "core",
        "autopilot",
        "sil",
        "hal.h",
        "models",
    },
}


def offences(path: Path, text: str) -> list[str]:
    """Includes in `text` that the layer of `path` (relative to the root) may not use."""
    layer = "/".join(path.parts[: 3 if "targets" in path.parts else 2])
    if layer not in ALLOWED:
        return [f"{path}: no rule for {layer}"]
    used = (include.split("/")[0] for include in INCLUDE.findall(text))
    return [f"{path}: {prefix}" for prefix in used if prefix not in ALLOWED[layer]]


def sources() -> list[Path]:
    found = [p.relative_to(ROOT) for top in ("firmware", "hal", "sim_host") for p in (ROOT / top).rglob("*.[ch]")]
    assert found
    return found


def test_every_include_keeps_to_the_layers() -> None:
    assert [bad for path in sources() for bad in offences(path, (ROOT / path).read_text())] == []


@pytest.mark.parametrize(
    ("path", "include"),
    [
        ("firmware/control/pid.c", "autopilot/los.h"),
        ("firmware/control/pid.c", "hal.h"),
        ("firmware/estimator/speed.c", "model/motor.h"),
        ("hal/sil/sil.c", "app/step.h"),
        ("hal/link/link.c", "app/loop.h"),
        ("sim_host/plant/plant.c", "hal.h"),
        ("sim_host/effects/coulomb_friction.c", "run/sil.h"),
    ],
)
def test_a_forbidden_include_is_caught(path: str, include: str) -> None:
    assert offences(Path(path), f'#include "{include}"\n') != []


def test_python_reads_no_c_header_but_the_plants_interface() -> None:
    package = ROOT / "tools" / "brickpilot"
    named = {h for p in package.rglob("*.py") for h in re.findall(r"\w+\.h\b", p.read_text()) if "gen" not in p.parts}
    assert named <= {"brickpilot_sim.h", "brickpilot_brick.h"}


def test_only_the_command_line_prints() -> None:
    package = ROOT / "tools" / "brickpilot"
    printers = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "click.echo", "click.secho"):
                printers.add(path.relative_to(package).as_posix())
    assert {one for one in printers if not one.startswith("cli")} <= {"terminal.py", "gen/__main__.py"}


def test_firmware_holds_no_floating_point_and_no_library() -> None:
    forbidden = re.compile(
        r"\b(float|double|malloc|free|printf|memcpy|memset|abs|labs)\b|#\s*include\s*<(?!std(int|bool|def)\.h>)"
    )
    bad = []
    parsers = [*(ROOT / "hal/wire").glob("*.[ch]"), *(ROOT / "hal/link").glob("set.[ch]")]
    for path in (*(ROOT / "firmware").rglob("*.[ch]"), *parsers):
        if "targets" in path.parts:  # these use their brick's kernel
            continue
        code = re.sub(r"/\*.*?\*/|//[^\n]*", "", path.read_text(), flags=re.DOTALL)
        bad += [f"{path.name}: {match.group()}" for match in forbidden.finditer(code)]
    assert bad == []
