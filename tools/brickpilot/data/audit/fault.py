"""A data fault, the sentences that describe it, and the factors between units that are often confused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import isclose, pi
from typing import Literal

from brickpilot.data.signals import SIGNALS

Kind = Literal["swapped", "dropout", "clipped", "frozen", "sign", "unit", "clock", "collision"]

_MANY = 4  # a note names the runs if they are fewer than this; otherwise it gives their number
_UNITS = {
    "rad": {180 / pi: "degrees", 1 / (2 * pi): "turns"},
    "rad/s": {180 / pi: "degrees per second", 30 / pi: "rpm", 1 / (2 * pi): "turns per second"},
    "m": {1000.0: "mm", 100.0: "cm", 1 / 0.0254: "inches"},
    "m/s": {1000.0: "mm/s", 100.0: "cm/s", 1 / 0.0254: "inches per second"},
    "m/s^2": {1 / 9.80665: "multiples of g", 1000.0: "mm/s^2"},
    "A": {1000.0: "mA"},
    "V": {1000.0: "mV"},
    "s": {1000.0: "ms", 1e6: "microseconds", 1 / 60.0: "minutes"},
}
"""SI unit -> factor -> name of the unit that has this factor and is often confused with the SI unit."""

FACTORS = (180 / pi, 30 / pi, 2 * pi, 1000.0, 100.0, 1 / 0.0254, 25.4)
"""Factors between units: degrees, rpm or turns instead of radians; mm, cm or inches instead of m; mA instead of A."""

GRAVITY = 9.80665
"""Factor between m/s^2 and multiples of g. As it is close to 30 / pi, a ratio cannot tell the two factors apart."""

CLOCK_FACTORS = (1e3, 1e-3, 1e6, 1e-6)
"""Factors between units of time: ms or microseconds in place of s, and their inverses."""

_SAME = 1e-9  # two factors are equal if their relative difference is below this


@dataclass(frozen=True)
class Fault:
    """A stretch of damaged samples of one signal.

    Attributes:
        from_s, to_s: times of the first and the last damaged sample, s, on the run's own clock.
        factor: for "sign", "unit" and "clock": ratio of stated to true value, -1 if the sign is reversed; None if no
            single factor applies.
    """

    run: str
    signal: str
    kind: Kind
    from_s: float
    to_s: float
    factor: float | None = None

    def to_json(self) -> dict[str, str | float]:
        return {name: value for name, value in asdict(self).items() if value is not None}


def rows_note(found: Sequence[Fault], samples: int, of: int, start_s: float) -> str:
    """Describes faults of one kind in one signal of one run. `samples` of the run's `of` samples are damaged.

    Times in the note are relative to `start_s`, the run's start on its own clock, as on plots.
    """
    first = found[0]
    single = first.from_s == first.to_s
    begins, ends = first.from_s - start_s, first.to_s - start_s
    when = f"at {begins:.6g} s" if single else f"from {begins:.6g} to {ends:.6g} s"
    word = {"dropout": "drops out", "swapped": "is swapped with another column"}.get(first.kind, f"is {first.kind}")
    place = "" if len(found) == 1 else f" in {len(found)} places, first"
    return f"run {first.run}: {first.signal} {word}{place} {when}; {samples} of {of} samples are left out"


def channel_note(signals: Sequence[str], factor: float, runs: Sequence[str], of: int, against: Sequence[str]) -> str:
    """Describes channels that are `factor` times too large in `runs`. `of`: number of all runs in the data set.

    `against`: the channels that contradict `signals`; empty: the other runs contradict `signals`.
    """
    several = len(signals) > 1
    other = joined(against) if against else "the other runs" if len(runs) < of else "a plausible value"
    if factor == -1.0:
        fault = f"{'have' if several else 'has'} a reversed sign, compared with {other}"
    else:
        listed = _UNITS.get(SIGNALS[signals[0]].unit, {})
        unit = next((word for by, word in listed.items() if isclose(by, factor, rel_tol=1e-3)), "another unit")
        value = other if other == "a plausible value" else f"the value expected from {other}"
        fault = f"{'seem' if several else 'seems'} to be in {unit}: {float(f'{factor:.3g}'):g} times {value}"
    consequence = "left out"
    if any(SIGNALS[signal].kind != "output" for signal in signals):
        consequence = f"nothing measured in {'this run' if len(runs) == 1 else 'these runs'} is used"
    return f"{runs_named(runs, of)}: {joined(signals)} {fault}; {consequence}"


def collision_note(run: str, signals: Sequence[str], from_s: float) -> str:
    """Describes a collision that begins `from_s` after the run's start, as `signals` show it."""
    return (
        f"run {run}: {joined(signals)} {'lose' if len(signals) > 1 else 'loses'} speed at a constant command after "
        f"{from_s:.6g} s, as in a collision; what follows in this run is left out"
    )


def range_note(signal: str, runs: Sequence[str], of: int) -> str:
    """Describes a channel that is beyond its stated range in `runs`. `of`: number of all runs in the data set."""
    return f"{runs_named(runs, of)}: {signal} is far beyond its stated range, so it may be in another unit; left out"


def runs_named(runs: Sequence[str], of: int) -> str:
    if len(runs) == 1:
        return f"run {runs[0]}"
    if len(runs) == of:
        return "all runs"
    return f"runs {joined(runs)}" if len(runs) < _MANY else f"{len(runs)} of {of} runs, {runs[0]} the first"


def joined(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def usual_factors(name: str) -> tuple[float, ...]:
    """Returns the factors above 1 between a channel's own unit and units that are often confused with it."""
    listed = _UNITS.get(SIGNALS[name].unit if name in SIGNALS else "", {})
    return tuple(dict.fromkeys([*(max(by, 1 / by) for by in listed), 1000.0]))


def is_one_of(factor: float, listed: Iterable[float]) -> bool:
    """Whether the size of a factor, or the inverse of this size, is 1 or one of `listed`."""
    return any(abs(size / one - 1.0) < _SAME for one in (1.0, *listed) for size in (abs(factor), 1 / abs(factor)))
