"""Composed terms are written as C files that, built into the simulator, give the same numbers as the terms.

Terms without effect are refused.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import brickpilot
import pytest
from brickpilot.report import composed_law
from brickpilot.vehicle.composed_terms import Term, basis, settings_of
from test_compose import terms

ROOT = Path(__file__).resolve().parents[2]

# Terms with every way to act and every symbol. Each entry becomes a file: one for each place, and one for a motor.
COMPOSED: dict[str, tuple[str, dict[str, float], dict[str, float]]] = {
    "at_the_drive": (
        "diff_drive",
        {
            "drive_gain_v": 0.01,
            "drive_gain_diff_w": -0.002,
            "drive_gain_t": 0.02,
            "drive_add_root_v": -0.2,
            "drive_add_other": 0.05,
            "drive_add_diff_sin_time": 0.3,
        },
        {"frequency": 1.7, "clock": 1.0},
    ),
    "at_the_wheel": (
        "diff_drive",
        {
            "wheel_loss_abs_w": 1e-5,
            "wheel_loss_diff_t": 1e-4,
            "wheel_dry_constant": 0.003,
            "wheel_dry_diff_i": 0.01,
            "wheel_dry_v": 1e-4,
            "wheel_gain_i": -0.3,
            "wheel_push_sin_angle": 0.002,
            "wheel_push_diff_cos_angle": 0.001,
            "wheel_push_spring": 1e-5,
        },
        {"order": 3.0, "clock": 0.5},
    ),
    "at_the_body": (
        "diff_drive",
        {
            "surge_dry_patch": 0.1,
            "surge_loss_u2": 1.0,
            "surge_push_tether": 0.2,
            "surge_push_sprung": 0.1,
            "surge_push_cos_x": 0.05,
            "yaw_dry_u": 0.01,
            "yaw_loss_r2": 1e-4,
            "yaw_push_sprung": 2e-4,
            "yaw_push_t": 1e-3,
        },
        {"patch_x": 0.3, "patch_half_width": 0.1, "frequency": 2.0, "damping": 0.2, "wavelength": 0.3, "clock": 0.0},
    ),
    "on_the_floor": (
        "diff_drive",
        {
            "floor_add_sin_x": 0.05,
            "floor_add_cos_x": -0.02,
            "floor_add_patch": 0.04,
            "surge_push_patch": 0.05,
            "accel_surge_add_a": 0.1,
            "gyro_add_b": 0.02,
        },
        {"wavelength": 0.3, "patch_x": 0.1, "patch_half_width": 0.1},
    ),
    "at_the_sensors": (
        "diff_drive",
        {
            "gyro_add_a": 0.02,
            "gyro_add_t2": 0.01,
            "gyro_add_current_sum": 0.1,
            "accel_surge_add_a3": 0.01,
            "accel_surge_add_b": 0.05,
            "accel_sway_add_a": -0.1,
            "accel_sway_add_sin_time": 0.1,
            "encoder_gain_one": 0.01,
            "encoder_gain_t": 0.002,
            "encoder_gain_sin_angle": 0.02,
            "encoder_gain_diff_abs_w": 0.001,
            "encoder_gain_diff_cos_angle": 0.03,
        },
        {"frequency": 1.1, "order": 3.0, "clock": 1.0},
    ),
    "of_a_motor": (
        "motor",
        {
            "drive_gain_v2": 0.001,
            "drive_add_other": 0.1,
            "wheel_loss_w": 1e-6,
            "wheel_push_cos_angle": 0.002,
            "surge_loss_abs_u": -0.1,
            "surge_push_patch": 0.05,
        },
        {"order": 2.0, "patch_x": 0.2, "patch_half_width": 0.1},
    ),
}


def source(name: str) -> str:
    vehicle, coefficients, settings = COMPOSED[name]
    return composed_law.render(terms(**coefficients), settings, name=name, vehicle=vehicle)


@pytest.mark.parametrize(
    ("chosen", "name", "vehicle"),
    [
        ({}, "empty", "diff_drive"),
        ({"surge_loss_u2": 1.0}, "No Name", "diff_drive"),
        ({"yaw_push_u2": 1.0}, "turning", "motor"),
        ({"wheel_dry_diff_v": 1.0}, "sided", "motor"),
        ({"encoder_gain_one": 1.0}, "sensor", "motor"),
        ({"floor_add_patch": 0.1}, "floor", "motor"),
        ({"surge_push_patch": 1.0}, "strip", "diff_drive"),
    ],
)
def test_what_makes_no_effect_is_refused(chosen: dict[str, float], name: str, vehicle: str) -> None:
    with pytest.raises(ValueError, match=r"no effect can be made|does not act on a motor|no value for patch"):
        composed_law.render(terms(**chosen), {}, name=name, vehicle=vehicle)


def test_every_term_alone_is_c_without_warnings(tmp_path: Path) -> None:
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-fsyntax-only"]
    include = [f"-I{ROOT / 'sim_host'}", f"-I{ROOT / 'sim_host/include'}"]
    alike = [[one] for one in basis() if not one.sided] + [[one for one in basis() if one.sided]]
    for number, chosen in enumerate(alike):
        values = [Term(one, 0.5) for one in chosen]
        text = composed_law.render(values, settings_of(chosen, {}), name="alone", vehicle="diff_drive")
        (tmp_path / f"alone_{number}.c").write_text(text, encoding="utf-8")
    compiled = subprocess.run(
        ["cc", *flags, *include, *map(str, sorted(tmp_path.glob("*.c")))], capture_output=True, text=True
    )
    assert compiled.returncode == 0, compiled.stderr


COMPARE = """
import sys, json, dataclasses
import numpy as np
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.plant import OpenLoopRun, State

def run(model, vehicle):
    time = np.arange(0.0, 3.0, 0.01)
    volts = np.where((time % 1.4 < 0.7)[:, None], [7.0, 3.0], [-5.0, 6.0])
    volts[(time > 2.0) & (time < 2.2)] = (np.nan, 4.0)
    start = State(age=12.0, surge=0.2, heading=0.3) if vehicle == "diff_drive" else State(age=12.0)
    run = OpenLoopRun(time, volts[:, : 2 if vehicle == "diff_drive" else 1], start)
    return plant.simulate([(model, run)])[0].outputs

worst = {}
for name, (vehicle, coefficients, settings) in json.loads(sys.argv[1]).items():
    base = dataclasses.replace(rcx(), vehicle=vehicle)
    named, general, plain = (
        run(dataclasses.replace(base, effects=effects), vehicle)
        for effects in ({name: {}}, {"composed_term": {**coefficients, **settings}}, {})
    )
    shares = [np.nanmax(np.abs(named[s] - general[s])) / max(np.nanmax(np.abs(general[s])), 1e-9) for s in general]
    moved = max(np.nanmax(np.abs(plain[s] - general[s])) for s in general)
    worst[name] = [float(max(shares)), float(moved)]
print(json.dumps(worst))
"""


def test_the_c_files_build_into_the_simulator_and_give_the_same_numbers(tmp_path: Path) -> None:
    for folder in ("firmware", "hal", "sim_host"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("*.svg", "build"))
    shutil.copy(ROOT / "CMakeLists.txt", tmp_path)
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools/check_generated", tmp_path / "tools")
    effects = tmp_path / "sim_host/effects"
    table = (effects / "effects.c").read_text()
    for name in COMPOSED:
        (effects / f"{name}.c").write_text(source(name), encoding="utf-8")
        table = table.replace(
            "    EFFECT(composed_term) \\\n", f"    EFFECT(composed_term) \\\n    EFFECT({name}) \\\n"
        )
    (effects / "effects.c").write_text(table)
    build = tmp_path / "build"
    options = ["-DBRICKPILOT_TESTS=OFF", "-DCMAKE_BUILD_TYPE=Debug"]
    subprocess.run(["cmake", "-S", tmp_path, "-B", build, *options], check=True, capture_output=True)
    made = subprocess.run(
        ["cmake", "--build", build, "--target", "brickpilot_sim", "-j", "2"], capture_output=True, text=True
    )
    assert made.returncode == 0, made.stdout + made.stderr

    package = tmp_path / "package" / "brickpilot"
    shutil.copytree(Path(brickpilot.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(next(build.rglob("libbrickpilot_sim.so")), package)
    shutil.copy(ROOT / "sim_host/include/brickpilot_sim.h", package)
    compared = subprocess.run(
        [sys.executable, "-c", COMPARE, json.dumps(COMPOSED)],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(package.parent), "PATH": "/usr/bin:/bin"},
    )
    assert compared.returncode == 0, compared.stderr
    for name, (difference, moved) in json.loads(compared.stdout).items():
        assert difference < 1e-12, name
        assert moved > 1e-3, name
