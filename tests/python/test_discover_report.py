"""The page of discovery shows the contents of its finding."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.data.gap import Gap
from brickpilot.discover.finding import Effect, Experiment, Parameter
from brickpilot.report import composed_law
from brickpilot.report.discover_page import page
from brickpilot.report.discover_runs import compared_signals, telling_figures
from brickpilot.report.discover_text import either, explanation_lines, verdict, words
from brickpilot.report.quantities import quantity
from brickpilot.vehicle.model import unit_on
from brickpilot.vehicle.replay import Replay
from findings import (
    COMMAND,
    DASH,
    DEADBAND,
    DIFFERS,
    FRICTION,
    HELD,
    MINUS,
    NOISE,
    RAMP,
    RANKING,
    ROLES,
    TERM,
    TRUTH,
    VERDICTS,
    Page,
    all_verdicts,
)
from pages import assert_self_contained, figures
from synthetic import motor, robot, write


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return all_verdicts(tmp_path_factory.mktemp("report") / "set")


@pytest.mark.parametrize("kind", VERDICTS)
def test_the_page_is_well_formed_and_self_contained(found, kind):
    html = page(found[kind], COMMAND)
    read = Page(html)
    ids = [attributes["id"] for _, attributes in read.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {link["href"].removeprefix("#") for link in read.all("a")} <= set(ids)
    assert_self_contained(html)
    assert read.all("html")[0]["lang"] == "en"


@pytest.mark.parametrize("kind", VERDICTS)
def test_figures_and_tables_have_accessible_names(found, kind):
    read = Page(page(found[kind], COMMAND))
    assert all(svg.get("aria-hidden") == "true" for svg in read.all("svg"))
    plots = [one for one in read.all("div") if one.get("class") == "plot"]
    assert len(plots) > 10
    assert all(one["role"] == "group" and len(one["aria-label"]) > 20 for one in plots)
    assert all(cell.get("scope") in ("col", "row") for cell in read.all("th"))
    assert len(read.all("caption")) == len(read.all("table")) > 4
    assert all(region["aria-label"] and region["tabindex"] == "0" for region in read.all("div") if "tabindex" in region)
    assert len(read.all("summary")) == len(read.all("details"))
    named = {section["aria-labelledby"] for section in read.all("section")}
    assert named <= {heading.get("id") for heading in read.all("h2")}


def test_a_named_effect_is_given_with_its_size_and_its_validation(found):
    made = dataclasses.replace(found["named"], gap={"fit": Gap(26.1, 1.02), "held_out": Gap(24.8, 1.03)})
    assert verdict(made).replace("\N{NO-BREAK SPACE}", " ") == (
        "The simulator lacks dry friction at the wheels (coulomb_friction), 6.1 mN m (5.8 to 6.4). With it, the gap "
        "on the held-out runs falls from 24.8 to 1.03 times the noise."
    )


def test_values_that_were_not_stated_are_shown_as_fitted(found):
    basis = {"mass": "fitted to bench-7: data", "half_track": "fitted to bench-7: not narrowed by the data"}
    basis |= {"wheel_radius": "fitted to bench-7: prior alone", "resistance": "fitted to bench-7: data and prior"}
    made = dataclasses.replace(found["named"], augmented=dataclasses.replace(TRUTH, basis=basis))
    read = Page(page(made, COMMAND))
    assert read.row("mass") == ["mass", "not stated", "0.900 kg", "", "", "determine it"]
    assert read.row("half track") == ["half track", "not stated", "70.0 mm", "", "", "do not determine it"]
    assert read.row("wheel radius")[-1] == "do not determine it"
    assert read.row("resistance")[-1] == "contradict it"


def test_two_effects_are_both_named(found):
    bias = Effect(
        "gyro_bias",
        "sensor",
        "gyro_bias",
        "sensor",
        0.9,
        {"bias": Parameter(0.0213, "rad/s", (0.0201, 0.0225))},
    )
    sentence = verdict(dataclasses.replace(found["named"], effects=(FRICTION, bias))).replace("\N{NO-BREAK SPACE}", " ")
    assert sentence.startswith(
        "The simulator lacks two effects: dry friction at the wheels (coulomb_friction), 6.1 mN m"
    )
    assert "and an offset of the gyro (gyro_bias), 21.3 mrad/s (20.1 to 22.5). With them, the gap" in sentence


def test_ambiguous_names_every_rival_and_the_next_experiment(found):
    sentence = verdict(found["ambiguous"])
    assert (
        "these data do not decide between three explanations: dry friction at the wheels (coulomb_friction), a"
        in sentence
    )
    assert "(rolling_sqrt) with an offset of the gyro (gyro_bias)." in sentence
    assert sentence.endswith("Drive a slow ramp.")


def test_rivals_of_one_mechanism_say_it_first(found):
    one = found["ambiguous"]
    friction = dataclasses.replace(FRICTION, equivalents=(dataclasses.replace(DEADBAND, name="rolling_sqrt"),))
    said = verdict(dataclasses.replace(one, effects=(friction,)))
    assert said.startswith("The cause is in the bearing, and these data do not decide between two explanations: dry")
    assert verdict(one).startswith("An effect is missing, and these data do not decide between three explanations")


def test_the_page_says_how_the_verdict_came_about(found):
    html = page(found["named"], COMMAND)
    assert "<li><code>weigh</code>: named. The evidence &lt;b&gt;says&lt;/b&gt; so.</li>" in html


def test_the_explanations_that_hold_the_weight_are_a_table(found):
    for kind, held in HELD.items():
        read = Page(page(found[kind], COMMAND))
        rows = [row for row in map(read._clean, read.rows) if len(row) == 4 and row[0].endswith("%")]
        assert [row[:2] for row in rows] == [
            [f"{100 * one.weight:.0f} %", " + ".join(one.effects) or "no effect"] for one in held
        ]
    read = Page(page(found["ambiguous"], COMMAND))
    assert read.row("11 %")[1:] == [
        "rolling_sqrt + gyro_bias",
        f"{words('rolling_sqrt')} with an offset of the gyro",
        "bearing, sensor",
    ]
    head, *lines = explanation_lines(found["ambiguous"])
    assert "95 % of the weight" in head
    assert lines[0].split(maxsplit=2) == ["61", "%", "coulomb_friction (bearing)"]
    assert explanation_lines(found["named"]) == []


def test_what_a_black_box_still_predicts_is_told(found):
    text = Page(page(found["unknown"], COMMAND)).sections["left"]
    assert "Of the squared error that the best explanation leaves, a black box predicts 31 % of yaw rate" in text
    left = dataclasses.replace(found["unknown"], term=None, effects=(dataclasses.replace(FRICTION, claimed=False),))
    said = verdict(left).replace("\N{NO-BREAK SPACE}", " ")
    assert "A black box still predicts 31 % of what is left of yaw rate." in said


def test_a_verdict_of_values_of_runs_alone_names_them(found):
    made = dataclasses.replace(found["named"], effects=(), run_values=(DIFFERS,))
    assert verdict(made).startswith(
        "What the simulator does not know is the voltage that reaches the motors that differs from run to run"
    )


def test_unknown_gives_the_equation_and_its_share(found):
    sentence = verdict(found["unknown"]).replace("\N{NO-BREAK SPACE}", " ")
    assert "no effect of the library explains it" in sentence
    assert f"ΔT = {MINUS}0.006 sgn(w), explains 92 % of the gap above the noise on the held-out runs" in sentence


def test_none_gives_the_gap_and_says_so_when_it_is_large(found):
    near = dataclasses.replace(found["none"], gap={"fit": Gap(1.0, 1.0), "held_out": Gap(1.02, 1.02)})
    assert "These data show no missing effect" in verdict(near)
    assert "1.02 times the noise" in verdict(near)
    far = dataclasses.replace(near, gap={"fit": Gap(3.0, 3.0), "held_out": Gap(3.1, 3.1)})
    assert verdict(far).startswith("No effect is named")


def test_without_held_out_runs_the_page_says_that_nothing_is_validated(found):
    made = dataclasses.replace(
        found["named"], roles=dict.fromkeys(ROLES, "fit"), gap={"fit": Gap(26.1, 1.02), "held_out": Gap(None, None)}
    )
    assert verdict(made).endswith("falls from 26.1 to 1.02 times the noise, and no held-out run confirms it.")
    read = Page(page(made, COMMAND))
    assert read.row("held-out runs") == ["held-out runs", DASH, DASH]
    assert 'role = "held_out"' in read.sections["proof"]


def test_the_numbers_are_those_of_the_finding(found):
    made = found["named"]
    read = Page(page(made, COMMAND))
    assert read.row("torque")[:5] == ["torque", "6.1", "5.8", "6.4", "mN m"]
    assert "99 %" in read.sections["verdict"]
    for role, label in (("fit", "fit runs"), ("held_out", "held-out runs")):
        assert [float(cell) for cell in read.row(label)[1:]] == pytest.approx(
            [made.gap[role].before, made.gap[role].after], rel=0.005
        )
    assert read.row("resistance")[1:5] == ["22 ± 1.1 Ω", "27.3 Ω", "+24.1", "+4.8"]
    assert "22.0 Ω, does not fit these data: the fit gives 27.3 Ω, which is 4.8 standard deviations away" in read.text
    assert read.row("wheel radius")[1:5] == ["40.8 ± 0.3 mm", "40.6 mm", f"{MINUS}0.5", f"{MINUS}0.7"]
    assert read.row("viscous friction")[1:3] == ["0 N m s/rad", "18.0 µN m s/rad"]
    assert read.row("spin", "yaw rate") == ["spin", "yaw rate", "0.20", "1.31", "turning", "44 %"]
    assert read.row("1") == ["1", "coulomb_friction", "torque 6.10 mN m", "1.02", "over 99 %", RANKING[0].why]
    assert read.row("2")[2:] == ["voltage 0.430 V", "2.90", "75 %", "It predicts worse by 812.0, where 3 is sure."]
    assert len([row for row in read.rows if row[-1].startswith("Not ")]) == 12
    assert read.row("battery_sag")[2:] == ["resistance", "0.410 Ω"]
    assert len([row for row in read.rows if row[2:3] == ["frozen"]]) == 23
    assert read.row("curve", "yaw rate", "frozen", "0.100") == ["curve", "yaw rate", "frozen", "0.100", "0.130"]
    assert "14 of 20 lags lie outside" in read.sections["left"]
    assert "seed 7" in read.sections["reproduce"]
    assert COMMAND in read.sections["reproduce"]


def test_the_map_holds_each_runs_error_in_each_signal(found):
    made = found["named"]
    read = Page(page(made, COMMAND))
    for run in made.dataset.runs:
        cells = read.row(run.name, "held-out run" if ROLES[run.name] == "held_out" else "fit run")[2:]
        for signal, cell in zip(NOISE, cells, strict=True):
            expected = []
            for which in ("nominal", "augmented"):
                error = run.outputs[signal] - made.simulated[which][run.name][signal]
                error = error - error[0] if signal == "wheel_travel_right" else error
                expected.append(np.sqrt(np.mean(error**2)) / NOISE[signal])
            assert [float(one) for one in cell.split(" → ")] == pytest.approx(expected, rel=0.005, abs=0.006)


def test_every_run_and_signal_is_drawn_once(found):
    for made in found.values():
        drawn = [title for title in figures(page(made, COMMAND)) if "measured and simulated, and" in title]
        assert len(drawn) == len(ROLES) * len(NOISE)


def test_a_position_is_compared_and_drawn_by_its_velocity(found, tmp_path):
    truth = motor(force_per_volt=30.0, mass=90.0, wheel_inertia=0.0, viscous_friction=200.0)
    axis = reading.read(write(tmp_path / "set", truth, {"position": 0.0}, "force_per_volt = 30.0"))
    simulated = dict(zip(("nominal", "augmented"), Replay(axis).simulate([truth, truth]), strict=True))
    made = dataclasses.replace(
        found["named"],
        dataset=axis,
        simulated=simulated,
        noise_sd={"velocity": 0.03},  # m/s, for speeds up to 0.9 m/s: large, as a derivative rounds corners off
        where=(),
        roles=dict.fromkeys(ROLES, "fit"),
        gap={"fit": Gap(None, None), "held_out": Gap(None, None)},
        by_signal={"velocity": Gap(None, None)},
    )
    read = Page(page(made, COMMAND))
    assert all(float(read.row(name, "fit run")[2].split(" → ")[1]) < 1.0 for name in ROLES)
    assert "the gap could not be measured" in read.sections["verdict"]


def test_each_signal_is_open_where_most_of_its_gap_was_removed_and_a_held_out_run(found):
    html = page(found["named"], COMMAND)
    shown = html[html.index('id="before-after"') : html.index("<details")]
    opened = re.findall(r'aria-label="(\w+), (fit run|held-out run): ([\w ]+) measured', shown)
    assert {signal for _, _, signal in opened} == {"yaw rate", "wheel speed left", "wheel travel right"}
    assert {role for _, role, _ in opened} == {"fit run", "held-out run"}


def test_the_experiment_is_drawn_with_its_voltages(found):
    read = Page(page(found["ambiguous"], COMMAND))
    points = [row for row in map(read._clean, read.rows) if row[0] in ("left", "right") and len(row) == 3]
    assert points == [
        *(["left", f"{t:g}", f"{v:g}"] for t, v in RAMP.voltage_left),
        *(["right", f"{t:g}", f"{v:g}"] for t, v in RAMP.voltage_right),
    ]
    assert "yaw rate differ by 14.2 times the noise (rms)" in read.sections["next"]
    assert read.row("a dead band of the drive around zero volts (actuator_deadband)")[1:] == ["voltage 0.430 V", "3.2"]


def test_an_experiment_without_a_manoeuvre_shows_its_advice_alone(found):
    asked = Experiment("Measure current_left as well.", ("gyro_bias", "gyro_drift"), 0.1, "current_left", None)
    read = Page(page(dataclasses.replace(found["ambiguous"], next_experiment=asked), COMMAND))
    assert "Measure current_left as well." in read.sections["next"]
    assert "the motor voltages" not in read.sections["next"]


def test_the_term_comes_with_its_equation_and_source(found):
    html = page(found["unknown"], COMMAND)
    assert composed_law.mathml(TERM.law, TERM.settings) in html
    assert composed_law.of_finding(found["unknown"])["composed_bench.c"] in Page(html).text


def test_text_of_the_data_cannot_become_markup(found):
    html = page(found["none"], COMMAND)
    assert "<script>alert" not in html
    assert "A note with <script>alert(1)</script> in it." in Page(html).text


def test_the_model_on_the_page_is_the_one_that_was_found(found):
    text = Page(page(found["named"], COMMAND)).sections["reproduce"]
    assert "[effects.coulomb_friction]" in text
    assert "torque = {value = 0.006," in text


def test_every_effect_of_the_library_has_words():
    assert [one.name for one in catalogue.effects() if words(one.name) == one.name.replace("_", " ")] == []


@pytest.mark.parametrize(
    ("value", "unit", "ci95", "shown"),
    [
        (0.0061, "N m", (0.0058, 0.0064), "6.1 mN m (5.8 to 6.4)"),
        (0.0061, "N m", (0.00595, 0.00625), "6.10 mN m (5.95 to 6.25)"),
        (95.109, "kg", (94.6, 95.7), "95.1 kg (94.6 to 95.7)"),
        (203.5, "N s/m", (180.0, 240.0), "200 N s/m (180 to 240)"),
        (-3.165, "N", None, f"{MINUS}3.17 N"),
        (0.0021, "kg m^2", None, "2.10 g m²"),
        (22.04, "ohm", None, "22.0 Ω"),
        (0.018, "m^2", None, "0.0180 m²"),
        (0.015, "s/m", None, "0.0150 s/m"),
        (0.1, "1", (0.08, 0.12), "0.10 (0.08 to 0.12)"),
        (12.5, "s", None, "12.5 s"),
        (0.0, "V", None, "0 V"),
        (0.2, "rad", (0.1, np.inf), "0.200 rad (0.100 to without limit)"),
    ],
)
def test_values_are_shown_in_handy_units_with_the_digits_they_deserve(value, unit, ci95, shown):
    assert str(quantity(value, unit, ci95)).replace("\N{NO-BREAK SPACE}", " ") == shown


@pytest.mark.parametrize(
    ("effect", "parameter", "unit"),
    [
        ("coulomb_friction", "torque", "N"),
        ("direction_asymmetry", "drag", "N s/m"),
        ("stiction_stribeck", "stribeck_speed", "m/s"),
        ("rolling_sqrt", "torque", "N"),
        ("gear_backlash", "gap", "m"),
        ("gear_backlash", "rotor_share", "1"),
        ("torque_ripple", "order", "rad/m"),
        ("torque_ripple", "phase", "rad"),
        ("battery_sag", "resistance", "ohm"),
    ],
)
def test_an_axis_that_is_driven_by_force_has_its_parameters_in_metres(effect, parameter, unit):
    info = next(one for one in catalogue.effects() if one.name == effect)
    info = next(one for one in info.parameters if one.name == parameter)
    assert unit_on(motor(force_per_volt=35.0), info) == unit
    assert unit_on(robot(), info) == info.unit


def test_twelve_long_runs_stay_below_three_megabytes(found):
    made = found["named"]
    base = made.dataset.runs[0]
    random, time = np.random.default_rng(0), np.arange(3300) * 0.003
    signals = ("accel_surge", "accel_sway", "yaw_rate", "wheel_speed_left", "wheel_speed_right")
    runs = tuple(
        dataclasses.replace(base, name=f"run_{k}", time=time, outputs={s: random.normal(size=3300) for s in signals})
        for k in range(12)
    )
    silent = {run.name: dict.fromkeys(signals, np.zeros(3300)) for run in runs}
    long = dataclasses.replace(
        made,
        dataset=dataclasses.replace(made.dataset, runs=runs),
        roles={run.name: "fit" for run in runs},
        simulated={"nominal": silent, "augmented": silent},
        noise_sd=dict.fromkeys(signals, 1.0),
        where=(),
        faults=(),
    )
    html = page(long, COMMAND)
    assert html.count("measured and simulated, and") == 60
    assert len(html.encode()) < 3e6


def test_a_moved_nominal_value_is_a_headline_of_its_own(found):
    said = verdict(found["none"]).replace("\N{NO-BREAK SPACE}", " ")
    assert "The data do not fit what is stated of resistance (27.3 Ω instead of 22.0 Ω, 5 standard deviations" in said
    assert said.endswith("Or they hide an effect: a load that it carries (payload_mass).")


def test_what_differs_from_run_to_run_has_a_sentence_and_a_table(found):
    made = dataclasses.replace(found["named"], run_values=(DIFFERS,))
    said = (
        "The voltage that reaches the motors differs from run to run: from -2.2 % (curve) to +2.2 % (spin) beside the "
        "value of the model."
    )
    assert said in verdict(made)
    html = page(made, COMMAND)
    assert html.count(said) == 2
    assert ["spin", "0.022 (0.018 to 0.026)"] in [Page._clean(row) for row in Page(html).rows]
    assert len(Page(html).all("table")) == len(Page(page(found["named"], COMMAND)).all("table")) + 1


@pytest.mark.parametrize(
    ("rivals", "says"),
    [
        (["coulomb_friction", "rolling_sqrt"], "dry friction {} or a rolling loss {}"),
        (["yaw_scrub + coulomb_friction", "yaw_scrub"], "{} (yaw_scrub), with dry friction {} or alone"),
        (
            ["yaw_scrub + coulomb_friction", "yaw_scrub + rolling_sqrt", "motor_asymmetry + yaw_scrub"],
            "{} (yaw_scrub), with dry friction {}, with a rolling loss {} or with {} (motor_asymmetry)",
        ),
    ],
)
def test_what_all_rivals_share_is_said_once(rivals, says):
    pattern = re.escape(says).replace(re.escape("{}"), ".*")
    assert re.fullmatch(pattern, either(rivals))
    assert all(either(rivals).count(f"({name})") == 1 for name in {*" + ".join(rivals).split(" + ")})


def test_the_open_figures_show_where_most_of_the_gap_was_removed(found):
    named = found["named"]
    removed = {key: one.gaps[0] ** 2 - one.gaps[1] ** 2 for key, one in compared_signals(named).items()}
    run, signal = max(removed, key=removed.get)
    assert (run, signal) != (named.where[0].run, named.where[0].signal)  # the law acts most elsewhere
    first = telling_figures(named, 1)[0]
    assert (first["run"], first["signal"].replace(" ", "_")) == (run, signal)
