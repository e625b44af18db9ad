"""Each claim of safety in tests/README.md names a test that exists."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def test_each_claim_has_its_test() -> None:
    named = re.findall(r"`([a-z_]+/[\w/]+\.(?:py|c))::(\w+)`", (TESTS / "README.md").read_text(encoding="utf-8"))
    assert len(named) > 10
    missing = [
        f"{file}::{test}"
        for file, test in named
        if not (TESTS / file).exists() or f"{test}(" not in (TESTS / file).read_text(encoding="utf-8")
    ]
    assert missing == []
