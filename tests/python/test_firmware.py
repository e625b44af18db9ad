"""`brickpilot firmware`: robots that are not the packaged one get constants that fit them, an image, and a flight."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
from brickpilot.constants import RCX
from brickpilot.errors import InputError
from brickpilot.firmware import boards, params_header, robot, simulate
from brickpilot.vehicle import flight, flight_figures, model
from brickpilot.vehicle.coefficients import coupled, motor_step
from brickpilot.vehicle.combinations import difference_inertia
from brickpilot.vehicle.settings import plain
from command import brickpilot

ROOT = Path(__file__).parents[2]
HEAD = 'vehicle = "diff_drive"\nprofile = "coupled"\n'
OWN = {
    # A small robot with toy motors: a short time constant, a coarse gyro, a finer encoder.
    "small": """
[parameters]
mass = 0.3
yaw_inertia = 0.0006
half_track = 0.045
wheel_radius = 0.021
wheel_inertia = 4e-6
resistance = 6.0
inductance = 0.002
emf_constant = 0.12
torque_constant = 0.1
battery_voltage = 7.4
[sensors.encoder]
counts_per_turn = 120
[sensors.imu]
gyro_range = { value = 17.45, unit = "rad/s", basis = "1000 degrees/s" }
""",
    # A robot with gear motors of 1.4 ohm: their currents exceed the model's format, and their friction is stated.
    "middle": """
[parameters]
mass = 2.4
yaw_inertia = 0.03
half_track = 0.1
wheel_radius = 0.035
wheel_inertia = 3e-4
resistance = 1.4
inductance = 0.001
emf_constant = 0.3
torque_constant = 0.24
battery_voltage = 12.0
[effects.coulomb_friction]
torque = 0.06
""",
    "heavy": """
[parameters]
mass = 8.0
yaw_inertia = 0.2
half_track = 0.14
wheel_radius = 0.055
wheel_inertia = 4e-3
resistance = 4.0
inductance = 0.003
emf_constant = 0.6
torque_constant = 0.5
battery_voltage = 12.0
[robot]
length = 0.32
[effects.gyro_scale]
error = 0.05
""",
}


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\n{HEAD}{text}')
    return path


def route(folder: Path, seconds: float, *waypoints_m: tuple[float, float]) -> Path:
    path = folder / "route.toml"
    points = [list(point) for point in waypoints_m]
    path.write_text(f'name = "route"\nkind = "mission"\nduration_s = {seconds}\nwaypoints_m = {points}\n')
    return path


def corner(folder: Path) -> Path:
    """Writes a mission of 12 s with one right angle, for tests that check little of the flight; returns its path."""
    return route(folder, 12.0, (0.5, 0.0), (0.5, 0.4))


def header(path: Path, step: float = 0.009) -> str:
    return params_header.own_header(robot.load(path), step)


def make(folder: Path, path: Path, board: str, *more: str) -> subprocess.CompletedProcess[str]:
    return brickpilot(
        "firmware", "--model", str(path), "--board", board, "--out", str(folder), "--json", *more, cwd=ROOT
    )


@pytest.mark.parametrize("text", [RCX.read_text(), model.render(model.rcx())], ids=["whole file", "parameters alone"])
def test_the_packaged_robot_gets_its_own_constants(text: str, tmp_path: Path) -> None:
    path = tmp_path / "rcx.toml"
    path.write_text(text)
    made = header(path)
    packaged = (ROOT / "firmware/app/params_gen.h").read_text()
    (wanted,) = re.findall(r"#elif STEP_MS == 9\n(.*?)#else", packaged, re.DOTALL)
    (found,) = re.findall(r"#if STEP_MS == 9\n(.*?)#else", made, re.DOTALL)
    assert found == wanted


def poles(motion: robot.Motion, kp: float, ki: float, kd: float, *, angle: bool) -> np.ndarray:
    """Returns the poles of the closed loop, rad/s. States: v, the integral, and y too if the loop controls an angle.

    u = kp (r - y) + ki int(r - y) - kd v, dv/dt = (gain u - v) / time, and y is v or its integral.
    """
    gain, time = motion.gain, motion.time
    if angle:  # states v, y, integral
        matrix = [[-(1 + gain * kd) / time, -gain * kp / time, gain * ki / time], [1, 0, 0], [0, -1, 0]]
    else:
        matrix = [[-(1 + gain * kp) / time, gain * ki / time], [-1, 0]]
    return np.sort_complex(np.linalg.eigvals(np.array(matrix)))


@pytest.mark.parametrize("name", OWN)
def test_the_loops_have_the_packaged_poles_at_one_pace(name: str, tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, name, OWN[name]))
    values, reference = plain(own.vehicle["parameters"]), model.rcx().parameters
    gains, known = (plain(one["controller"]["coupled"]) for one in (own.vehicle, robot.packaged()))
    for motion, loop, angle in ((robot.straight, "speed", False), (robot.turn, "heading", True)):
        names = [f"{loop}_{part}" for part in ("kp", "ki", "kd")]
        mine = poles(motion(values), *(gains[one] for one in names), angle=angle)
        packaged = poles(motion(reference), *(known[one] for one in names), angle=angle)
        paces = np.sort(np.abs(mine)) / np.sort(np.abs(packaged))
        if gains[f"{loop}_{'kd' if angle else 'kp'}"] == 0:  # the robot damps itself more than the loop asks for
            assert 1 / motion(values).time > robot.FASTEST * -np.sum(packaged).real * 0.999
            continue
        np.testing.assert_allclose(paces, paces[0], rtol=1e-6)
        mine_faster = motion(values).acceleration(values["battery_voltage"])
        packaged_faster = motion(reference).acceleration(reference["battery_voltage"])
        assert min(1.0, np.sqrt(mine_faster / packaged_faster)) - 1e-9 <= paces[0] <= robot.FASTEST


LIGHT = """
[parameters]
mass = 0.25
yaw_inertia = 0.0004
wheel_inertia = 5e-6
"""


def fastest_of_a_half_turn(own: robot.Robot) -> float:
    """Returns the yaw rate, rad/s, after half a turn from rest at heading_limit; the current is a state (eq. 12)."""
    values, volts = plain(own.vehicle["parameters"]), own.value("controller", "coupled", "heading_limit")
    lever = values["wheel_radius"] / values["half_track"]
    step, angle, now = 1e-4, 0.0, np.zeros(2)
    motor = motor_step(values, difference_inertia(values), step)
    for _ in range(200_000):
        now = motor.transition @ now + motor.voltage * volts
        angle += now[1] * lever * step
        if angle > np.pi:
            break
    return float(now[1] * lever)


@pytest.mark.parametrize("gyro_range", [2.0, 5.24, 10.47])
@pytest.mark.parametrize("text", [LIGHT, *OWN.values()], ids=["light", *OWN])
def test_no_turn_is_faster_than_the_gyro_reads(text: str, gyro_range: float, tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, "one", text))
    own = robot.changed(own, {("sensors", "imu", "gyro_range"): gyro_range})
    assert fastest_of_a_half_turn(own) < 0.95 * gyro_range
    battery = own.value("parameters", "battery_voltage") / 9.0
    volts = own.value("controller", "coupled", "heading_limit")
    assert volts == pytest.approx(6.0 * battery) or fastest_of_a_half_turn(own) > 0.85 * gyro_range


def test_a_light_robot_flies_and_a_saturated_gyro_is_told_as_the_cause(tmp_path: Path) -> None:
    turns = str(route(tmp_path, 14.0, (0.4, 0.0), (-0.4, 0.05), (0.4, 0.1), (-0.4, 0.15)))
    done = make(tmp_path / "made", write(tmp_path, "light", LIGHT), "template", "--scenario", turns)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["flight"]["gyro_full_steps"] == 0
    spun = write(tmp_path, "spun", LIGHT + "[controller.coupled]\nheading_limit = 5.6\n")
    done = make(tmp_path / "other", spun, "template", "--scenario", turns)
    steps = json.loads(done.stdout)["flight"]["gyro_full_steps"]
    assert steps > 10
    assert done.returncode == 1
    assert f"; the gyro was at the end of its range in {steps} steps, so lower heading_limit\n" in done.stderr
    assert "at the end of its range" in (tmp_path / "other/flight/report.html").read_text()


def test_motors_of_large_currents_are_held_with_smaller_ones_and_drive_alike(tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, "middle", OWN["middle"]))
    with pytest.raises(ValueError, match="current may reach"):
        coupled(plain(own.vehicle["parameters"]), 0.009)
    values = plain(own.vehicle["parameters"])
    held = params_header.with_room(values, 0.009)
    factors = {name: held[name] / value for name, value in values.items()}
    assert {name for name, factor in factors.items() if factor != 1} == set(params_header.PER_CURRENT)

    scaled, motion = robot.straight(held), robot.straight(values)
    np.testing.assert_allclose((scaled.gain, scaled.time), (motion.gain, motion.time), rtol=1e-12)


def of_size(radius: float, volts: float) -> str:
    """Returns the text of a robot of this wheel radius, m, and battery, V; its motors suit it as in the packaged robot.

    Its speed grows with the square root of the radius, its mass with the power 1.5; currents follow from voltage and
    torque.
    """
    by = radius / 0.0408
    mass = 0.9 * by**1.5
    speed, torque = 0.8 * by**0.5, 0.15 * mass * 9.81 * radius  # m/s without load; N m of both wheels at half speed
    emf = volts / (speed / radius)
    resistance = 0.5 * volts * emf / torque
    return f"""
[parameters]
mass = {mass:.5g}
yaw_inertia = {0.0067 * mass * by**2:.5g}
half_track = {0.07 * by:.5g}
wheel_radius = {radius}
wheel_inertia = {0.05 * mass * radius**2:.5g}
resistance = {resistance:.5g}
inductance = {resistance * 4e-4:.5g}
emf_constant = {emf:.5g}
torque_constant = {0.8 * emf:.5g}
viscous_friction = {0.01 * emf * emf / resistance:.5g}
battery_voltage = {volts}
"""


RADII, VOLTS = (0.008, 0.0156, 0.0408, 0.0624, 0.075, 0.15), (2.0, 9.0, 16.3, 16.5, 28.0)


@pytest.mark.parametrize("volts", VOLTS)
@pytest.mark.parametrize("radius", RADII)
def test_wheels_of_8_to_150_mm_and_batteries_of_2_to_28_v_have_formats(
    radius: float, volts: float, tmp_path: Path
) -> None:
    own = robot.load(write(tmp_path, "sized", of_size(radius, volts)))
    for step in (0.003, 0.009):
        assert header(tmp_path / "sized.toml", step)
        mine = plain(own.vehicle["parameters"])
        model_has = params_header.with_room(mine, step)
        volt = 2.0 ** params_header.voltage_bits(mine)
        for motion in (robot.straight, robot.turn):
            real, modelled = motion(mine), motion(model_has)
            np.testing.assert_allclose((modelled.gain, modelled.time), (volt * real.gain, real.time), rtol=1e-9)


@pytest.mark.parametrize(("radius", "volts"), [(0.008, 2.0), (0.075, 12.0), (0.15, 28.0)])
def test_the_smallest_and_the_largest_robots_fly(
    radius: float, volts: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    own = robot.load(write(tmp_path, "sized", of_size(radius, volts)))
    planned = simulate.plan(own, simulate.mission(own, None), "imu", 0)
    library = boards.closed_loop(own, boards.TEMPLATE, "imu").library()
    flown = flight.fly(dataclasses.replace(planned, firmware=library))
    assert flight_figures.summary(flown)["waypoints_reached"] == 8


def test_a_board_that_cannot_measure_the_battery_is_refused(tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, "high", of_size(0.0408, 24.0)))
    (tmp_path / "avr").mkdir()
    mission = simulate.mission(own, None)
    boards.write_headers(own, mission, boards.BOARDS["avr"], 0.003, tmp_path / "avr", ROOT)
    assert "BOARD_BATTERY_FULL_MV 32000" in (tmp_path / "avr/avr/board.h").read_text()
    assert "MOTOR_VOLTAGE_BITS 1" in (tmp_path / "avr/model/limits.h").read_text()
    with pytest.raises(InputError, match="battery_voltage: 24 V is more than this board measures: 20 V charged"):
        boards.write_headers(own, mission, boards.BOARDS["rcx"], 0.009, tmp_path / "rcx", ROOT)


REFUSED = {
    "parameters.resistance": ("[parameters]\nmass = 2.0\nresistance = 1e-4\n", "ohm"),
    "parameters.battery_voltage": ("[parameters]\nbattery_voltage = 35.0\nemf_constant = 0.9\n", "V"),
    "parameters.emf_constant": ("[parameters]\nemf_constant = 0.05\n", "V s/rad"),
    "parameters.wheel_radius": ("[parameters]\nwheel_radius = 0.0009\n", "m"),
    "sensors.encoder.counts_per_turn": ("[parameters]\nmass = 1.0\n[sensors.encoder]\ncounts_per_turn = 2e5\n", ""),
    "sensors.imu.gyro_range": ("[parameters]\nmass = 1.0\n[sensors.imu]\ngyro_range = 35.0\n", "rad/s"),
    "controller.coupled.speed_kp": ("[parameters]\nmass = 1.0\n[controller.coupled]\nspeed_kp = 900.0\n", "V s/m"),
}


@pytest.mark.parametrize("field", REFUSED)
def test_a_value_beyond_its_format_is_named_with_its_range_and_the_range_holds(field: str, tmp_path: Path) -> None:
    text, unit = REFUSED[field]
    path = write(tmp_path, "wrong", text)
    name = field.rpartition(".")[2]
    line = 1 + path.read_text().splitlines().index(next(one for one in path.read_text().splitlines() if name in one))
    with pytest.raises(InputError) as caught:
        header(path)
    found = re.fullmatch(
        rf"{path}:{line}: {re.escape(field)}: (\S+) is outside (\S+?)\.\.(\S+?)(?: (\D.*?))?: (.+)", str(caught.value)
    )
    assert found, str(caught.value)
    low, high = float(found[2]), float(found[3])
    assert (found[4] or "") == unit
    assert low < high
    for value, fits in ((1.02 * low, True), (0.98 * high, True), (1.02 * high, False)):
        path.write_text(re.sub(rf"{name} = \S+", f"{name} = {value:.6g}", path.read_text()))
        if fits:
            header(path)
        else:
            with pytest.raises(InputError):
                header(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[parameters]\nmass = 1.0\n[robot]\nsize = 0.3\n", r"robot.size: unknown key"),
        ('[controller.coupled]\nspeed_kp = { value = 9, unit = "V" }\n', r"speed_kp.unit: 'V' should be 'V s/m'"),
        ("[sensors.encoder]\ncounts_per_turn = 0\n", r":\d+: sensors.encoder.counts_per_turn: 0 is outside 1e-06\.\."),
        ("[sensors.imu]\nbits = 1e6\n", r":\d+: sensors.imu.bits: 1000000.0 is outside 1\.\.24"),
        ("[robot]\nlength = 0\n", r":\d+: robot.length: 0 is outside"),
        ("[controller.coupled]\ncruise = 0\n", r":\d+: controller.coupled.cruise: 0 is outside"),
        ('[sensors.imu]\nbits = "ten"\n', r"sensors.imu.bits: 'ten' is not a number"),
        ("[sensors]\nimu = 3\n", r"sensors.imu: 3 is not a table"),
    ],
)
def test_a_wrong_file_is_one_line_and_leaves_nothing(text: str, message: str, tmp_path: Path) -> None:
    done = make(tmp_path / "made", write(tmp_path, "wrong", text), "rcx")
    assert done.returncode == 2
    assert re.search(message, done.stderr)
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


def test_other_files_in_the_folder_stay(tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made/thesis.txt").write_text("mine")
    done = make(tmp_path / "made", write(tmp_path, "small", OWN["small"]), "template")
    assert (done.returncode, "holds other files, such as thesis.txt" in done.stderr) == (2, True)
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize(("name", "sensors"), [("small", "imu+encoders"), ("middle", "imu"), ("heavy", "imu+encoders")])
def test_a_robot_of_ones_own_flies_all_waypoints_with_its_rcx_image(name: str, sensors: str, tmp_path: Path) -> None:
    folder = tmp_path / "its firmware"
    done = make(folder, write(tmp_path, name, OWN[name]), "rcx", "--sensors", sensors)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert figures == json.loads((folder / "firmware.json").read_text())
    flown = figures["flight"]
    assert (flown["waypoints_reached"], flown["final_mode"]) == (8, "arrived")
    assert figures["step_s"] == 0.009
    assert figures["bytes"]["left"] > 0
    assert bool(figures["compensation"]) == (name != "small")
    made = tomllib.loads((folder / "robot.toml").read_text())
    assert made["robot"]["length"]["value"] == pytest.approx(figures["acceptance_m"] * 2)
    assert "8 of 8 waypoints" in (folder / "README.md").read_text()
    if name == "small":  # 34.9 rad/s over 1024 counts are 34 + 21 / 256 mrad/s
        wiring = (folder / "include/rcx/board.h").read_text()
        assert "BOARD_GYRO = {512, 34, 21, false}" in wiring
        assert "120 counts a turn of the wheel. Forward counts up." in wiring
        again = subprocess.run(["sh", folder / "build.sh", ROOT], capture_output=True, text=True, check=False)
        assert again.returncode == 0, again.stderr
        for file in ("brickpilot.lx", "brickpilot.srec"):
            assert (folder / "image" / file).read_bytes() == (folder / file).read_bytes()


def test_robot_toml_makes_the_same_constants_again(tmp_path: Path) -> None:
    folder = tmp_path / "made"
    small = write(tmp_path, "small", OWN["small"])
    assert make(folder, small, "template", "--scenario", str(corner(tmp_path))).returncode == 0
    (once,) = re.findall(r"#ifndef BODY.*", (folder / "include/app/params_gen.h").read_text(), re.DOTALL)
    (again,) = re.findall(r"#ifndef BODY.*", header(folder / "robot.toml", 0.003), re.DOTALL)
    assert again == once

    done = subprocess.run(["make", "-s"], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    said = subprocess.run([folder / "brickpilot"], capture_output=True, text=True, timeout=20, check=False).stdout
    assert "hal_motors_write: not done yet" in said
    assert "wait_for_tick: not done yet" in said


def test_a_mission_that_is_not_flown_is_told_and_its_folder_stays(tmp_path: Path) -> None:
    path = tmp_path / "short.toml"
    path.write_text(model.render(dataclasses.replace(model.rcx(), name="short")))
    far = route(tmp_path, 6.0, (1.0, 0.0), (9.0, 0.0))
    done = make(tmp_path / "made", path, "template", "--scenario", str(far))
    assert done.returncode == 1
    assert re.fullmatch(r"brickpilot: short: 1 of 2 waypoints reached: waypoint 2 was missed by .*\n", done.stderr)
    assert json.loads((tmp_path / "made/firmware.json").read_text())["flight"]["waypoints_reached"] == 1
    assert "was not flown" in (tmp_path / "made/README.md").read_text()
