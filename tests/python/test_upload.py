"""`brickpilot upload` delivers mission and settings to the firmware over an infrared link that loses bytes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from brickpilot.cli import main
from brickpilot.errors import InputError
from brickpilot.link import brick as brick_link
from brickpilot.link import lnp as infrared_link
from brickpilot.link import tower
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle.gains import Gains
from rcx_autopilot import Autopilot
from rcx_brick import BYTE_S, Faults, RcxBrick

pytestmark = pytest.mark.realtime  # the link's time-outs are in real time, for the speed of a pseudo-terminal

MISSION = """name = "two"
kind = "mission"
title = "two legs"
duration_s = 20.0
waypoints_m = [[1.0, 0.5], [0.0, -0.25]]
"""


@pytest.fixture(autouse=True)
def _fast_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scales the time-outs to `BYTE_S`, the time of a byte on the pseudo-terminal."""

    def fast_tower(device: str) -> tower.Tower:
        return tower.Tower(device, BYTE_S)

    monkeypatch.setattr(brick_link, "Tower", fast_tower)


def upload(capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, object]:
    main.main(["upload", *options, "--json"])
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_a_mission_and_settings_arrive_and_it_starts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "two.toml").write_text(MISSION)
    brick = Autopilot()
    with RcxBrick(device=brick) as far:
        Gains("two", {"heading_kp": 901, "speed_ki": 1111}).save(tmp_path / "gains.toml")
        options = ("--set", "heading_kp=900", "--set", "acceptance=150", "--start")
        options += ("--gains", str(tmp_path / "gains.toml"))
        found = upload(capsys, str(tmp_path / "two.toml"), "--link", f"infrared:{far.path}", *options)
        assert (found["waypoints"], found["started"], found["sent_again"]) == (2, True, 0)
    with RcxBrick(device=brick) as far:  # a pseudo-terminal cannot be set up twice
        session = Session(brick_link.open_link(f"infrared:{far.path}"), "again")
        assert (session.read("heading_kp"), session.read("acceptance")) == (900, 150)  # --set overrides --gains
        assert session.read("speed_ki") == 1111
        assert session.route() == [(1000, 500), (0, -250)]
        with pytest.raises(InputError, match="start: has no meaning in mode run"):
            session.command("start")
        session.link.close()


@pytest.mark.parametrize("seed", range(4))
def test_each_request_is_obeyed_once_on_a_line_that_loses_bytes(seed: int, capsys: pytest.CaptureFixture[str]) -> None:
    brick = Autopilot(telemetry_after=3)
    faults = Faults(seed=seed, corrupt=0.01, lose=0.01)
    with RcxBrick(device=brick, faults=faults) as far:
        found = upload(capsys, "mission", "--link", f"infrared:{far.path}", "--start")
        assert far.hit > 0
    assert (found["waypoints"], found["started"]) == (8, True)
    assert found["sent_again"]
    assert len(set(brick.obeyed)) == len(brick.obeyed)


def test_a_start_whose_reply_is_lost_is_answered_again_and_obeyed_once() -> None:
    brick = Autopilot()
    with RcxBrick(device=brick, lose_replies=frozenset({5})) as far:
        session = Session(brick_link.open_link(f"infrared:{far.path}"), "infrared")
        session.open("coupled", REALTIME)
        session.upload([(1000, 0), (0, 500)])
        session.command("start")
        session.link.close()
    assert (brick.repeated, len(brick.obeyed)) == (1, 5)


def test_a_missing_brick_is_one_line(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(infrared_link, "FIRST_TRIES", 1)
    with RcxBrick(device=Autopilot(), on=False) as far, pytest.raises(SystemExit) as left:
        upload(capsys, "mission", "--link", f"infrared:{far.path}")
    assert left.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith(f"brickpilot: --link infrared:{far.path}: no brick has replied for ")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("mission", "--link", "infrared:/dev/none"), "/dev/none: no such device"),
        (("mission", "--link", "pigeon:1"), "--link pigeon:1: is no link"),
        (("forward_1m", "--link", "infrared:/dev/none"), "forward_1m: has no waypoints"),
        (("mission", "--link", "infrared:/dev/none", "--set", "cruise=fast"), "--set cruise=fast: needs NAME=VALUE"),
    ],
)
def test_bad_input_is_refused_before_anything_is_sent(
    options: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        upload(capsys, *options)
    assert left.value.code == 2
    assert said in capsys.readouterr().err


def test_hil_refuses_an_infrared_link(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main.main(["hil", "--link", f"infrared:{os.devnull}"])
    assert left.value.code == 2
    assert "is too slow for a plant; `brickpilot upload` speaks to an RCX" in capsys.readouterr().err


def test_an_unknown_link_is_answered_with_the_links_that_upload_takes() -> None:
    with pytest.raises(InputError, match="is no link; known links: infrared:PORT, serial:PORT, tcp:HOST:PORT, can:"):
        brick_link.open_link("serial:")
