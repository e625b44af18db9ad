"""A gain set flies as the same raw integers in simulation, over a link and on the RCX's processor; images hold it."""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from pathlib import Path

import pytest
from brickpilot.errors import InputError
from brickpilot.firmware import package, params_header, robot
from brickpilot.vehicle import flight, gains
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.settings import defaults, settings
from command import brickpilot
from test_firmware import OWN, write

ROOT = Path(__file__).parents[2]
TUNED = Gains(
    "trial", {"speed_kp": 1001, "heading_kp": 777, "feedforward": 401, "cruise": 5003, "creep": 1001, "pivot": 4999}
)
SHORT = """name = "short"
kind = "mission"
duration_s = 6
waypoints_m = [[0.6, 0], [0.6, 0.5]]
"""


def saved(folder: Path, given: Gains = TUNED) -> Path:
    given.save(folder / "gains.toml")
    return folder / "gains.toml"


def test_every_setting_that_tunes_the_controller_comes_back_as_it_was(tmp_path: Path) -> None:
    for end in ("low", "high"):
        raw = {name: getattr(how, end) for name, how in gains.tunable().items()}
        raw |= {less: settings()[less].low for less, _ in gains.AT_MOST}
        assert gains.load(saved(tmp_path, Gains("ends", raw))) == Gains("ends", raw)
    assert [path.name for path in tmp_path.iterdir()] == ["gains.toml"]


def test_a_value_without_its_raw_integer_becomes_the_nearest_one(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('name = "own"\n[gains]\nspeed_kp = { value = 15.64, unit = "V s/m" }\n')
    assert gains.load(path).raw == {"speed_kp": 1001}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("speed_kq = { raw = 5 }", "4: gains.speed_kq: 'speed_kq' is not one of speed_kp"),
        ("left_gain = { raw = 5 }", "4: gains.left_gain: describes the robot, so it belongs in a compensation.toml"),
        ('speed_kp = { value = 20, unit = "V" }', "4: gains.speed_kp.unit: 'V' should be 'V s/m'"),
        ("speed_kp = { raw = 32768 }", "4: gains.speed_kp: 512 V s/m is outside 0 to 512 V s/m: raw 0..32767"),
        ("speed_kp = { value = -0.1 }", "4: gains.speed_kp: -0.09375 V s/m is outside 0 to 512 V s/m: raw 0..32767"),
        ("speed_kp = { raw = 5.0 }", "4: gains.speed_kp.raw: 5.0 is not a whole number"),
        ("speed_kp = { value = 20, raw = 1281 }", "4: gains.speed_kp.value: 20 V s/m does not agree with raw = 1281"),
        ("speed_kp = {}", "4: gains.speed_kp: needs a value or a raw integer"),
        ("speed_kp = { value = nan }", "4: gains.speed_kp.value: nan is outside"),
        ("creep = { value = 0.3 }\ncruise = { value = 0.2 }", "4: gains.creep: may not be above cruise"),
        ("", "3: gains: has no gain"),
    ],
)
def test_a_wrong_file_is_one_line(line: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(f'name = "wrong"\n\n[gains]\n{line}\n')
    with pytest.raises(InputError) as caught:
        gains.load(path)
    assert str(caught.value).startswith(f"{path}:{says}")
    assert "\n" not in str(caught.value)


def test_a_gain_set_flies_the_same_as_its_settings_over_a_link_and_on_the_rcx_processor(tmp_path: Path) -> None:
    file, route = saved(tmp_path), tmp_path / "short.toml"
    route.write_text(SHORT)
    streams = {}
    for name, words in {
        "none": ("run", str(route)),
        "run": ("run", str(route), "--gains", str(file)),
        "set": ("hil", str(route), "--link", "can:virtual", *written(TUNED)),
        "link": ("hil", str(route), "--link", "can:virtual", "--gains", str(file)),
        "h8": ("hil", str(route), "--target", "h8sim", "--telemetry-every", "100", "--gains", str(file)),
    }.items():
        done = brickpilot(*words, "--sensors", "imu+encoders", "--out", str(tmp_path / name), "--json", cwd=ROOT)
        figures = json.loads(done.stdout)
        streams[name] = figures["motor_stream_sha256"]
        assert figures["gains"] == (dict(TUNED.raw) if "--gains" in words else None)
    assert streams["run"] == streams["set"] == streams["link"] == streams["h8"] != streams["none"]
    page = (tmp_path / "h8/report.html").read_text()
    assert f"--gains {file}" in page


def written(given: Gains) -> list[str]:
    return [word for name, raw in given.raw.items() for word in ("--set", f"{name}={raw}")]


def test_a_gain_set_wins_over_the_cruise_speed_of_a_scenario() -> None:
    plan = flight.plan("mission", gains=TUNED)
    assert plan.cruise == 5003 / 16000
    with pytest.raises(InputError, match="a manoeuvre has no controller"):
        flight.plan("forward_1m", gains=TUNED)


@pytest.mark.parametrize("name", OWN)
def test_an_image_holds_the_raw_integers_and_the_rest_stays(name: str, tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, name, OWN[name]))
    made = robot.with_gains(own, TUNED)
    before, after = (constants_in(params_header.own_header(one, 0.003)) for one in (own, made))
    wanted = {settings()[gain].field.removeprefix("config."): str(raw) for gain, raw in TUNED.raw.items()}
    assert after == before | wanted
    assert before != after
    assert made.known == own.known


def constants_in(header: str) -> dict[str, str]:
    """Returns path of a field ("outer.inner.field") -> number as text, for the constants of a header."""
    found, inside = {}, []
    for line in header.partition("PARAMS_COUPLED = {")[2].splitlines():
        if opens := re.fullmatch(r" *\.(\w+) = \{", line):
            inside.append(opens[1])
        elif line.strip() == "}," and inside:
            inside.pop()
        elif number := re.fullmatch(r" *\.(\w+) = (\S+),", line):
            found[".".join((*inside, number[1]))] = number[2]
    return found


def test_every_gain_that_can_be_compiled_in_is_and_the_other_is_refused(tmp_path: Path) -> None:
    own = robot.load(write(tmp_path, "small", OWN["small"]))
    raw = {name: how for name, how in defaults("coupled").items() if name in gains.tunable() and name != "acceptance"}
    made = robot.with_gains(own, Gains("packaged", raw))
    again = tmp_path / "again.toml"
    again.write_text(package.vehicle_file(made))
    assert tomllib.loads(again.read_text())["controller"]["coupled"]["speed_kp"]["basis"] == "gain set packaged"
    assert constants_in(params_header.own_header(robot.load(again), 0.009)) == constants_in(
        params_header.own_header(made, 0.009)
    )
    with pytest.raises(InputError, match=r"packaged: acceptance: raw 55 cannot be compiled in: 0.06429 m follows from"):
        robot.with_gains(own, Gains("packaged", {"acceptance": 55}))
    high = dataclasses.replace(TUNED, raw={"creep": 32767})
    with pytest.raises(InputError, match="creep may not pass cruise"):
        params_header.own_header(robot.with_gains(own, high), 0.009)
