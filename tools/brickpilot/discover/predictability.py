"""Settles "none" or "unknown" where no explanation was found: something is missing if the error is predictable.

A machine is never explained to its sensors' noise. What no flexible model can predict on runs that it has not seen is
no effect that anyone could name.
"""

from __future__ import annotations

from brickpilot.discover import gates
from brickpilot.discover.finding import VerdictKind
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.written import Written
from brickpilot.discover.yardstick import Yardstick


def settled(verdict: Verdict, written: Written, yardstick: Yardstick) -> VerdictKind:
    """Returns the verdict; it is another one only where no explanation was found that is worth listing."""
    found = verdict.best if verdict.best.chosen else verdict.unclaimed
    listed = found is not None and verdict.removed_by(found) >= gates.WORTH_LISTING
    if written.composed is not None or written.kind not in ("none", "unknown") or listed:
        return written.kind
    shares = [_surely_predictable(yardstick, horizon) for horizon in yardstick.predictable]
    known = [one for one in shares if one is not None]
    if not known:
        return written.kind
    if written.kind == "unknown":
        return "unknown" if max(known) > gates.PREDICTABLE else "none"
    return "unknown" if max(known) > gates.CLEARLY_PREDICTABLE else "none"


def _surely_predictable(yardstick: Yardstick, horizon: str) -> float | None:
    """Returns the least share of the error on held-out runs that is predictable, at 95 %; on fit runs if none is."""
    one = yardstick.predictable[horizon]
    interval = one.held_out_interval if one.held_out is not None else one.interval
    return None if interval is None else interval[0]
