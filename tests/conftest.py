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
"""The slowest files, the slowest first: they run before all others, so that no processor is idle at the end."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="run the long campaigns, with all vectors and all data")
    parser.addoption("--most-skips", type=int, metavar="N", help="fail where more than N tests are skipped")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Ends the session if the installed package is older than the checkout; of xdist, only the controller checks this.

    Each worker of xdist gets one processor. Then a search makes no copies of its process: copies that wait for each
    other take a fifth of a search's time. Tests in real time keep all processors.
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
    """Leaves out the tests with the mark `campaign` unless --full is given, and puts the files of `LONGEST` first."""
    if not config.getoption("full"):
        out = [item for item in items if item.get_closest_marker("campaign")]
        if out:
            config.hook.pytest_deselected(items=out)
            items[:] = [item for item in items if item not in out]
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


def _counts(session: pytest.Session) -> tuple[int, int]:
    """Returns the number of tests that passed or failed, and the number of skipped tests."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    stats = {} if reporter is None else reporter.stats
    return sum(len(stats.get(name, ())) for name in ("passed", "failed", "xfailed")), len(stats.get("skipped", ()))


def _untested(session: pytest.Session) -> str | None:
    """Returns why a session without a failed test must count as failed; None: it passed."""
    ran, skipped = _counts(session)
    most = session.config.getoption("most_skips")
    if skipped and not ran:
        return f"all {skipped} tests were skipped: nothing was tested"
    if most is not None and skipped > most:
        return f"{skipped} tests were skipped, and {most} are the most: -rs tells why"
    return None


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Makes a session fail if all its tests were skipped, or more than --most-skips of them."""
    if exitstatus == 0 and not hasattr(session.config, "workerinput") and (why := _untested(session)):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        print(f"\n{why}")


@pytest.fixture(scope="session")
def full(request: pytest.FixtureRequest) -> bool:
    """Returns whether --full is given. Some tests have a long form, which runs only with --full."""
    return bool(request.config.getoption("full"))
