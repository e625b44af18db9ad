"""The grey-box fit finds parameters, noises, and the equation that lacks something."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import dataset
from brickpilot.data.dataset import Dataset
from brickpilot.fit import parameters
from brickpilot.fit.deficient import Deficient, deficient_equations
from brickpilot.fit.explain import LoadOfRun, explanations
from brickpilot.fit.grey_box import fit_grey_box, fit_percent
from brickpilot.fit.innovations import Innovations
from brickpilot.fit.noise_sizes import Size, fit_noise, scales, start_noise
from brickpilot.vehicle.model import Model, with_values
from synthetic import motor, robot, write

R, KT, J, B = 22.0, 0.25, 5e-4, 1e-4
DECAY, TORQUE, NOISE = 0.3, 4e-3, 0.05  # s, N m, rad/s
STATED = f"""
resistance = {{ value = 24.0, sd = 2.4 }}
wheel_inertia = {{ value = 4.5e-4, sd = 5e-5 }}
torque_constant = {KT}
emf_constant = {KT}
viscous_friction = {B}
"""
DRIVE = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "yaw_rate": 0.014}


def with_process_noise(folder: Path, runs: int = 4, samples: int = 800) -> Dataset:
    """A motor with a torque that comes and goes, integrated with small steps of Euler and written to files."""
    random = np.random.default_rng(11)
    folder.mkdir()
    lines = ['name = "bench"', 'vehicle = "motor"', "[signals]", 'time = { column = "t", unit = "s" }']
    lines += ['voltage = { column = "v", unit = "V" }', 'speed = { column = "w", unit = "rad/s", noise_sd = 0.05 }']
    lines += ["[nominal]", STATED]
    dt, fine = 0.01, 20
    keep = np.exp(-dt / DECAY)
    for number in range(runs):
        volts = np.repeat(random.uniform(-8, 8, samples // 40), 40)
        speed, load, speeds = 0.0, TORQUE * random.normal(), []
        for volt in volts:
            speeds.append(speed)
            for _ in range(fine):
                speed += dt / fine * (KT / R * (volt - KT * speed) - B * speed + load) / J
            load = keep * load + TORQUE * (1 - keep**2) ** 0.5 * random.normal()
        noisy = np.array(speeds) + NOISE * random.normal(size=samples)
        rows = "\n".join(f"{dt * k:.6g},{volts[k]:.9g},{noisy[k]:.9g}" for k in range(samples))
        (folder / f"run_{number}.csv").write_text(f"t,v,w\n{rows}\n")
        lines += ["[[runs]]", f'name = "run_{number}"', f'file = "run_{number}.csv"', 'role = "fit"']
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n")
    return dataset.read(folder)


def innovations(data: Dataset, model: Model, step_s: float = 0.0) -> Innovations:
    return Innovations(data, model, [run.name for run in data.runs], step_s=step_s)


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return with_process_noise(tmp_path_factory.mktemp("grey") / "bench")


def test_parameters_and_noises_come_back_from_data_with_process_noise(disturbed: Dataset) -> None:
    plan = parameters.plan(disturbed)
    found = fit_grey_box(innovations(disturbed, plan.at(plan.start())), plan)
    truth = {"resistance": R, "wheel_inertia": J}
    for free, sd in zip(plan.free, found.sd, strict=True):
        error = np.log(parameters.value_of(found.model, free.name) / truth[free.name])
        assert abs(error) < 3 * sd
        assert 0.001 < sd < 0.05
    assert found.noise.of("lasting", "torque_left") == pytest.approx(TORQUE, rel=0.2)
    assert found.noise.decay_s == DECAY
    assert found.noise.of("noise", "speed") == pytest.approx(NOISE, rel=0.1)
    assert found.noise.of("drift", "speed") < 0.02


def test_a_short_horizon_fits_better_than_a_free_run_where_loads_come_and_go(disturbed: Dataset) -> None:
    plan = parameters.plan(disturbed)
    problem = innovations(disturbed, plan.at(plan.start()))
    truth = with_values(plan.model, {"resistance": R, "wheel_inertia": J})
    noise = fit_noise(problem, truth, start_noise(problem, truth))
    free, short = (fit_percent(problem, truth, noise, horizon)["speed"] for horizon in (0.0, 0.1))
    assert free < short < 100


def test_a_size_that_is_left_out_is_nothing_and_costs_likelihood(disturbed: Dataset) -> None:
    model = with_values(parameters.plan(disturbed).model, {"resistance": R, "wheel_inertia": J})
    problem = innovations(disturbed, model)
    full = fit_noise(problem, model, start_noise(problem, model))
    load = Size("lasting", "torque_left")
    assert load in scales(problem, model)
    without = fit_noise(problem, model, full, without=[load])
    assert without.of("lasting", "torque_left") == 0
    assert full.log_likelihood - without.log_likelihood > 100


def deficient(folder: Path, effects: Mapping[str, Mapping[str, float]]) -> tuple[Deficient, ...]:
    """Returns what the model without the effects lacks, on runs of the robot that has them."""
    truth = robot()
    with_effects = Model(truth.name, truth.vehicle, truth.profile, truth.parameters, effects)
    written = write(folder / "data", with_effects, DRIVE, "mass = 0.6")
    return deficient_equations(innovations(dataset.read(written), truth, 0.02), truth, 0.004)


def test_a_complete_model_lacks_nothing(tmp_path: Path) -> None:
    assert deficient(tmp_path, {}) == ()


def test_a_wrong_gyro_is_a_deficient_sensor_that_varies_with_the_turning(tmp_path: Path) -> None:
    first, *others = deficient(tmp_path, {"gyro_scale": {"error": 0.05}})
    assert first.equation == "sensor yaw_rate"
    assert first.unit == "rad/s"
    assert first.volts is None
    assert first.best[0].by == "turning"
    assert first.best[0].share > 0.6
    assert first.share > 0.8
    assert first.share + sum(one.share for one in others) == pytest.approx(1)


def test_scrub_is_a_deficient_yaw_equation_that_varies_with_the_turning(tmp_path: Path) -> None:
    first = deficient(tmp_path, {"yaw_scrub": {"moment": 0.02}})[0]
    assert first.equation == "yaw"
    assert first.unit == "N m"
    assert first.best[0].by in ("turning", "direction of turning")
    assert first.ci95 is not None
    assert first.ci95[0] < first.size < first.ci95[1]
    p = robot().parameters
    assert first.volts == pytest.approx(
        first.size * p["wheel_radius"] / (2 * p["half_track"]) * p["resistance"] / p["torque_constant"]
    )


def test_friction_is_a_deficient_motor_that_varies_with_its_direction(tmp_path: Path) -> None:
    truth = motor(wheel_inertia=J, resistance=R, torque_constant=KT, emf_constant=KT, viscous_friction=B)
    rubbing = Model("truth", "motor", "coupled", truth.parameters, {"coulomb_friction": {"torque": 0.006}})
    data = dataset.read(write(tmp_path / "data", rubbing, {"speed": 0.05}, STATED))
    (first, *_) = deficient_equations(innovations(data, truth, 0.02), truth, 0.004)
    assert first.equation == "motor"
    assert first.best[0].by == "direction of wheel speed"
    assert first.best[0].share > 0.6


def test_a_run_in_which_a_sensor_stands_still_is_predicted_without_it(tmp_path: Path) -> None:
    def freeze(run: str, table: dict[str, np.ndarray]) -> None:
        if run == "curve":
            table["yaw_rate"][:] = 0.5

    truth = robot()
    wrong = Model(truth.name, truth.vehicle, truth.profile, truth.parameters, {"gyro_scale": {"error": 0.05}})
    data = dataset.read(write(tmp_path / "data", wrong, DRIVE, "mass = 0.6", spoil=freeze))
    problem = innovations(data, truth, 0.02)
    assert ["yaw_rate" in one for one in problem.measured()] == [True, True, True, False]
    assert deficient_equations(problem, truth, 0.004)[0].equation == "sensor yaw_rate"


def test_explanations_prefer_the_plainer_quantity_and_time_only_across_runs() -> None:
    random = np.random.default_rng(3)

    def run(level: float) -> LoadOfRun:
        time = 0.03 * np.arange(400)
        speed = np.sin(time + level) * 5
        load = np.sign(speed) + level + 0.1 * random.normal(size=len(time))
        quantities = {
            "constant": 0 * time,
            "direction of wheel speed": np.sign(speed),
            "wheel speed": speed,
            "time since power-on": time + 12 * level,
        }
        return LoadOfRun(time, load, np.full(len(time), 0.1), quantities)

    first = explanations([run(0.0), run(0.0), run(0.0)])
    assert first[0].by == "direction of wheel speed"
    assert first[0].share > 0.9
    later = {one.by: one.share for one in explanations([run(-2.0), run(0.5), run(3.0)])}
    assert later["time since power-on"] < 0.5
