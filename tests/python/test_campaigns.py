"""The long campaigns, `tests/run campaigns`: they take hours. The other files run a small part of each."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from command import lab

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.campaign


def test_no_fault_of_a_thousand_reaches_the_motors() -> None:
    done = subprocess.run(
        [sys.executable, "tests/loop/fault_matrix.py", "1000"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("suite", ["single", "pairs", "triples", "none", "odd"])
def test_discovery_is_right_as_often_as_is_asked(suite: str) -> None:
    """The 95 % interval of each share overlaps the required range.

    build/campaigns keeps the results, so that the next run continues an interrupted one: delete it for a new start.
    """
    options = ("--suite", suite, "--jobs", "1", "--out", str(ROOT / "build/campaigns" / suite), "--json")
    done = lab("discover", *options, cwd=ROOT, timeout=72 * 3600)
    assert done.returncode == 0, done.stderr
    table = json.loads(done.stdout)
    assert table["errors"] == {}
    shares = [claim for claim in table["claims"]["all"] if claim["holds"] is not None and claim["interval"] is not None]
    assert shares
    missed = [
        f"{claim['what']}: {claim['value']:.3f} of {claim['of']}, asked for {claim['wanted']}"
        for claim in shares
        if claim["interval"][1] < claim["wanted"][0] or claim["interval"][0] > claim["wanted"][1]
    ]
    assert missed == []
