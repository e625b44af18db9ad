"""python-can opens a recording of a link; a replay gives the same motor commands, or says which step differs."""

from __future__ import annotations

import json
from pathlib import Path

import can
import pytest
from brickpilot.hil import ends, fly
from brickpilot.hil.traffic_log import RecordingLink
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP
from command import brickpilot
from test_hil import plan


@pytest.mark.parametrize("suffix", ["asc", "blf", "log"])
def test_a_recording_opens_with_python_can_and_replays_bit_for_bit(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 1.5\nwaypoints_m = [[0.3, 0.1]]\n', encoding="utf-8"
    )
    file = tmp_path / f"r.{suffix}"
    arguments = ["hil", "s.toml", "--link", "serial:pty", "--record", file.name, "--telemetry-every", "10"]
    done = brickpilot(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    with can.LogReader(str(file)) as reader:
        decoded = [(m, book().database.decode_message(m.arbitration_id, m.data)) for m in reader]
    motors = [values["left"] for message, values in decoded if message.arbitration_id == book().by_name["MOTORS"].id]
    assert len(motors) == 500
    assert max(motors) == pytest.approx(1.0)
    done = brickpilot("hil", "--link", "tcp", "--replay", file.name, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {
        "link": "tcp", "replay": file.name, "steps": 500, "differing": 0, "first": None,
    }  # fmt: skip


def test_a_replay_that_differs_is_reported(tmp_path: Path) -> None:
    wanted = plan(duration=0.6)
    file = tmp_path / "r.log"
    with ends.both_ends("serial:pty") as both:
        link = RecordingLink(both.link, file)
        fly.fly(ends.Ends(link, None), "x", wanted, pace=LOCKSTEP, telemetry_every=10, progress=lambda *_: None)
        link.close()
    layout = book().by_name["MOTORS"]
    lines = file.read_text(encoding="utf-8").splitlines()
    mine = [number for number, line in enumerate(lines) if f" {layout.id:03X}#" in line]
    data = bytes.fromhex(lines[mine[100]].split("#")[1].split()[0])
    left, *others, _ = layout.unpack(data)
    lines[mine[100]] = lines[mine[100]].replace(data.hex().upper(), layout.seal(left ^ 1, *others).hex().upper())
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = brickpilot("hil", "--link", "serial:pty", "--replay", "r.log", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "step 101 differs" in done.stderr


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.log", None, "cannot be read"),
        ("r.txt", "", "needs one of the suffixes"),
        ("r.log", "what is this\n", "is no log"),
        ("r.log", "", "holds no flight"),
        ("r.blf", "LOGGnothing", "is no log"),
    ],
)
def test_a_bad_recording_is_refused_in_one_line(name: str, content: str | None, says: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / name).write_text(content, encoding="utf-8")
    done = brickpilot("hil", "--link", "serial:pty", "--replay", name, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"brickpilot: {name}: ")
    assert says in done.stderr


@pytest.mark.realtime
def test_a_recording_in_real_time_is_refused(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 0.3\nwaypoints_m = [[0.3, 0.1]]\n', encoding="utf-8"
    )
    brickpilot("hil", "s.toml", "--link", "serial:pty", "--realtime", "--record", "r.log", cwd=tmp_path)
    done = brickpilot("hil", "--link", "serial:pty", "--replay", "r.log", cwd=tmp_path)
    assert done.returncode == 2
    assert "real time" in done.stderr
