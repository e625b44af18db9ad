"""All commands give the same headline number, the explained share of a signal, for the same model and runs."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.data.agreement import Agreement, agreement, mean_fit, together
from brickpilot.discover.pipeline import discover
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.comparison import compare
from brickpilot.report import discover_page, discover_text, fit_pages, headline_text, notebook, why_text
from brickpilot.report.quantities import fit_text
from brickpilot.vehicle import compared_runs
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.plant import State
from command import brickpilot
from synthetic import motor, robot, write

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "accel_surge": 0.02}
STATED = """
mass = 0.9
yaw_inertia = 0.006
half_track = 0.07
wheel_radius = 0.0408
wheel_inertia = 1e-4
resistance = { value = 22.5, sd = 0.5 }
inductance = 0.0
torque_constant = { value = 0.195, sd = 0.004 }
emf_constant = { value = 0.245, sd = 0.005 }
viscous_friction = 1.8e-5
rolling_friction = 0.015
"""
MANOEUVRES = {
    f"{name}_{volts:g}": (left * volts, right * volts)
    for name, left, right in (("ahead", 1, 1), ("back", -1, -1), ("spin", 1, -1), ("curve", 1, 0.5))
    for volts in (3.0, 4.5, 6.0)
}
ROLES = ["fit", "held_out", "fit"] * 4


def test_it_is_the_share_of_the_signal_without_a_mean_removed():
    measured, simulated = np.array([3.0, 4.0, 5.0]), np.array([3.0, 4.0, 4.0])
    found = agreement(measured - simulated, measured)
    assert found.fit_percent == pytest.approx(100 * (1 - 1 / 50**0.5), abs=1e-3)
    assert found.r2 == pytest.approx(1 - 1 / 2, abs=1e-5)
    assert found.rms_error == pytest.approx(3**-0.5, rel=1e-5)
    assert agreement(measured, measured).fit_percent == 0.0
    assert agreement(0 * measured, measured).fit_percent == 100.0
    assert agreement(-4 * measured, measured).fit_percent == pytest.approx(-300.0)


def test_parts_of_a_signal_taken_together_are_the_whole():
    random = np.random.default_rng(1)
    measured, error = 7 + random.normal(size=60), random.normal(size=60)
    whole, parts = agreement(error, measured), [agreement(error[k::3], measured[k::3]) for k in range(3)]
    assert together(parts).to_json() == pytest.approx(whole.to_json())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("error", "signal", "noise_sd"),
    [
        (np.ones(3), np.zeros(3), 0.0),
        (np.ones(3), np.full(3, np.nan), 0.0),
        (np.ones(0), np.ones(0), 0.0),
        (np.full(3, 1e200), np.full(3, 1.0), 0.0),
        (np.ones(3), np.array([1.0, -1.0, 1.0]), 0.4),
    ],
)
def test_a_signal_that_is_zero_or_noise_has_no_number_and_never_nan(error, signal, noise_sd):
    found = agreement(error, signal, noise_sd=noise_sd)
    assert found.fit_percent is None
    assert found.r2 is None
    json.dumps(found.to_json(), allow_nan=False)


def test_the_mean_over_signals_leaves_out_those_without_a_number_and_the_battery():
    assert mean_fit({"yaw_rate": 90.0, "accel_sway": None, "speed": 80.0, "battery_voltage": 10.0}) == 85.0
    assert mean_fit({"yaw_rate": None}) is None


@pytest.fixture(scope="module", params=["robot", "parts", "motor"])
def data(request, tmp_path_factory):
    """Returns a data set: a robot with stated roles, a robot with parts of runs held out, or a motor with positions."""
    folder = tmp_path_factory.mktemp("headline") / request.param
    if request.param == "motor":
        truth = dataclasses.replace(
            motor(wheel_radius=0.02, wheel_inertia=1e-3), effects={"coulomb_friction": {"torque": 0.02}}
        )
        volts = {f"up_{k:g}": (k, 0.0) for k in (3.0, 4.0, 5.0, 6.0)} | {f"down_{k:g}": (-k, 0.0) for k in (3.0, 5.0)}
        stated = "wheel_radius = 0.02\nwheel_inertia = 1e-3\nresistance = { value = 22.0, sd = 0.5 }\n"
        return reading.read(
            write(folder, truth, {"position": 2e-4}, stated, manoeuvres=volts, roles=["fit", "fit", "held_out"] * 2)
        )
    truth = dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": 0.008}})
    start = State(surge=0.2, wheel_speed=(4.9, 4.9))
    runs = {"roles": ROLES, "manoeuvres": MANOEUVRES} if request.param == "robot" else {"roles": [""] * 4}
    return reading.read(write(folder, truth, NOISE, STATED, frame="FLU", start=start, **runs))


@pytest.fixture(scope="module")
def finding(data):
    return discover(data)


def numbers(found):
    """Returns role -> signal -> horizon -> (fit, R2, rms error) of a headline."""
    return {
        role: {
            signal: {
                horizon: (one.fit_percent, one.r2, one.rms_error)
                for horizon in ("free_run", "1_s")
                if (one := found.of(signal, role, horizon)).samples
            }
            for signal in found.signals
        }
        for role in ("fit", "held_out")
    }


def in_verdict(finding, which):
    """Returns the numbers as `numbers` does, but from verdict.json; `which` is "before" or "after"."""
    fits = json.loads(json.dumps(finding.yardstick.fit_json(), allow_nan=False))
    found = {"fit": {}, "held_out": {}}
    for signal, horizons in fits.items():
        for role in found:
            found[role][signal] = {}
            for horizon in ("free_run", "1_s"):
                one = horizons[horizon] if role == "fit" else horizons[horizon]["held_out"]
                found[role][signal][horizon] = (one[which], one["r2"][which], one["rms_error"][which])
    return found


def with_numbers(found):
    """Leaves out signals without a number: verdict.json has only null for these."""
    return {
        role: {signal: one for signal, one in by_signal.items() if one and one["free_run"][0] is not None}
        for role, by_signal in found.items()
    }


def test_compare_gives_the_numbers_of_discover_to_the_digit(data, finding, tmp_path):
    model_file.save(finding.augmented, tmp_path / "model.toml")
    written = model_file.load(tmp_path / "model.toml")
    for model, which in ((finding.nominal_model, "before"), (written, "after")):
        compared, told = with_numbers(numbers(compare(data, model).headline)), with_numbers(in_verdict(finding, which))
        assert compared == told
        assert all(len(one) >= (1 if data.vehicle == "motor" else 3) for one in told.values())


def test_compare_gives_the_numbers_of_calibrate_to_the_digit(data):
    fitted = calibrate(data)
    stated = compare(data, dataclasses.replace(fitted.model, parameters=start_of(data)))
    assert numbers(compare(data, fitted.model).headline) == numbers(fitted.after)
    assert numbers(stated.headline) == numbers(fitted.before)
    assert numbers(fitted.before) != numbers(fitted.after)


def start_of(data):
    from brickpilot.fit.parameters import plan

    chosen = plan(data)
    return chosen.at(chosen.start()).parameters


def test_another_start_of_the_runs_is_noticed(data, finding, monkeypatch):
    """Runs that start from their first sample alone have other numbers, so the comparison with discover can fail."""
    monkeypatch.setattr(compared_runs, "started", lambda measured, inputs: measured)
    one_sample = with_numbers(numbers(compare(data, finding.augmented).headline))
    assert one_sample != with_numbers(in_verdict(finding, "after"))


def test_terminal_pages_and_notebook_show_the_same_number(data, finding):
    compared = compare(data, finding.augmented)
    shown = fit_text(compared.headline.mean("held_out"))
    for text in (
        discover_text.verdict(finding),
        headline_text.sentence(compared.headline),
        discover_page.page(finding, "discover"),
        fit_pages.compare_page(compared),
        notebook.to_html(compared),
        notebook.to_html(finding),
        why_text.answer(finding, None).sure,
    ):
        assert shown in text.replace("&nbsp;", "\N{NO-BREAK SPACE}"), text[:2000]


def printed(*arguments, cwd):
    """Returns what a command prints; it has to succeed."""
    done = brickpilot(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_calibrate_and_compare_print_the_same(tmp_path):
    stated = "resistance = { value = 22.0, sd = 0.5 }\nwheel_inertia = { value = 2e-3, sd = 1e-3 }\n"
    volts = {"low": (3.0, 0.0), "back": (-5.0, 0.0), "high": (6.0, 0.0)}
    roles = ["fit", "fit", "held_out"]
    folder = write(tmp_path / "set", motor(), {"speed": 0.05}, stated, manoeuvres=volts, roles=roles)
    fitted = printed("calibrate", str(folder), "--out", "k", cwd=tmp_path)
    compared = printed("compare", str(folder), "--model", "k/model.toml", "--out", "c", cwd=tmp_path)
    said = re.search(r"The model explains .*", compared)[0]
    assert said in fitted
    for page in ("k", "c"):
        assert said in (tmp_path / page / "report.html").read_text()
    both = [json.loads((tmp_path / name).read_text())["headline"] for name in ("k/calibrate.json", "c/compare.json")]
    assert both[0]["after"] == both[1]


def test_nothing_is_compared_without_a_sample():
    assert together([]) == Agreement(0, 0.0, 0.0, 0.0, 0.0)
