"""`brickpilot check` states which effects and parameters a data set can show; here the right answer is known."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import brickpilot as bp
import pytest
from brickpilot.data import reading
from brickpilot.data.signals import Vehicle
from brickpilot.readiness.data_check import Check, check
from brickpilot.report import check_text
from command import brickpilot
from synthetic import motor, robot, write

MEASURED = Path(__file__).parents[3] / "shared" / "data"
NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
NOMINAL = "\n".join(
    f"{name} = {{ value = {robot().parameters[name]}, sd = {robot().parameters[name] * 0.02} }}"
    for name in ("mass", "yaw_inertia", "wheel_radius", "half_track", "resistance", "torque_constant", "emf_constant")
)
STRAIGHT = {"ahead": (4.0, 4.0), "back": (-5.0, -5.0)}
BOTH = {**STRAIGHT, "right": (4.0, -4.0), "left": (-5.0, 5.0)}


def checked(folder: Path, moves: dict[str, tuple[float, float]], **told: object) -> Check:
    return check(reading.read(write(folder, robot(), NOISE, NOMINAL, manoeuvres=moves, **told)), jobs=1)  # type: ignore[arg-type]


def test_timing_and_noise_are_those_of_the_log(tmp_path: Path) -> None:
    def spoil(name: str, table) -> None:
        if name == "back":
            table["yaw_rate"][20:70] = float("nan")

    found = checked(tmp_path / "even", STRAIGHT, spoil=spoil)
    assert [(run.name, run.samples) for run in found.runs] == [("ahead", 200), ("back", 200)]
    assert found.runs[0].manoeuvre == "straight step forward"
    assert found.runs[0].step_s == pytest.approx(0.01)
    assert found.runs[0].late_s == pytest.approx(0.01)
    noise = {one.name: one.noise_sd for one in found.signals}
    assert noise == pytest.approx(NOISE, rel=0.15)
    missing = {one.name: one.missing for one in found.signals}
    assert missing == {"yaw_rate": pytest.approx(50 / 400), "wheel_speed_left": 0.0, "wheel_speed_right": 0.0}

    uneven = checked(tmp_path / "uneven", STRAIGHT, jitter=True)
    assert uneven.runs[0].late_s > 0.014


def test_what_straight_runs_hide_the_advised_manoeuvre_shows(tmp_path: Path) -> None:
    """Straight runs show scrub only if it is huge, and never yaw inertia. The advice is to turn, which shows both."""
    straight = checked(tmp_path / "straight", STRAIGHT)
    assert "gyro_delay" in straight.invisible
    assert straight.parameters["yaw_inertia"].basis == "prior alone"
    first = straight.advice[0]
    assert {"yaw_scrub", "curve_scrub", "viscous_scrub"} & {*first.effects}
    assert any(left != right for (_, left), (_, right) in zip(
        first.manoeuvre.voltage_left, first.manoeuvre.voltage_right, strict=True
    ))  # fmt: skip

    turning = checked(tmp_path / "turning", BOTH)
    assert "gyro_delay" in turning.visible
    assert turning.visible["yaw_scrub"].size < straight.visible["yaw_scrub"].size / 10
    assert turning.parameters["yaw_inertia"].basis == "data and prior"
    assert all("yaw_scrub" not in one.effects for one in turning.advice)


@pytest.mark.parametrize(("times", "verdict"), [(0.6, "none"), (1.4, "named")])
def test_discovery_names_an_effect_from_its_smallest_visible_size_on(
    times: float, verdict: str, tmp_path: Path
) -> None:
    """Below this size, the effect explains less than a fifth of the model-error floor, so it is not named."""
    size = checked(tmp_path / "plain", BOTH).visible["yaw_scrub"].size
    rubbing = dataclasses.replace(robot(), effects={"yaw_scrub": {"moment": times * size}})
    found = bp.discover(write(tmp_path / "rubbing", rubbing, NOISE, NOMINAL, manoeuvres=BOTH, roles=[None] * len(BOTH)))
    assert (found.verdict, [one.name for one in found.effects]) == (verdict, ["yaw_scrub"] * (verdict == "named"))


def test_more_noise_hides_smaller_effects(tmp_path: Path) -> None:
    quiet = check(reading.read(write(tmp_path / "quiet", robot(), NOISE, NOMINAL, manoeuvres=BOTH)), jobs=1)
    loud = {name: 40 * sd for name, sd in NOISE.items()}  # far above the model-error floor
    noisy = check(reading.read(write(tmp_path / "noisy", robot(), loud, NOMINAL, manoeuvres=BOTH)), jobs=1)
    assert noisy.visible["coulomb_friction"].size > 3 * quiet.visible["coulomb_friction"].size


@pytest.mark.parametrize("vehicle", ["diff_drive", "motor"])
def test_the_command_prints_lines_or_one_object(vehicle: Vehicle, tmp_path: Path) -> None:
    if vehicle == "motor":
        moves = {"forward": (4.0, 0.0), "backward": (-5.0, 0.0)}
        folder = write(tmp_path / "set", motor(), {"speed": 0.1}, "", manoeuvres=moves)
    else:
        folder = write(tmp_path / "set", robot(), NOISE, NOMINAL, manoeuvres=BOTH)
    said = brickpilot("check", str(folder), cwd=tmp_path)
    assert said.returncode == 0
    assert "straight step forward" in said.stdout if vehicle == "diff_drive" else "step forward" in said.stdout
    assert "brickpilot discover will take " in said.stdout
    figures = json.loads(brickpilot("check", str(folder), "--json", cwd=tmp_path).stdout)
    assert figures["vehicle"] == vehicle
    assert set(figures["visible"]) & set(figures["invisible"]) == set()
    assert all(one["size"] >= 0.003 for one in figures["visible"].values() if one["unit"] == "s")
    if vehicle == "motor":
        assert not {"yaw_scrub", "carpet_nap", "gyro_bias"} & {*figures["visible"], *figures["invisible"]}


def test_a_data_set_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    said = brickpilot("check", "absent", cwd=tmp_path)
    assert said.returncode == 2
    assert said.stderr.count("\n") == 1
    assert "absent" in said.stderr


@pytest.mark.parametrize("name", ["lego_ev3_motor", "micromouse", "linear_axis", "balancer_wheel", "geared_motor"])
def test_measured_data_can_be_checked(name: str) -> None:
    if not (MEASURED / name).is_dir():
        pytest.skip(f"no measured data at {MEASURED}")
    found = check(reading.read(MEASURED / name), jobs=1)
    text = "\n".join(check_text.lines(found))
    assert found.visible
    assert all(run.name in text for run in found.runs)
    json.dumps(found.to_json(), allow_nan=False)
