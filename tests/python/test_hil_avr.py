"""The image for AVR chips flies on simavr, through its own drivers."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from brickpilot.errors import InputError
from brickpilot.hil import avr_flight
from brickpilot.hil import fly as over_a_link
from brickpilot.hil.avr_flight import avr_image
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from command import brickpilot

ROOT = Path(__file__).parents[2]
TELEMETRY_EVERY = 10


def plan_of(sensors: str, seconds: float | None = None, seed: int = 0) -> flight.Plan:
    mission = scenario.load(scenario.packaged()["mission"])
    plan = flight.plan(mission, rcx(), profile="coupled", sensors=sensors, seed=seed)
    return plan if seconds is None else dataclasses.replace(plan, steps=round(seconds / 0.003))


def fly(target: str, seconds: float, trace: Path | None = None) -> over_a_link.HilFlight:
    plan = plan_of(AVR_TARGETS[target].sensors[0], seconds)
    image = avr_image(target)
    return avr_flight.fly(plan, target, image, telemetry_every=TELEMETRY_EVERY, progress=lambda *_: None, trace=trace)


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="module")
def begun() -> over_a_link.HilFlight:
    """The first 3 s of the mission."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return fly("avr:328p-imu", 3.0)


def test_the_papers_mission_is_flown_by_the_image_as_in_simulation(
    begun: over_a_link.HilFlight, tmp_path: Path
) -> None:
    """One whole flight: all 8 waypoints, the usual run folder, and the track of the simulation with these sensors.

    The tolerance is the spread of the simulation itself. Eight flights with different seeds of the noise differ by up
    to 0.06 m (rms over the flight), because the gyro's error adds up in the heading. The chip's noise differs like that
    of another seed, because the chip has its own converter and order of samples. The tolerance is 3 mm larger: the
    robot drives so far at 0.5 m/s in the 6 ms from a sample to the motor pulses that follow from the sample. The
    converter has the resolution of the simulation (10 bits), and the PWM has a resolution of 9 mV.
    """
    done = brickpilot("hil", "--target", "avr:328p-imu", "--sensors", "imu", "--out", str(tmp_path), "--json", cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert (figures["waypoints_reached"], figures["final_mode"], figures["fault"]) == (8, "arrived", "none")
    assert (figures["late_ticks"], figures["lost_frames"], figures["safe_stops"]) == (0, 0, 0)
    assert (figures["link"], figures["pace"]) == ("avr:328p-imu", "simulated time")
    page = (tmp_path / "report.html").read_text()
    assert "Flown over avr:328p-imu in simulated time" in page
    assert "No reply came" not in page
    assert figures["board"] == {"started_by": "power-on", "converter": 0, "edges": 0, "overruns": 0}
    assert "The board's newest start was by power-on." in page
    assert {file.name for file in tmp_path.iterdir()} == {"log.csv", "ticks.csv", "summary.json", "report.html"}

    log = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    track = np.stack([log["true_x_m"], log["true_y_m"]])
    simulated = [flight.fly(plan_of("imu", seed=seed)) for seed in range(8)]
    ways = [np.stack([one.log["true_x_m"], one.log["true_y_m"]])[:, : track.shape[1]] for one in simulated]
    spread = max(_apart(a, b) for a in ways for b in ways)
    assert spread < 0.06
    assert _apart(track, ways[0]) < spread + 0.003

    times = np.array([flight_figures.summary(one)["reached_at_s"] for one in simulated], dtype=float)
    late = np.array(figures["reached_at_s"]) - times.mean(axis=0)
    assert np.abs(late).max() < np.ptp(times, axis=0).max() + 0.006

    whole = np.stack([log["left_duty"], log["right_duty"]], axis=1)[: len(begun.flight.motors)]
    np.testing.assert_array_equal(begun.flight.motors, np.rint(whole * 32767))  # another process, the same duties
    _edges_are_those_of_the_wheels(begun)


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=0))))


def _edges_are_those_of_the_wheels(flown: over_a_link.HilFlight) -> None:
    """Checks the sensors' counts: the wheels' angle one motor step ago, rounded down, within 1 count."""
    log = flown.flight.log
    turned = np.cumsum(log["left_wheel_rad_s"]) * 0.003 * 48 / (2 * np.pi)
    assert turned.max() > 10
    assert np.abs(log["measured_left_counts"] - np.floor(turned)).max() <= 1


@pytest.mark.parametrize("target", ["avr:328p-rotation", "avr:2560", "avr:328p-mpu6050", "avr:328p-lsm6ds"])
def test_the_other_images_reach_their_first_waypoint(target: str) -> None:
    flown = fly(target, 5.5)
    figures = flight_figures.summary(flown.flight)
    assert (figures["waypoints_reached"], figures["fault"], flown.late_ticks, flown.lost_frames) == (1, "none", 0, 0)
    if AVR_TARGETS[target].sensors == ("imu+encoders",):
        _edges_are_those_of_the_wheels(flown)


def test_a_flight_repeats_itself_to_the_bit_and_its_signals_are_traced(
    begun: over_a_link.HilFlight, tmp_path: Path
) -> None:
    trace = tmp_path / "signals.vcd"
    traced = fly("avr:328p-imu", 1.5, trace)
    steps = len(traced.flight.motors)
    assert traced.flight.motors.tobytes() == begun.flight.motors[:steps].tobytes()
    for name, column in traced.flight.log.items():
        assert column.tobytes() == begun.flight.log[name][:steps].tobytes(), name
    for name, column in traced.ticks.items():
        assert column.tobytes() == begun.ticks[name][:steps].tobytes(), name
    text = trace.read_text()
    names = {line.split()[4]: line.split()[3] for line in text.splitlines() if line.startswith("$var")}
    assert {"left_pwm", "right_in2", "left_a", "gyro", "battery"} <= names.keys()
    rises = text.count(f"\n1{names['left_pwm']}\n")
    assert 0.4 * 15625 < rises < 0.6 * 15625 + 1  # pulses of 15.6 kHz in the half second in which the robot drives


def test_what_an_avr_cannot_do_is_said_in_one_line(tmp_path: Path) -> None:
    def line(*options: str) -> str:
        done = brickpilot("hil", "--target", "avr:328p-imu", *options, cwd=ROOT)
        assert (done.returncode, done.stdout) == (2, "")
        return done.stderr

    assert line("--sensors", "ideal") == "brickpilot: --sensors ideal: avr:328p-imu flies with imu\n"
    assert "has its own link" in line("--link", "tcp")
    assert "runs in lockstep only" in line("--realtime")
    assert "no recorded readings can be replayed" in line("--replay", "flight.log")
    assert "only flies" in line("--settings")
    assert "the image has the profile coupled alone" in line("--sensors", "imu", "--profile", "paper")
    assert "cannot be written" in line("--sensors", "imu", "--trace", str(tmp_path / "no" / "folder.vcd"))
    done = brickpilot("hil", "--link", "tcp", "--trace", "a.vcd", cwd=ROOT)
    assert (done.returncode, done.stderr) == (2, "brickpilot: --trace: needs --target avr, the only target with pins\n")


def test_an_image_that_is_none_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "image.elf"
    text.write_text("not an image")
    log, motors = np.zeros((1, 1)), np.zeros((1, 2), dtype=np.int16)
    with (
        pytest.raises(InputError, match=r"image.elf: is no image for an AVR: an ELF file is needed"),
        avr_flight.open_robot(plan_of("imu", 0.003), text, "atmega328p", log, motors),
    ):
        pass
    with (
        pytest.raises(InputError, match="simavr does not know the chip"),
        avr_flight.open_robot(plan_of("imu", 0.003), avr_image("avr:328p-imu"), "atmega9", log, motors),
    ):
        pass


def test_a_build_without_simavr_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise FileNotFoundError(name)

    monkeypatch.setattr("brickpilot.compiled.interface", missing)
    with pytest.raises(InputError, match=r"this build has no simavr: sudo apt-get install libsimavr-dev libelf-dev"):
        avr_flight.avr_interface()
