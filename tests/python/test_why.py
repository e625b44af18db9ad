"""`brickpilot why` turns a log into an answer, and writes the robot's constants for other programs."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pages
import pytest
import yaml
from brickpilot.report.why_page import Constants, files_of
from brickpilot.vehicle import plant
from brickpilot.vehicle.drive_constants import FeedForward, Odometry, drives, feed_forward, odometry
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from command import brickpilot
from findings import Page
from synthetic import motor, robot, write

MOVES = ((4, 4), (-5, -5), (5, -5), (-4, 4), (6, 3), (3, 6), (7, 7), (-6, 6))


def changed(**effects: dict[str, float]) -> Model:
    return dataclasses.replace(robot(), effects=effects)


def write_log(file: Path, truth: Model) -> None:
    """Writes the log of a robot that rests between its drives: millis, volts, counts of 960 a turn, and a gyro."""
    random = np.random.default_rng(1)
    time = np.arange(0.0, 3.0 * len(MOVES) + 1.0, 0.01)
    volts = np.zeros((time.size, 2))
    for number, move in enumerate(MOVES):
        volts[(time > 3.0 * number + 1.0) & (time < 3.0 * number + 2.2)] = move
    outputs = plant.simulate([(truth, OpenLoopRun(time, volts))])[0].outputs
    counts = [np.floor(outputs[f"wheel_angle_{side}"] / (2 * np.pi) * 960) for side in ("left", "right")]
    gyro = np.degrees(outputs["yaw_rate"]) + random.normal(0.0, 0.4, time.size)
    rows = [
        f"{1000 * t:.0f},{v[0]:.2f},{v[1]:.2f},{left:.0f},{right:.0f},{turn:.2f}"
        for t, v, left, right, turn in zip(time, volts, *counts, gyro, strict=True)
    ]
    file.write_text("\n".join(["millis,v_left,v_right,encL,encR,gz", *rows, ""]))


def test_a_log_becomes_an_answer_with_files(tmp_path: Path) -> None:
    write_log(tmp_path / "shop<script>.csv", changed(coulomb_friction={"torque": 0.012}))
    stated = [f"{name}={robot().parameters[name]}" for name in ("wheel_radius", "half_track", "mass", "resistance")]
    options = [word for one in stated for word in ("--nominal", one)]
    said = brickpilot(
        "why", "shop<script>.csv", "--frame", "FRD", *options, "--out", "found", "--verbose", cwd=tmp_path
    )
    assert said.returncode == 0, said.stderr
    answer = [line for line in said.stdout.splitlines() if not line.startswith("note: ")]
    assert [line.split(":")[0] for line in answer[:2]] == ["what is wrong", "how sure"]
    assert "coulomb_friction" in answer[0]
    assert "It is weaker than the simulation" in said.stdout
    assert "It stops short" in said.stdout
    assert "drive straight" not in said.stdout

    found = tmp_path / "found"
    page = (found / "why.html").read_text()
    assert "shop<script>" not in page
    pages.assert_self_contained(page)
    assert 2 <= len(pages.figures(page)) <= 3
    for name in re.findall(r'<li><a href="([^"]+)"', page):
        assert (found / name).exists(), name
    assert {one.name for one in found.iterdir()} >= {"why.html", "report.html", "verdict.json", "model.toml", "data"}

    settings = yaml.safe_load((found / "diff_drive_controller.yaml").read_text())
    controller = settings["diff_drive_controller"]["ros__parameters"]
    assert controller["wheel_radius"] == pytest.approx(robot().parameters["wheel_radius"], rel=1e-5)
    assert controller["left_wheel_radius_multiplier"] == pytest.approx(1.0, abs=0.03)

    source = tmp_path / "main.c"
    source.write_text(
        '#include "robot_constants.h"\n#include <stdio.h>\nint main(void) { printf("%f", ROBOT_KS_VOLTS); }'
    )
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    subprocess.run(
        [compiler, "-std=c11", "-Wall", "-Werror", f"-I{found}", source, "-o", tmp_path / "a.out"], check=True
    )
    ks = float(subprocess.run([tmp_path / "a.out"], capture_output=True, text=True, check=True).stdout)
    p = robot().parameters
    assert ks == pytest.approx(0.012 * p["resistance"] / p["torque_constant"], rel=0.15)


@pytest.mark.parametrize("value", [0.0, -0.0, 3.0, 0.25, 1e-7, 2.5e6])
def test_the_header_compiles_with_each_kind_of_number(tmp_path: Path, value: float) -> None:
    constants = Constants(FeedForward(value, value, value, "m"), Odometry(value, value, value, value, value))
    (tmp_path / "robot_constants.h").write_text(files_of("rig", constants)["robot_constants.h"])
    lines = [line.split()[1] for line in (tmp_path / "robot_constants.h").read_text().splitlines() if "#define" in line]
    used = [name for name in lines if not name.endswith("_H")]
    assert len(used) == 6
    source = tmp_path / "main.c"
    source.write_text(f'#include "robot_constants.h"\nfloat all[] = {{ {", ".join(used)} }};\n')
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-c", source, "-o", tmp_path / "a.o"], check=True)


def test_a_motor_s_answer_speaks_of_no_wheels(tmp_path: Path) -> None:
    moves = {"a": (4.0, 0.0), "b": (-5.0, 0.0), "c": (3.0, 0.0), "d": (-4.0, 0.0)}
    write(tmp_path / "set", motor(), {"speed": 0.1}, "", manoeuvres=moves)
    said = brickpilot("why", "set", "--out", "found", "--json", cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    figures = json.loads(said.stdout)
    assert figures["verdict"]["verdict"] == "none"
    assert figures["what"].startswith("Nothing is wrong")
    assert set(figures["constants"]) == {"feed_forward"}
    assert not (tmp_path / "found" / "diff_drive_controller.yaml").exists()
    said_to_him = Page((tmp_path / "found" / "why.html").read_text()).text.lower()
    assert "wheel" not in said_to_him.split("from which data")[0]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["absent.csv"], "absent.csv: no such file"),
        (["notes.xyz"], "no kind of log is known by this ending"),
        (["set", "--vehicle", "motor"], "a data set describes itself"),
        (["log.wpilog"], "--vehicle: is needed"),
    ],
)
def test_what_cannot_be_read_is_one_line_and_writes_nothing(tmp_path: Path, arguments: list[str], line: str) -> None:
    for name in ("notes.xyz", "log.wpilog"):
        (tmp_path / name).write_text("x")
    write(tmp_path / "set", motor(), {"speed": 0.1}, "", manoeuvres={"a": (4.0, 0.0)})
    said = brickpilot("why", *arguments, "--out", "found", cwd=tmp_path)
    assert said.returncode == 2
    assert line in said.stderr
    assert said.stderr.count("\n") == 1
    assert not (tmp_path / "found").exists()


def test_a_log_in_the_place_of_a_data_set_is_sent_to_why(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("ms,pwm\n0,1\n")
    said = brickpilot("check", "log.csv", cwd=tmp_path)
    assert said.returncode == 2
    assert said.stderr.startswith("brickpilot: log.csv: is no data set; `brickpilot why` answers from a log")


def test_feed_forward_is_that_of_the_equations() -> None:
    """Eqs. 12 to 14 without inductance, with D = `steady`: kV = D / (r K_t), kS = dry friction torque R / K_t."""
    p = robot().parameters
    weight = p["mass"] * p["gravity"] * p["wheel_radius"] ** 2
    steady = p["torque_constant"] * p["emf_constant"]
    steady += p["resistance"] * (p["viscous_friction"] + p["rolling_friction"] * weight)
    found = feed_forward(changed(coulomb_friction={"torque": 0.01}))
    assert found.kv == pytest.approx(steady / (p["wheel_radius"] * p["torque_constant"]), rel=0.01)
    assert found.ks == pytest.approx(0.01 * p["resistance"] / p["torque_constant"], rel=0.02)
    assert feed_forward(robot()).ks == pytest.approx(0.0, abs=0.03)


def test_a_larger_left_wheel_has_a_larger_multiplier_and_veers_right() -> None:
    p = robot().parameters
    larger = changed(wheel_radius_mismatch={"mismatch": 0.05})
    found, even = odometry(larger, p), odometry(robot(), p)
    assert found is not None
    assert even is not None
    assert (found.left, found.right) == pytest.approx((1.025, 0.975), abs=1e-3)
    assert (even.left, even.right, even.turning) == pytest.approx((1.0, 1.0, 1.0), abs=5e-3)
    veer = drives(larger).veer
    assert veer is not None
    assert veer > 0.1
    assert drives(robot()).veer == pytest.approx(0.0, abs=1e-6)


def test_wheels_wider_apart_than_stated_have_a_larger_separation() -> None:
    p = robot().parameters
    wide = dataclasses.replace(robot(), parameters={**p, "half_track": 1.1 * p["half_track"]})
    found = odometry(wide, p)
    assert found is not None
    assert found.turning == pytest.approx(1.1, rel=0.01)
    assert found.left == pytest.approx(1.0, rel=0.01)
