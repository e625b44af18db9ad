"""The firmware's constants are exact up to small rounding and cannot overflow. The generated files are up to date."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from brickpilot.firmware import params_header
from brickpilot.gen import value_headers
from brickpilot.gen.__main__ import generate, stale, wrong_generator
from brickpilot.vehicle.coefficients import (
    CURRENT,
    PROFILES,
    VOLTAGE,
    WHEEL_SPEED,
    Coefficients,
    motor_step,
    paper,
)
from brickpilot.vehicle.combinations import difference_inertia, loss, mean_inertia
from brickpilot.vehicle.fixed_point import QuantisationError, Scale, integer, scale, scale16
from brickpilot.vehicle.settings import settings
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[2]
VEHICLE = tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text(encoding="utf-8"))
NOMINAL = {name: float(entry["value"]) for name, entry in VEHICLE["parameters"].items()}
STEP = 0.003


def perturbed(seed: int) -> dict[str, float]:
    draw = random.Random(seed)
    return {name: value * draw.uniform(0.75, 1.25) for name, value in NOMINAL.items()}


def integrate(
    values: dict[str, float], inertia: float, start: tuple[float, float], voltage: float, torque: float
) -> NDArray[np.float64]:
    """Integrates eq. 12 and 14 of the paper over one step; returns current, A, and wheel speed, rad/s, at its end."""

    def rates(_: float, state: NDArray[np.float64]) -> list[float]:
        current, speed = state
        rise = (voltage - values["resistance"] * current - values["emf_constant"] * speed) / values["inductance"]
        rolling = values["mass"] * values["gravity"] * values["rolling_friction"] * values["wheel_radius"] * abs(speed)
        drag = values["viscous_friction"] * speed + np.sign(speed) * rolling * values["wheel_radius"]
        return [rise, (values["torque_constant"] * current - drag + torque) / inertia]

    end = solve_ivp(rates, (0, STEP), start, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    return np.asarray(end, dtype=np.float64)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("inertia_of", [mean_inertia, difference_inertia, lambda values: values["wheel_inertia"]])
def test_a_step_is_what_the_differential_equation_gives(seed: int, inertia_of) -> None:  # type: ignore[no-untyped-def]
    values, draw = perturbed(seed), random.Random(seed + 100)
    inertia = inertia_of(values)
    start = (draw.uniform(-0.5, 0.5), draw.uniform(10, 30))
    voltage, torque = draw.uniform(-9, 9), draw.uniform(-0.01, 0.01)
    exact = motor_step(values, inertia, STEP)
    found = exact.transition @ start + exact.voltage * voltage + exact.torque * torque
    np.testing.assert_allclose(found, integrate(values, inertia, start, voltage, torque), rtol=1e-7, atol=1e-9)


def steady(motor: dict[str, dict[str, Scale]]) -> float:
    """Returns the steady-state wheel speed per voltage, rad/(s V), of a motor with rounded coefficients."""
    m = np.array(
        [
            [motor["current"]["from_current"].factor - 1, motor["current"]["from_speed"].factor],
            [motor["speed"]["from_current"].factor, motor["speed"]["from_speed"].factor],
        ]
    )
    drive = np.array([motor["current"]["from_voltage"].factor16, motor["speed"]["from_voltage"].factor16])
    current, speed = np.linalg.solve(m, -drive * VOLTAGE)
    assert current / CURRENT < 1
    return float(speed / WHEEL_SPEED)


@pytest.mark.parametrize("seed", range(8))
def test_rounded_coefficients_keep_the_steady_speed(seed: int) -> None:
    values = perturbed(seed)
    wanted = 1 / (values["emf_constant"] + values["resistance"] * loss(values) / values["torque_constant"])
    coefficients: Coefficients = paper(values, STEP)
    motor = coefficients["motor"]
    assert isinstance(motor, list)
    assert steady(motor[0]) == pytest.approx(wanted, rel=2e-4)


@pytest.mark.parametrize("value", [0.999, -0.5, 0.5, 0.50001, 1e-3, -3.3e-7, 0.0])
def test_a_scale_is_right_to_its_last_bit(value: float) -> None:
    assert scale(value, "x").factor == pytest.approx(value, rel=3.1e-5)
    assert scale16(value * 1000, "x").factor16 == pytest.approx(value * 1000, rel=3.1e-5)


@pytest.mark.parametrize("value", [1.0, -1.0, 3.0])
def test_a_scale_of_one_or_more_is_refused(value: float) -> None:
    with pytest.raises(QuantisationError, match="not below 1"):
        scale(value, "x")


def test_a_scale_that_moves_no_count_is_zero_and_the_next_larger_is_right() -> None:
    least = 2.0**-32  # a scale that makes half a count of 2^31 counts
    for value in (1.234e-13, -0.99 * least):
        assert scale(value, "x") == Scale(0, 0)
    for value in (1.01 * least, -1.3 * least):
        assert scale(value, "x").factor == pytest.approx(value, rel=3.1e-5)


def test_an_integer_outside_its_field_or_lost_is_refused() -> None:
    assert integer(12.4, 0, 20, "x") == 12
    for value in (20.6, -1.0, 0.2):
        with pytest.raises(QuantisationError):
            integer(value, 0, 20, "x")


@pytest.mark.parametrize(
    ("profile", "parameter", "value"),
    [
        ("paper", "resistance", 0.5),
        ("coupled", "wheel_radius", 0.2),
        ("coupled", "half_track", 0.005),
        ("coupled", "drag_area", 300.0),
        ("paper", "mass", 0.001),
        ("paper", "wheel_inertia", 1e-7),
    ],
)
def test_a_vehicle_that_could_overflow_is_refused(profile: str, parameter: str, value: float) -> None:
    with pytest.raises(QuantisationError):
        PROFILES[profile]({**NOMINAL, parameter: value}, STEP)


def test_perturbed_vehicles_differ_from_the_nominal_one_in_every_free_parameter() -> None:
    nominal, *others = value_headers.value_sets(NOMINAL)
    assert nominal == NOMINAL
    for values in others:
        same = {name for name in NOMINAL if values[name] == NOMINAL[name]}
        assert same == set(value_headers.FIXED)


def test_a_gain_that_its_field_cannot_hold_is_refused() -> None:
    vehicle = tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text(encoding="utf-8"))
    vehicle["controller"]["coupled"]["speed_kp"]["value"] = 600.0
    with pytest.raises(QuantisationError, match="speed_kp"):
        params_header.render(vehicle, settings())


def test_a_watchdog_that_allows_what_no_step_integrates_is_refused() -> None:
    vehicle = tomllib.loads((ROOT / "sim_host/models/rcx.toml").read_text(encoding="utf-8"))
    watchdog = vehicle["controller"]["coupled"]["watchdog_time"]
    watchdog["value"] = 0.02
    params_header.render(vehicle, settings())
    watchdog["value"] = 0.021
    with pytest.raises(QuantisationError, match="watchdog_time"):
        params_header.render(vehicle, settings())
    (longest,) = re.findall(r"LONGEST_MS = (\d+)", (ROOT / "firmware/app/loop.c").read_text(encoding="utf-8"))
    assert int(longest) == params_header.LONGEST_STEP_MS


def test_generated_files_are_fresh() -> None:
    assert stale(generate(ROOT)) == []


def test_check_finds_a_file_that_was_edited(tmp_path: Path) -> None:
    inputs = [ROOT / "sim_host/models/rcx.toml", ROOT / "hal/wire/settings.toml", ROOT / "hal/h8sim/states.toml"]
    for path in (*inputs, *generate(ROOT)):
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    command = [sys.executable, "-m", "brickpilot.gen", "--check"]
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0
    params = tmp_path / "firmware/app/params_gen.h"
    params.write_text(params.read_text(encoding="utf-8").replace("BODY_PAPER", "BODY_COUPLED"), encoding="utf-8")
    result = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stdout.startswith("firmware/app/params_gen.h")
    subprocess.run(command[:-1], cwd=tmp_path, check=True, capture_output=True)
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0


def test_another_generator_is_refused_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    assert wrong_generator() is None
    installed = metadata.version("cantools")
    monkeypatch.setattr(metadata, "version", lambda _: "1.0")
    assert (
        wrong_generator()
        == f"needs cantools=={installed}, and 1.0 is installed: .venv/bin/pip install cantools=={installed}"
    )
