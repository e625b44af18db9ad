"""`why` answers the log of an engine other than the plant with the weak side and its size, nothing, or advice."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
import tomllib
from pathlib import Path

import brickpilot as bp
import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data.audit.wiring_motion import Miswired
from brickpilot.data.facts import weaker_side
from brickpilot.data.gap import Gap
from brickpilot.report import discover_text, why_text
from brickpilot.report.quantities import in_words
from brickpilot.vehicle.manoeuvres import Manoeuvre
from command import brickpilot
from findings import RAMP, finding, measured
from hidden.manoeuvre import steps
from miswired_logs import ROBOTS
from new_users_logs import FOUR, MANY, STRAIGHT, WEAK_RIGHT, rewire, stated, write_log

WEAK_LEFT = {"motor_asymmetry": {"difference": -WEAK_RIGHT["motor_asymmetry"]["difference"]}}
PERCENT = r"(\d+(?:\.\d+)?)\s%"


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def said_of(folder: Path, robot: str, hidden: dict[str, dict[str, float]]) -> list[str]:
    """Writes the log of one straight run into `folder`, and returns the lines that `why` prints about it."""
    write_log(folder / "log.csv", robot, STRAIGHT, hidden)
    said = brickpilot("why", "log.csv", "--out", "found", cwd=folder)
    assert said.returncode == 0, said.stderr
    return plain(said.stdout).splitlines()


@pytest.fixture(scope="module")
def weak_right(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """Returns the folder of one straight run with a weak right motor, and the lines of `why` about this run."""
    folder = tmp_path_factory.mktemp("weak_right")
    return folder, said_of(folder, "mujoco", WEAK_RIGHT)


@pytest.mark.parametrize(("side", "other"), [("right", "left"), ("left", "right")])
def test_one_straight_run_tells_the_side_and_the_size_and_what_it_cannot(
    side: str, other: str, weak_right: tuple[Path, list[str]], tmp_path: Path
) -> None:
    folder, lines = weak_right if side == "right" else (tmp_path, said_of(tmp_path, "planar", WEAK_LEFT))
    assert len(lines) <= 5
    found = re.match(
        rf"what is wrong: The {side} side is {PERCENT} weaker than the {other} \({PERCENT[:-3]} to", lines[0]
    )
    assert found, lines[0]
    assert float(found[1]) == pytest.approx(12.0, abs=0.5)
    assert "cannot tell whether its motor, its drive, friction or a wheel's radius is the cause" in lines[0]
    assert lines[2].startswith("what to do:    Drive ")
    assert (folder / "found/next_experiment.toml").exists()
    page = (folder / "found/why.html").read_text()
    assert f"It turns to the {side} when it is to drive straight." in page


@pytest.mark.parametrize(("robot", "mismatch", "side"), [("mujoco", 0.1, "right"), ("planar", -0.05, "left")])
def test_one_straight_run_on_a_smaller_wheel_tells_the_bend_and_names_no_motor(
    robot: str, mismatch: float, side: str, tmp_path: Path
) -> None:
    """Under equal commands the wheels turn alike, the smaller one a little more: no side is weaker."""
    write_log(tmp_path / "log.csv", robot, STRAIGHT, {"wheel_radius_mismatch": {"mismatch": mismatch}})
    known = ROBOTS[robot]
    nominal = {"wheel_radius": known.wheel_radius, "half_track": known.half_track, "battery_voltage": 9.0}
    found = bp.why(tmp_path / "log.csv", nominal=nominal).answer
    said = re.match(
        rf"Under equal commands the path bends ([\d.]+)° a metre to the {side} .*, and the wheels turn alike.*: "
        rf"the {side} wheel goes {PERCENT} less far. Straight runs cannot tell whether a wheel's radius, a motor, ",
        plain(found.what),
    )
    assert said, found.what
    assert float(said[1]) == pytest.approx(math.degrees(abs(mismatch) / (2 * known.half_track)), rel=0.1)
    assert float(said[2]) == pytest.approx(100 * abs(mismatch), abs=1.0)
    assert "weaker" not in found.what
    assert found.ending == "missing"
    assert found.todo[0].startswith("Drive ")
    assert found.symptoms == (f"It turns to the {side} when it is to drive straight.",)


def test_a_gyro_that_the_wheels_contradict_is_not_nothing(tmp_path: Path) -> None:
    """The fit explains the gyro by another wheel_radius and half_track, each within a ruler's error."""
    write_log(tmp_path / "log.csv", "planar", FOUR, {"gyro_scale": {"error": 0.05}})
    nominal = {name: getattr(ROBOTS["planar"], name) for name in ("wheel_radius", "half_track", "mass", "resistance")}
    answered = bp.why(tmp_path / "log.csv", nominal={**nominal, "battery_voltage": 9.0})
    found = answered.answer
    assert found.ending == "contradiction", found.what
    assert found.what in discover_text.verdict(answered.finding)  # `discover` says the same
    said = re.match(
        rf"These data contradict themselves: the gyro turns {PERCENT} more than the wheels do \(", found.what
    )
    assert said, found.what
    assert float(said[1]) == pytest.approx(5.0, abs=0.05)
    assert "Its scale, the counts a turn, wheel_radius or half_track is wrong by as much" in found.what
    assert found.todo[0].startswith("Turn the robot by a known angle")


def test_straight_runs_without_a_fault_ask_for_a_turn(tmp_path: Path) -> None:
    """A wrong scale of the gyro shows only in turns."""
    write_log(tmp_path / "log.csv", "mujoco", STRAIGHT, {"gyro_scale": {"error": 0.05}})
    nominal = {name: getattr(ROBOTS["mujoco"], name) for name in ("wheel_radius", "half_track", "mass", "resistance")}
    found = bp.why(tmp_path / "log.csv", nominal={**nominal, "battery_voltage": 9.0}, out=tmp_path / "found").answer
    assert found.ending == "nothing"
    assert "as far as straight runs show" in found.what
    assert found.todo[0].startswith("Drive ")
    assert "What shows in turns alone, such as the gyro's scale or slip, was not tested." in found.todo
    driven = tomllib.loads((tmp_path / "found/next_experiment.toml").read_text())
    assert any(one["left_V"] != one["right_V"] for one in driven["segments"])


def test_one_run_two_runs_and_all_give_one_answer_that_gets_surer(
    weak_right: tuple[Path, list[str]], tmp_path: Path
) -> None:
    folder, lines = weak_right
    write_log(tmp_path / "b.csv", "mujoco", (steps("more", 5.0, (0.5, 3.5, 3.5), (4.0, 0, 0)),), WEAK_RIGHT, seed=2)
    write_log(tmp_path / "c.csv", "mujoco", FOUR, WEAK_RIGHT, seed=3)
    logs, widths = [folder / "log.csv", tmp_path / "b.csv", tmp_path / "c.csv"], []
    more = [bp.why(logs[:count]).answer for count in (2, 3)]
    for what in (lines[0].removeprefix("what is wrong: "), *(plain(one.what) for one in more)):
        assert re.match(rf"The right (side|motor) is {PERCENT} weaker than the left", what), what
        low, high = (float(one) for one in re.search(r"\(([\d.]+) to ([\d.]+) %\)", what).groups())  # type: ignore[union-attr]
        assert low <= 12.3
        assert high >= 11.7
        widths.append(high - low)
    assert "the right motor" in what.lower()
    assert any(one.startswith("Swap the plugs of both motors: if the right side stays") for one in more[-1].todo)
    assert max(widths) < 1.0


def test_a_dead_band_shows_in_four_manoeuvres(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", "planar", FOUR, {"actuator_deadband": {"voltage": 0.6, "whole": 0}})
    found = bp.why(tmp_path / "log.csv")
    assert found.answer.ending == "cause"
    assert "a dead band of the drive around zero volts (actuator_deadband)" in found.answer.what
    assert found.finding.effects[0].parameters["voltage"].value == pytest.approx(0.6, abs=0.06)
    assert found.answer.todo[0].startswith("Start each motor's PWM above the dead band")
    assert "curve_1" not in [name for name, role in found.finding.roles.items() if role == "held_out"]


def test_what_a_black_box_predicts_of_the_noise_is_nothing(tmp_path: Path) -> None:
    """The black box predicts a fifth of the counts' rounding: 99.54 % can be explained, the model explains 99.53 %."""
    write_log(tmp_path / "log.csv", "planar", MANY, {}, seed=33)
    found = bp.why(tmp_path / "log.csv")
    assert found.finding.verdict == "none"
    assert found.answer.ending == "nothing", found.answer
    assert found.answer.what.startswith("Nothing is wrong: the simulation explains 99.")
    assert re.search(r"These data would have shown .* from [\d.]+", found.answer.what)
    assert "Not proved" not in found.answer.sure
    assert (found.answer.todo[0], found.answer.next) == ("Nothing needs to be done.", None)


@pytest.mark.parametrize(
    "hidden",
    [{"wheel_radius_mismatch": {"mismatch": 0.1}}, {"gyro_bias": {"bias": 0.16}}, {"gyro_bias": {"bias": -0.16}}],
)
def test_a_straight_run_that_turns_a_little_is_no_wrong_wiring(
    hidden: dict[str, dict[str, float]], tmp_path: Path
) -> None:
    write_log(tmp_path / "log.csv", "planar", STRAIGHT, hidden)
    known = [*stated("planar"), "--nominal", "battery_voltage=9"]
    done = brickpilot("import", "log.csv", "--guess", "--split", "rests", *known, "--out", "set", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert bp.read(tmp_path / "set").wiring == ()


def test_what_rests_on_a_guess_is_not_confirmed_until_it_is_stated(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", "planar", FOUR, WEAK_RIGHT)
    said = brickpilot("why", "log.csv", "--out", "guessed", cwd=tmp_path)
    sure = plain(said.stdout).splitlines()[1]
    assert "confirm it" not in sure
    assert "Not confirmed: nobody stated 960 counts a turn, 255 as full drive" in sure
    assert "are guesses" in said.stdout.splitlines()[3]
    maps = [f"duty_{s}=pwm_{s}/255" for s in ("left", "right")]
    maps += [f"wheel_angle_{s}=enc_{s}/960:rotation" for s in ("left", "right")]
    words = [word for one in maps for word in ("--map", one)]
    known = [*stated("planar"), "--nominal", "battery_voltage=9", "--frame", "FRD"]
    told = brickpilot("why", "log.csv", *words, *known, "--out", "stated", "--json", cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    answer = json.loads(told.stdout)
    assert "Not confirmed" not in answer["sure"]
    assert "The right" in answer["what"]


def test_data_that_contradict_themselves_are_said_to_before_all_else(tmp_path: Path) -> None:
    """The contradiction comes first while the fault is too uncertain to be mended; a mended fault is the cause."""
    made = finding(measured(tmp_path / "set"), "named")
    unsure = Miswired("scale", ("yaw_rate",), "yaw_rate is 57.3 times what the wheels say", 0.95, {})
    open_data = dataclasses.replace(made.dataset, wiring=(unsure,))
    found = why_text.answer(dataclasses.replace(made, dataset=open_data), None)
    assert found.ending == "contradiction"
    assert found.what.startswith(
        "These data contradict themselves: yaw_rate is 57.3 times what the wheels say (95 % sure)"
    )
    assert found.todo[0] == "Mend the wiring, or state the log otherwise. If all is wired as stated, say --as-wired."


LEFT, RIGHT = (f"--map wheel_angle_{side}=enc_{side}" for side in ("left", "right"))
REWIRED = {
    "swapped": (lambda counts: counts[:, ::-1], "The left and the right encoder are swapped (",
                "--map wheel_angle_left=enc_right/960:rotation --map wheel_angle_right=enc_left/960:rotation"),
    "reversed": (lambda counts: counts * [-1, 1], "The left encoder counts backwards (", f"{LEFT}/-960:rotation"),
    "dead": (lambda counts: 0 * counts, "Both encoders stand still while the gyro turns (", ""),
    "1440": (lambda counts: np.floor(1.5 * counts), "1440 counts a turn fit, 960 do not: ",
             f"{LEFT}/1440:rotation {RIGHT}/1440:rotation"),
}  # fmt: skip
"""Fault -> its change of the counts, the beginning of the answer, and the options that mend it."""


@pytest.mark.parametrize(("robot", "fault"), [*zip(itertools.cycle(ROBOTS), REWIRED)])
def test_wrong_wiring_is_the_first_line_with_what_mends_it(robot: str, fault: str, tmp_path: Path) -> None:
    """Each fault is planted on one of the two robots; test_wiring.py finds each fault on both."""
    change, begins, options = REWIRED[fault]
    write_log(tmp_path / "log.csv", robot, MANY, {})
    rewire(tmp_path / "log.csv", change)
    known = [*stated(robot), "--nominal", "battery_voltage=9", "--budget", "1"]
    said = brickpilot("why", "log.csv", *known, "--out", "found", cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    first = plain(said.stdout).splitlines()[0]
    assert first.startswith(f"what is wrong: {begins}"), first
    assert (f"To state it right: {options}. " in first) == bool(options)
    assert ("mended here). " if options else "left out here). ") in first
    if not options:
        return
    words = ["import", "log.csv", "--guess", "--split", "rests", *options.split(), *known[:-2], "--out", "right"]
    assert "wiring: " not in brickpilot(*words, cwd=tmp_path).stdout
    mended, right = (bp.read(tmp_path / folder).runs[0].outputs for folder in ("found/data", "right"))
    np.testing.assert_allclose(mended["wheel_angle_left"], right["wheel_angle_left"], rtol=0.01)


def test_who_says_so_keeps_the_wiring_as_it_is_stated(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", "planar", MANY, {})
    rewire(tmp_path / "log.csv", REWIRED["swapped"][0])
    words = ["--as-wired", "--frame", "FRD", *stated("planar")]
    said = brickpilot("why", "log.csv", *words, "--budget", "3", "--out", "found", cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    assert "encoder" not in said.stdout.splitlines()[0]
    page = (tmp_path / "found/why.html").read_text()
    assert "kept as it is stated: The left and the right encoder are swapped (99." in page
    told = (tmp_path / "found/data/dataset.toml").read_text()
    assert "as_wired = true" in told
    kept = bp.read(tmp_path / "found/data")
    assert kept.wiring == ()
    (tmp_path / "found/data/dataset.toml").write_text(told.replace("as_wired = true\n", ""))
    mended = bp.read(tmp_path / "found/data")
    assert mended.wiring[0].is_mended
    for one, other in zip(kept.runs, mended.runs, strict=True):
        np.testing.assert_allclose(one.raw_outputs["wheel_angle_left"], other.raw_outputs["wheel_angle_right"])


def test_straight_runs_alone_name_no_cause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In four of twenty logs another effect fits best once the robot turns (`tests/lab/surer.py`)."""
    made = finding(measured(tmp_path / "set"), "named")
    monkeypatch.setattr(why_text, "drives_straight_alone", lambda dataset: True)
    found = why_text.answer(made, None, "", lambda: [RAMP])
    assert found.ending == "missing"
    assert "straight runs cannot tell what" in found.what
    assert not any(one.name in found.what or one.words in found.what for one in catalogue.effects())
    assert found.todo[0].startswith("Drive ")


def test_the_three_endings_and_a_cause(tmp_path: Path) -> None:
    data = measured(tmp_path / "set")
    found = {kind: why_text.answer(finding(data, kind), None) for kind in ("none", "named", "ambiguous", "unknown")}
    assert {kind: one.ending for kind, one in found.items()} == {
        "none": "cause", "named": "cause", "ambiguous": "missing", "unknown": "missing",
    }  # fmt: skip
    assert found["none"].what.startswith("What is stated is wrong: resistance is 27.3")
    small = {role: Gap(1.0, 1.0) for role in ("fit", "held_out")}
    right = dataclasses.replace(finding(data, "none"), nominal_findings=(), gap=small)
    assert why_text.answer(right, None).ending == "nothing"
    assert "next_experiment.toml has it" in found["ambiguous"].todo[0]
    asked: list[str] = []

    def advised() -> list[Manoeuvre]:
        asked.append("once")
        return [RAMP]

    lost = why_text.answer(dataclasses.replace(finding(data, "unknown"), next_experiment=None), None, "", advised)
    assert (lost.ending, lost.next, asked) == ("missing", RAMP, ["once"])
    assert lost.todo[0].startswith('Drive "a slow ramp" next, 8 s: next_experiment.toml has it.')


def test_a_side_is_weaker_only_where_equal_commands_show_it(tmp_path: Path) -> None:
    time = np.arange(0.0, 3.0, 0.01)
    volts = np.where(time > 0.5, 5.0, 0.0)
    frame = {"time": time, "voltage_left": volts, "voltage_right": volts}
    speed = {"wheel_speed_left": 2.0 * volts, "wheel_speed_right": 1.8 * volts}
    found = weaker_side(bp.Dataset.from_frames({"a": pandas({**frame, **speed})}, vehicle="diff_drive"))
    assert found is not None
    assert (found.side, round(found.share, 6)) == ("right", 0.1)
    unequal = {**frame, "voltage_right": 0.9 * volts, **speed}
    assert weaker_side(bp.Dataset.from_frames({"a": pandas(unequal)}, vehicle="diff_drive")) is None


def pandas(columns: dict[str, np.ndarray]):  # type: ignore[no-untyped-def]
    import pandas as pd

    return pd.DataFrame(columns)


@pytest.mark.parametrize(
    ("share", "interval", "said"),
    [
        (0.057, (0.055, 0.059), "5.7 % (5.5 to 5.9 %)"),
        (0.1213, (0.1182, 0.1246), "12.1 % (11.8 to 12.5 %)"),
        (0.1213, (0.1082, 0.1346), "12.1 % (10.8 to 13.5 %)"),
        (0.12, (0.03, 0.21), "12 % (3 to 21 %)"),
        (0.12, (0.12, 0.12), "12.000000 % (12.000000 to 12.000000 %)"),
    ],
)
def test_a_size_has_the_digits_that_its_interval_supports(
    share: float, interval: tuple[float, float], said: str
) -> None:
    assert plain("".join(in_words(share, "1", interval))) == said


def test_the_terminal_gets_all_of_it_only_when_asked() -> None:
    found = why_text.Answer("cause", "W.", "S.", ("One.", "Two."), ("Seen.",), None)
    short = why_text.lines(found, ["noted"] * 9, ["960 counts a turn"])
    assert len(short) == 4
    assert short[3].startswith("note: 960 counts a turn is a guess; 11 more lines")
    whole = why_text.lines(found, ["noted"] * 9, [], verbose=True)
    assert [line.strip() for line in whole[3:6]] == ["Two.", "so:            Seen.", "note: noted"]
