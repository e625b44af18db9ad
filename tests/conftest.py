"""Options and order of all Python tests."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import brickpilot
import pytest
from installed import ROOT, outdated

LONGEST = [f"test_{name}.py" for name in (
    "h8_vectors", "h8_budget", "why_new_users", "discover_measured", "what_changed", "own_flights", "hidden_verdicts",
    "resets_at_every_tick", "hil_h8sim", "audit_channels", "guides", "discover_cli", "docs", "discover",
    "outputs_whole", "firmware_avr", "firmware", "discover_invariance", "late_commands",
)]  # fmt: skip
"""These files begin first, the longest first, so that no processor waits for the last of them at the end."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="run the long campaigns, with all vectors and all data")
    parser.addoption("--most-skips", type=int, metavar="N", help="fail where more than N tests are skipped")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Stops where the installed package is older than the checkout. Workers of xdist follow their controller.

    Each worker gets one processor, so that a search makes no copies of its process: copies that wait for each other
    cost a fifth of a search. Tests in real time keep all processors.
    """
    worker = getattr(session.config, "workerinput", None)
    if worker is not None and sys.platform == "linux" and session.config.option.markexpr != "realtime":
        processors = sorted(os.sched_getaffinity(0))
        number = int(worker["workerid"].removeprefix("gw"))
        os.sched_setaffinity(0, {processors[number % len(processors)]})
    if worker is None:
        first = next(outdated(ROOT, Path(brickpilot.__file__).parent), None)
        if first is not None:
            pytest.exit(first, returncode=1)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves campaigns out unless --full is given, and sorts the longest files to the front."""
    if not config.getoption("full"):
        out = [item for item in items if item.get_closest_marker("campaign")]
        if out:
            config.hook.pytest_deselected(items=out)
            items[:] = [item for item in items if item not in out]
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


def _counts(session: pytest.Session) -> tuple[int, int]:
    """Returns how many tests have ended, passed or not, and how many were skipped."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    stats = {} if reporter is None else reporter.stats
    return sum(len(stats.get(name, ())) for name in ("passed", "failed", "xfailed")), len(stats.get("skipped", ()))


def _untested(session: pytest.Session) -> str | None:
    """Returns why a run without a failure is none that passed."""
    ran, skipped = _counts(session)
    most = session.config.getoption("most_skips")
    if skipped and not ran:
        return f"all {skipped} tests were skipped: nothing was tested"
    if most is not None and skipped > most:
        return f"{skipped} tests were skipped, and {most} are the most: -rs tells why"
    return None


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fails a run that has tested nothing, or skipped more than --most-skips."""
    if exitstatus == 0 and not hasattr(session.config, "workerinput") and (why := _untested(session)):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        print(f"\n{why}")


@pytest.fixture(scope="session")
def full(request: pytest.FixtureRequest) -> bool:
    """Whether --full is given: the long form of a test that has two."""
    return bool(request.config.getoption("full"))
