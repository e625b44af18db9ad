"""A killed run leaves an unfinished folder; the next run with the same output removes this folder, and no other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from brickpilot.report import run_folder

HELD = """
import sys, time
from pathlib import Path
from brickpilot.report import run_folder
with run_folder.fresh_folder(Path(sys.argv[1]), ()) as beside:
    (beside / "half").write_text("written")
    print("begun", flush=True)
    time.sleep(60)
"""


def begun(out: Path) -> subprocess.Popen[str]:
    """Returns a process that is writing `out`."""
    process = subprocess.Popen([sys.executable, "-c", HELD, str(out)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    return process


def test_the_next_run_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    out = tmp_path / "o*t"  # a name with a wildcard
    process = begun(out)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = tmp_path / ".out-unfinished-other"
    kept.mkdir()
    assert len(list(tmp_path.iterdir())) == 2
    with run_folder.fresh_folder(out, ()) as beside:
        assert sorted(tmp_path.iterdir()) == sorted((beside, kept))
    assert sorted(tmp_path.iterdir()) == sorted((kept, out))


def test_a_run_that_goes_on_keeps_its_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = begun(out)
    try:
        (theirs,) = tmp_path.iterdir()
        with run_folder.fresh_folder(out, ()):
            assert (theirs / "half").read_text() == "written"
        assert theirs.is_dir()
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
