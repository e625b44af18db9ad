"""A full disk ends a campaign with one line that names the file; the finished parts stay.

`test_outputs_whole.py` fills the disk of all other commands.
"""

from __future__ import annotations

from pathlib import Path

from command import brickpilot
from test_campaign import CAMPAIGN, OTHER, SHORT
from test_outputs_whole import Begun

ROOM = 2048  # largest size of a file, bytes, as on a disk that becomes full while the file is written


def test_a_campaign_keeps_what_is_done_and_names_the_file(tmp_path: Path) -> None:
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN)):
        (tmp_path / f"{name}.toml").write_text(text)
    flown = ("campaign", "trial.toml", "--runs", "4", "--out", "flown")
    status, said = Begun(*flown, cwd=tmp_path, room=ROOM).ended()
    assert status == 1
    assert len(said) == 1
    assert said[0].startswith("brickpilot: flown/")
    assert said[0].endswith(": File too large; what is done stays")
    assert not [path for path in (tmp_path / "flown").rglob("*") if "unfinished" in path.name]
    assert brickpilot(*flown, cwd=tmp_path).returncode == 0
