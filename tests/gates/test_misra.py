"""The MISRA C gate fails if a file has a finding more or less than its count, or if a rule has no deviation."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from misra import check

FOUND = [("hal/a.c", 1, "5.9"), ("hal/a.c", 7, "5.9"), ("firmware/b.c", 3, "10.1")]
ALLOWED = {("5.9", "hal"): "why", ("10.1", "firmware"): "why"}


@pytest.fixture(autouse=True)
def counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writes the counts of FOUND to a separate file."""
    monkeypatch.setattr(check, "COUNTS", tmp_path / "counts.toml")
    monkeypatch.setattr(check, "_tool", lambda: "Cppcheck 1.0")
    monkeypatch.setattr(sys, "argv", ["check.py", "--write"])
    assert check.told(FOUND, ALLOWED) == []
    monkeypatch.setattr(sys, "argv", ["check.py"])
    assert check.told(FOUND, ALLOWED) == []


def test_a_finding_more_of_a_rule_that_is_listed_fails() -> None:
    said = check.told([*FOUND, ("hal/a.c", 9, "5.9")], ALLOWED)
    assert "hal/a.c:9: rule 5.9, one of 3 here; counts.toml allows 2" in said
    assert check.told([*FOUND, ("hal/other.c", 1, "5.9")], ALLOWED)


def test_a_finding_less_has_to_be_kept() -> None:
    assert check.told(FOUND[1:], ALLOWED) == ["counts.toml: rule 5.9 in hal/a.c: 1 and not 2; --write keeps it"]


def test_a_rule_without_a_deviation_fails_and_so_does_an_idle_deviation() -> None:
    assert "firmware/b.c:5: rule 11.3" in check.told([*FOUND, ("firmware/b.c", 5, "11.3")], ALLOWED)
    assert check.told(FOUND, ALLOWED | {("2.2", "hal"): "why"}) == ["deviations.toml: rule 2.2 in hal allows nothing"]


def test_counts_of_another_tool_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "_tool", lambda: "Cppcheck 2.0")
    with pytest.raises(SystemExit, match=r"counts\.toml is not of Cppcheck 2\.0"):
        check.told(FOUND, ALLOWED)
