"""Pages use the terms of the user's data set: its frame, signs, units and run times, and no wheels for a motor."""

from __future__ import annotations

import dataclasses
import html
import math
import re

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.data.audit.audit import Fault
from brickpilot.data.dataset import own_unit
from brickpilot.data.gap import Gap
from brickpilot.discover.finding import Effect, Parameter, Whiteness
from brickpilot.discover.pipeline import discover
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.comparison import compare
from brickpilot.fit.uncertainty import Combination
from brickpilot.report import (
    discover_page,
    discover_runs,
    discover_text,
    fit_pages,
    headline_text,
    plot,
    user_terms,
    why_page,
    why_text,
)
from brickpilot.vehicle import compensation
from findings import finding, measured
from synthetic import motor, robot, write

DEGREES = {"yaw_rate": ("deg/s", 180 / math.pi), "wheel_speed_left": ("rpm", 30 / math.pi)}
NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
BIAS = Effect("gyro_bias", "sensor", "gyro_bias", "sensor", 0.99, {"bias": Parameter(0.02, "rad/s", (0.018, 0.022))})
WHEELS = r"\b([Ww]heels?|[Rr]obots?|[Vv]ehicle|[Mm]ission|[Dd]riving)\b"


@pytest.fixture(scope="module")
def sets(tmp_path_factory):
    """Returns the same runs as two data sets: in the paper's frame and SI, and as ROS logs them: FLU, degrees, rpm."""
    folder = tmp_path_factory.mktemp("frames")
    ours = write(folder / "frd", robot(), NOISE, "")
    theirs = write(folder / "flu", robot(), NOISE, "", frame="FLU", units=DEGREES)
    return reading.read(ours), reading.read(theirs)


def words_of(page):
    """Returns the text of a page that a reader sees."""
    page = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", page, flags=re.S)
    return html.unescape(re.sub(r"<[^>]+>", " ", page)).replace("\N{NO-BREAK SPACE}", " ")


def test_a_signal_is_stated_as_its_file_states_it(sets):
    ours, theirs = sets
    assert own_unit(ours, "yaw_rate").value(1.0) == 1.0
    assert own_unit(theirs, "yaw_rate").value(1.0) == pytest.approx(-180 / math.pi)
    assert own_unit(theirs, "wheel_speed_left").value(1.0) == pytest.approx(30 / math.pi)
    column = np.genfromtxt(theirs.runs[2].file, delimiter=",", names=True)[str(theirs.signals["yaw_rate"].column)]
    np.testing.assert_allclose(own_unit(theirs, "yaw_rate").value(1.0) * theirs.runs[2].outputs["yaw_rate"], column)


def test_plots_show_the_values_of_the_file(sets, monkeypatch):
    """Every page draws the signal as the file has it; the residual has the same sign and unit."""
    _, theirs = sets
    drawn = []

    def seen(time, signal, unit, measured, simulated, *, run, **options):
        *_, (_, values) = simulated.values()
        drawn.append((run, signal, unit, time - time[0], measured, measured - values))
        return plot.Markup("")

    for page in (fit_pages, discover_runs):
        monkeypatch.setattr(page, "superimposed", seen)
    fit_pages.compare_page(compare(theirs, robot()))
    fit_pages.calibrate_page(calibrate(theirs, free=["resistance"]))
    made = dataclasses.replace(finding(theirs, "named"), noise_sd=NOISE)
    discover_runs.figures(made, discover_runs.compared_signals(made))
    runs = {run.name: run for run in theirs.runs}
    turned = [one for one in drawn if one[1] == "yaw rate" and one[0] == "spin"]
    assert len(turned) >= 3
    for name, _, unit, time, values, error in turned:
        assert unit == "deg/s"
        assert time[0] == 0.0
        np.testing.assert_allclose(values, -180 / math.pi * runs[name].outputs["yaw_rate"])
        assert np.nanstd(error) > 0.5 * 0.014 * 180 / math.pi


def test_numbers_have_the_unit_of_the_file_and_the_same_fit(sets):
    ours, theirs = (compare(one, robot(resistance=24.0)) for one in sets)
    assert theirs.headline.mean("fit") == pytest.approx(ours.headline.mean("fit"), abs=0.01)
    shown = "\n".join(headline_text.lines(theirs.headline, theirs.units))
    assert re.search(r"yaw_rate +\S+ +\S+ +\S+ deg/s", shown)
    assert re.search(r"wheel_speed_left +\S+ +\S+ +\S+ rpm", shown)
    assert "rad/s" not in re.findall(r"yaw_rate.*", shown)[0]


def test_an_effect_has_the_sign_and_unit_of_the_file(sets):
    said = []
    for data in sets:
        made = dataclasses.replace(finding(data, "named"), effects=(BIAS,), noise_sd=NOISE)
        said.append((discover_text.verdict(made), words_of(discover_page.page(made, "discover"))))
        assert made.effects[0].parameters["bias"].value == 0.02
    for text in said[0]:
        assert "20.0 mrad/s (18.0 to 22.0)" in text.replace("\N{NO-BREAK SPACE}", " ") or "20 mrad/s" in text.replace(
            "\N{NO-BREAK SPACE}", " "
        )
    for text in said[1]:
        plain = text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{MINUS SIGN}", "-")
        assert re.search(r"-1\.1\d? deg/s", plain), plain[:600]
    assert "FRD: x forward, y to the right, yaw clockwise positive" in said[0][1]
    assert "FLU: x forward, y to the left, yaw counter-clockwise positive" in said[1][1]


def test_every_page_states_the_frame(sets):
    _, theirs = sets
    made = finding(theirs, "named")
    answer, constants = why_text.answer(made, compensation.from_model(made.augmented)), why_page.constants_of(made)
    for page in (
        why_page.page(why_page.Why(made, answer, constants, ()), source="a log", files=[], command="why"),
        discover_page.page(made, "discover"),
        fit_pages.compare_page(compare(theirs, robot())),
        fit_pages.calibrate_page(calibrate(theirs, free=["resistance"])),
    ):
        assert "FLU: x forward, y to the left, yaw counter-clockwise positive" in words_of(page)


def test_times_count_from_the_start_of_a_run(tmp_path):
    """The log's clock starts at 1000 s; the table and the note on a fault count from the start of the run."""
    data = measured(tmp_path / "set")
    late = tuple(dataclasses.replace(run, time=run.time + 1000.0) for run in data.runs)
    data = dataclasses.replace(data, runs=late)
    made = dataclasses.replace(
        finding(data, "named"), faults=(Fault("curve", "yaw_rate", "frozen", 1000.25, 1000.5),), where=()
    )
    text = words_of(discover_page.page(made, "discover"))
    assert re.search(r"curve\s+yaw rate\s+frozen\s+0\.250\s+0\.500", text)
    assert "1000.25" not in text


def test_no_word_says_noise_beside_a_large_remainder(tmp_path):
    made = finding(measured(tmp_path / "set"), "none")
    white = {name: Whiteness(0.03, (0.01, -0.02), 0.05, True) for name in made.by_signal}
    far = {"fit": Gap(9.0, 9.0), "held_out": Gap(9.0, 9.0)}
    large = dataclasses.replace(
        made, whiteness=white, gap=far, by_signal=dict.fromkeys(made.by_signal, Gap(9.0, 9.0)), nominal_findings=()
    )
    small = dataclasses.replace(
        large, gap={"fit": Gap(1.0, 1.0), "held_out": Gap(1.0, 1.0)}, by_signal=dict.fromkeys(white, Gap(1.0, 1.0))
    )
    quiet = r"is white|: white|as small as the noise|Nothing is wrong|does what the robot does|does what the simulation"
    for one, says in ((large, False), (small, True)):
        answer, constants = why_text.answer(one, None), why_page.constants_of(one)
        pages = [
            discover_page.page(one, "discover"),
            why_page.page(why_page.Why(one, answer, constants, ()), source="a log", files=[], command="why"),
        ]
        for page in pages:
            assert bool(re.search(quiet, words_of(page).replace(" : ", ": "))) is says, re.findall(
                quiet, words_of(page)
            )


@pytest.fixture(scope="module")
def of_a_motor(tmp_path_factory):
    """Returns the finding for a motor of unknown resistance: the size of its dry friction is known only in volts."""
    truth = dataclasses.replace(motor(), effects={"coulomb_friction": {"torque": 0.02}})
    volts = {f"up_{k:g}": (k, 0.0) for k in (3.0, 4.0, 5.0, 6.0)} | {
        f"down_{k:g}": (-k, 0.0) for k in (3.0, 4.0, 5.0, 6.0)
    }
    folder = tmp_path_factory.mktemp("motor") / "set"
    return discover(
        reading.read(write(folder, truth, {"speed": 0.03}, "", manoeuvres=volts, roles=["fit", "held_out"] * 4))
    )


def test_pages_of_a_motor_speak_of_no_wheels(of_a_motor):
    found = of_a_motor
    assert [one.name for one in found.effects][:1] == ["coulomb_friction"]
    answer, constants = why_text.answer(found, None), why_page.constants_of(found)
    texts = [
        discover_text.verdict(found),
        *(answer.what, answer.sure, answer.todo, answer.symptoms),
        words_of(
            why_page.page(
                why_page.Why(found, answer, constants, ()), source="a log", files=["verdict.json"], command="why"
            )
        ),
        words_of(discover_page.page(found, "discover")).partition("How to reproduce")[0],
        words_of(fit_pages.compare_page(compare(found.dataset, found.augmented))),
        *why_page.files_of("rig", constants).values(),
    ]
    for text in texts:
        text = " ".join(text) if isinstance(text, tuple) else text
        assert not re.search(WHEELS, text), re.search(rf".*{WHEELS}.*", text)[0]
    assert "dry friction at the shaft" in discover_text.verdict(found)
    assert list(why_page.files_of("rig", constants)) == ["motor_constants.h"]


def test_names_that_the_user_gave_stay(of_a_motor):
    shown = user_terms.told(
        of_a_motor.dataset, {"run": "wheel test", "words": "play at the wheels", "code": "wheel_radius"}
    )
    assert shown == {"run": "wheel test", "words": "play at the shaft", "code": "wheel_radius"}


def test_a_size_known_in_volts_is_said_in_volts():
    known = Combination("voltage", "torque R / K_t", "V", 0.61, (0.58, 0.64))
    label, shown = discover_text.known_size("torque", Parameter(0.01, "N m", None, known))
    assert (label, shown.unit, shown.ci95) == ("torque, as voltage", "V", (0.58, 0.64))
    label, shown = discover_text.known_size("torque", Parameter(0.01, "N m", (0.009, 0.011), known))
    assert (label, shown.unit) == ("torque", "N m")
