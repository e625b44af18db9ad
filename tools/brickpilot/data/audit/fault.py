"""What a fault of the data is, and the words for it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import isclose, pi
from typing import Literal

from brickpilot.data.signals import SIGNALS

Kind = Literal["swapped", "dropout", "clipped", "frozen", "sign", "unit", "clock"]

_MANY = 4  # runs are counted, not listed, from here on
_TAKEN_FOR = {
    ("rad", 180 / pi): "degrees",
    ("rad", 1 / (2 * pi)): "turns",
    ("rad/s", 180 / pi): "degrees per second",
    ("rad/s", 30 / pi): "rpm",
    ("rad/s", 1 / (2 * pi)): "turns per second",
    ("m", 1000.0): "mm",
    ("m", 100.0): "cm",
    ("m", 1 / 0.0254): "inches",
    ("m/s", 1000.0): "mm/s",
    ("m/s", 100.0): "cm/s",
    ("m/s", 1 / 0.0254): "inches per second",
    ("m/s^2", 1 / 9.80665): "multiples of g",
    ("m/s^2", 1000.0): "mm/s^2",
    ("A", 1000.0): "mA",
    ("V", 1000.0): "mV",
    ("s", 1000.0): "ms",
    ("s", 1e6): "microseconds",
    ("s", 1 / 60.0): "minutes",
}


@dataclass(frozen=True)
class Fault:
    """Damaged samples in a row: the first and the last at `from_s` and `to_s` of the run's own clock.

    `factor`: of "sign", "unit" and "clock", how many times too much the signal says, -1 where its sign is reversed;
    None where it is not one number.
    """

    run: str
    signal: str
    kind: Kind
    from_s: float
    to_s: float
    factor: float | None = None

    def to_json(self) -> dict[str, str | float]:
        return {name: value for name, value in asdict(self).items() if value is not None}


def rows_note(found: Sequence[Fault], samples: int, of: int) -> str:
    """On the damage of one kind to one signal of one run: `samples` of its `of` samples."""
    first = found[0]
    single = first.from_s == first.to_s
    when = f"at {first.from_s:.6g} s" if single else f"from {first.from_s:.6g} to {first.to_s:.6g} s"
    word = {"dropout": "drops out", "swapped": "is swapped with another column"}.get(first.kind, f"is {first.kind}")
    place = "" if len(found) == 1 else f" in {len(found)} places, first"
    return f"run {first.run}: {first.signal} {word}{place} {when}; {samples} of {of} samples are left out"


def channel_note(signals: Sequence[str], factor: float, runs: Sequence[str], of: int, against: Sequence[str]) -> str:
    """On channels that say `factor` times too much in `runs`, of the data set's `of` runs; `against`: who says so."""
    several = len(signals) > 1
    says = "say" if several else "says"
    if against:
        witness = f"what {joined(against)} {'say' if len(against) > 1 else 'says'}"
    elif len(runs) < of:
        witness = f"what {'they' if several else 'it'} {says} in the other runs"
    else:
        witness = "what can be"
    if factor == -1.0:
        said = f"{'go' if several else 'goes'} against {witness}: the sign is reversed"
    else:
        said = (
            f"{'look' if several else 'looks'} like {_other_unit(signals[0], factor)}: {_times(factor)} times {witness}"
        )
    spoilt = "left out"
    if any(SIGNALS[signal].kind != "output" for signal in signals):
        spoilt = "nothing measured in it is used" if len(runs) == 1 else "nothing measured in them is used"
    return f"{runs_named(runs, of)}: {joined(signals)} {said}; {spoilt}"


def range_note(signal: str, runs: Sequence[str], of: int) -> str:
    """On a channel that leaves its stated range in `runs`, of the data set's `of` runs."""
    return f"{runs_named(runs, of)}: {signal} goes far beyond its stated range, as in another unit; left out"


def _times(factor: float) -> str:
    return f"{float(f'{factor:.3g}'):g}"


def _other_unit(signal: str, factor: float) -> str:
    listed = (word for (unit, by), word in _TAKEN_FOR.items() if _is(signal, unit, by, factor))
    return next(listed, "another unit")


def _is(signal: str, unit: str, by: float, factor: float) -> bool:
    return SIGNALS[signal].unit == unit and isclose(by, factor, rel_tol=1e-3)


def runs_named(runs: Sequence[str], of: int) -> str:
    if len(runs) == 1:
        return f"run {runs[0]}"
    if len(runs) == of:
        return "all runs"
    return f"runs {joined(runs)}" if len(runs) < _MANY else f"{len(runs)} of {of} runs, {runs[0]} the first"


def joined(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last
