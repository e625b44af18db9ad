"""A wrong option or scenario gives one line on stderr and status 2, and writes nothing. Data sets: test_bad_datasets.py."""

# ruff: noqa: E501 - one row of the table a line

from __future__ import annotations

from pathlib import Path

import pytest
from command import brickpilot

MISSION = """name = "m"
kind = "mission"
duration_s = 5
waypoints_m = [[1, 0]]
"""
MANOEUVRE = """name = "m"
kind = "manoeuvre"
duration_s = 5
segments = [{ from_s = 0, left_V = 1, right_V = 1 }]
"""

# Name: (scenario text, the place that the line must name, a word of the reason)
SCENARIOS: dict[str, tuple[str, str, str]] = {
    "not TOML": ("name = \n", "s.toml:1:", "TOML"),
    "unclosed list": (MISSION + "\nx = [1,\n", "s.toml:", "TOML"),
    "empty": ("", "s.toml: name", "missing"),
    "no kind": ('name = "m"\nduration_s = 5\n', "s.toml: kind", "missing"),
    "no duration": ('name = "m"\nkind = "mission"\n', "s.toml: duration_s", "missing"),
    "unknown kind": (MISSION.replace('"mission"', '"parade"'), "s.toml:2: kind", "not one of"),
    "unknown key": (MISSION + "speed = 1\n", "s.toml:5: speed", "unknown key"),
    "name is a number": (MISSION.replace('"m"', "3"), "s.toml:1: name", "needs a text"),
    "name is a path": (MISSION.replace('"m"', '"../m"'), "s.toml:1: name", "part of a file's name"),
    "waypoint twice to the millimetre": (MISSION.replace("[[1, 0]]", "[[1, 0], [1.0004, 0]]"), "s.toml:4: waypoints_m[1]", "same"),
    "name is blank": (MISSION.replace('"m"', '" "'), "s.toml:1: name", "needs a text"),
    "duration is text": (MISSION.replace("duration_s = 5", 'duration_s = "long"'), "s.toml:3: duration_s", "not a number"),
    "duration negative": (MISSION.replace("= 5", "= -5"), "s.toml:3: duration_s", "outside"),
    "duration not finite": (MISSION.replace("= 5", "= inf"), "s.toml:3: duration_s", "outside"),
    "duration not a number": (MISSION.replace("= 5", "= nan"), "s.toml:3: duration_s", "outside"),
    "duration true": (MISSION.replace("= 5", "= true"), "s.toml:3: duration_s", "not a number"),
    "duration of a day": (MISSION.replace("= 5", "= 86400"), "s.toml:3: duration_s", "outside"),
    "no waypoints": (MISSION.replace("waypoints_m = [[1, 0]]", ""), "waypoints_m", "list of 1 to 32"),
    "empty waypoints": (MISSION.replace("[[1, 0]]", "[]"), "s.toml:4: waypoints_m", "list of 1 to 32"),
    "too many waypoints": (MISSION.replace("[[1, 0]]", str([[i % 2, 0] for i in range(33)])), "s.toml:4: waypoints_m", "1 to 32"),
    "waypoint of three": (MISSION.replace("[1, 0]", "[1, 0, 2]"), "s.toml:4: waypoints_m[0]", "pair"),
    "waypoint of text": (MISSION.replace("[1, 0]", '["a", 0]'), "s.toml:4: waypoints_m[0]", "not a number"),
    "waypoint too far": (MISSION.replace("[1, 0]", "[31, 0]"), "s.toml:4: waypoints_m[0]", "outside"),
    "waypoint twice": (MISSION.replace("[[1, 0]]", "[[1, 0], [1, 0]]"), "s.toml:4: waypoints_m[1]", "same"),
    "segments in a mission": (MISSION + "segments = []\n", "s.toml:5: segments", "belongs to a manoeuvre"),
    "waypoints in a manoeuvre": (MANOEUVRE + "waypoints_m = [[1, 0]]\n", "s.toml:5: waypoints_m", "belongs to a mission"),
    "no segments": (MANOEUVRE.replace("[{ from_s = 0, left_V = 1, right_V = 1 }]", "[]"), "s.toml:4: segments", "list of 1"),
    "segment is a number": (MANOEUVRE.replace("[{ from_s = 0, left_V = 1, right_V = 1 }]", "[1]"), "segments[0]", "not a table"),
    "segment key unknown": (MANOEUVRE.replace("left_V = 1", "left = 1"), "segments[0].left", "unknown key"),
    "segment without right": (MANOEUVRE.replace(", right_V = 1", ""), "segments[0].right_V", "missing"),
    "segment voltage": (MANOEUVRE.replace("left_V = 1", "left_V = 99"), "segments[0].left_V", "outside"),
    "segment voltage text": (MANOEUVRE.replace("left_V = 1", 'left_V = "off"'), "segments[0].left_V", "not a number"),
    "segments out of order": (
        MANOEUVRE.replace("}]", "}, { from_s = 0, left_V = 1, right_V = 1 }]"), "segments[1].from_s", "does not come after",
    ),
    "segment past the end": (MANOEUVRE.replace("from_s = 0", "from_s = 6"), "segments[0].from_s", "outside"),
    "stop at nothing": (MANOEUVRE + "stop_at_m = 0\n", "s.toml:5: stop_at_m", "outside"),
    "start is a list": (MISSION + "start = [0, 0]\n", "s.toml:5: start", "not a table"),
    "start key unknown": (MISSION + "start = { x = 0 }\n", "s.toml:5: start.x", "unknown key"),
    "start too far": (MISSION + "start = { x_m = 99 }\n", "s.toml:5: start.x_m", "outside"),
    "cruise too fast": (MISSION + "cruise_m_s = 9\n", "s.toml:5: cruise_m_s", "outside"),
    "cruise of an unknown profile": (MISSION + "cruise_m_s = { fast = 1 }\n", "s.toml:5: cruise_m_s.fast", "unknown key"),
    "profile unknown": (MISSION + 'profile = "real"\n', "s.toml:5: profile", "not one of"),
    "sensors unknown": (MISSION + 'sensors = "lidar"\n', "s.toml:5: sensors", "not one of"),
    "seed negative": (MISSION + "seed = -1\n", "s.toml:5: seed", "whole number"),
    "seed fractional": (MISSION + "seed = 1.5\n", "s.toml:5: seed", "whole number"),
    "parameter unknown": (MISSION + "[parameters]\nweight = 1\n", "s.toml:6: parameters.weight", "unknown key"),
    "parameter unphysical": (MISSION + "[parameters]\nmass = -1\n", "s.toml:6: parameters.mass", "outside"),
    "effect unknown": (MISSION + "[effects.gremlins]\nsize = 1\n", "s.toml:5: effects.gremlins", "unknown key"),
    "effect parameter unknown": (MISSION + "[effects.coulomb_friction]\nsize = 1\n", "effects.coulomb_friction.size", "unknown key"),
    "effect parameter unphysical": (MISSION + "[effects.coulomb_friction]\ntorque = -1\n", "coulomb_friction.torque", "outside"),
    "effect is a number": (MISSION + "[effects]\ncoulomb_friction = 1\n", "effects.coulomb_friction", "not a table"),
}  # fmt: skip

# Name: (arguments, a word of the reason)
OPTIONS: dict[str, tuple[list[str], str]] = {
    "no such command": (["fly"], "No such command"),
    "no such option": (["run", "--fast"], "No such option"),
    "profile unknown": (["run", "--profile", "real"], "--profile"),
    "sensors unknown": (["run", "--sensors", "gps"], "--sensors"),
    "seed is text": (["run", "--seed", "x"], "--seed"),
    "seed negative": (["run", "--seed", "-1"], "--seed"),
    "option without value": (["run", "--profile"], "--profile"),
    "scenario missing": (["run", "nowhere.toml"], "nowhere.toml"),
    "scenario twice": (["run", "mission", "--scenario", "fig4"], "twice"),
    "scenario is a folder": (["run", "."], "."),
    "scenario is an empty name": (["run", ""], "no such file"),
    "model is a device": (["run", "--model", "/dev/null"], "is not a file"),
    "out is a link": (["run", "--out", "link"], "link"),
    "too many arguments": (["run", "mission", "fig4"], "unexpected extra argument"),
    "model missing": (["run", "--model", "nowhere.toml"], "nowhere.toml"),
    "out is a file": (["run", "--out", "taken"], "taken"),
    "out below a file": (["run", "--out", "taken/run"], "taken/run"),
    "out is someone else's folder": (["run", "--out", "theirs"], "theirs"),
    "effect unknown": (["effects", "gremlins"], "gremlins"),
    "target unknown": (["bench", "--target", "abacus"], "--target"),
    "bench profile without h8": (["bench", "--profile", "paper"], "--profile"),
    "bench seconds of this machine": (["bench", "--seconds", "3"], "--seconds"),
    "bench for no time": (["bench", "--target", "h8", "--seconds", "0"], "--seconds"),
    "data set missing": (["compare", "nowhere"], "nowhere"),
    "data set not given": (["compare"], "DATASET"),
    "calibrate a missing set": (["calibrate", "nowhere"], "nowhere"),
    "import kind unknown": (["import", "excel", "taken", "--out", "new"], "excel"),
    "import a missing file": (["import", "wpilib", "nowhere.json", "--out", "new"], "nowhere.json"),
    "import without out": (["import", "wpilib", "taken"], "--out"),
}


def _refused(arguments: list[str], folder: Path, *words: str) -> None:
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    done = brickpilot(*arguments, cwd=folder)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("brickpilot")
    for word in words:
        assert word in done.stderr
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


@pytest.mark.parametrize("case", SCENARIOS)
def test_a_bad_scenario_is_refused(case: str, tmp_path: Path) -> None:
    text, place, reason = SCENARIOS[case]
    (tmp_path / "s.toml").write_text(text)
    _refused(["run", "s.toml"], tmp_path, place, reason)


@pytest.mark.parametrize("case", OPTIONS)
def test_a_bad_option_is_refused(case: str, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("something\n")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.tex").write_text("\n")
    (tmp_path / "link").symlink_to(tmp_path / "theirs")
    arguments, reason = OPTIONS[case]
    _refused(arguments, tmp_path, reason)


def test_a_scenario_that_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_bytes(b'name = "m"\nkind = "\xff"\n')
    _refused(["run", "s.toml"], tmp_path, "s.toml:2:", "UTF-8")
