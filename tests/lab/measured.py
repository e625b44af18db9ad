"""Names the state of the checkout at which a result was measured. Each result and each table contains this name."""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

UNKNOWN = "a commit that was not kept"


@cache
def state() -> str:
    """Returns the commit of the checkout and today's date, as "`1a2b3c4` of 2026-11-23"; notes uncommitted changes."""
    asked = ("git", "-C", str(Path(__file__).parent), "describe", "--always", "--exclude=*", "--dirty=, changed,")
    told = subprocess.run(asked, capture_output=True, text=True, check=False)
    commit, *changed = told.stdout.strip().split(",", 1)
    return f"`{commit}`{',' + changed[0] if changed else ''} of {datetime.now(UTC):%Y-%m-%d}" if commit else UNKNOWN


def told(states: Iterable[str | None], what: str) -> str:
    """Returns a text with the states at which results were measured, the most frequent first.

    Args:
        states: the state of each result; None: unknown.
        what: the plural word for the results in this text.
    """
    counted = Counter(one or UNKNOWN for one in states)
    found = [one if len(counted) == 1 else f"{one} ({number} {what})" for one, number in counted.most_common()]
    return f"measured at {', '.join(found)}" if found else f"no {what}"
