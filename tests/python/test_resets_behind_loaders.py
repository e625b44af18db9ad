"""After a reset in a mission, an AVR with a boot loader of Arduino's core starts no motor by itself."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from arduino_loaders import LOADERS
from loader_resets import CAUSES, OFF_S, Outcome

ROOT = Path(__file__).parents[2]


def outcomes(loader: str, full: bool) -> list[Outcome]:
    """Returns the outcomes of resets: one for each cause, or, if `full`, 50 for each cause in a whole mission."""
    count, last_s = ("200", "36") if full else ("4", "5")
    asked = [sys.executable, Path(__file__).with_name("loader_resets.py"), loader, count, "1", last_s]
    done = subprocess.run(asked, cwd=ROOT, check=True, capture_output=True, text=True)
    found = [Outcome(**json.loads(line)) for line in done.stdout.splitlines()]
    assert len(found) == int(count)
    assert {one.cause for one in found} == set(CAUSES)
    return found


@pytest.mark.parametrize("loader", ["none", *LOADERS])
def test_after_a_reset_in_a_mission_motors_are_off_until_a_command(loader: str, full: bool) -> None:
    """A loader may leave the register MCUSR unchanged. Then MCUSR shows only the reset pin after a press of the reset
    button, and the robot drives: the button counts as a command."""
    for one in outcomes(loader, full):
        assert one.resets > 0, one
        assert one.off_s is not None, one
        assert one.off_s <= OFF_S, one
        if one.cause == "reset pin" and loader in ("none", "old nano"):
            assert one.driven_s > 0, one
            continue
        assert one.driven_s == 0, one
        for_ever = loader == "old nano" and one.cause in ("watchdog", "stuck interrupt")
        assert one.obeys != for_ever, one
