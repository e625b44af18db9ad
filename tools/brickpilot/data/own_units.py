"""The unit, the frame and the sign in which a data set states its signals. Results are shown in them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from brickpilot.data.dataset import Dataset
from brickpilot.data.signals import SIGNALS, TURNS_WITH_FRAME

FRAME_WORDS = {
    "FLU": "x forward, y to the left, yaw counter-clockwise positive",
    "FRD": "x forward, y to the right, yaw clockwise positive",
}


@dataclass(frozen=True)
class OwnUnit:
    """How a data set states one signal.

    Attributes:
        unit: as the data set names it.
        per_si: how many of it are one SI unit, above 0.
        sign: -1 if the data set's frame reverses the signal, else 1.
    """

    unit: str
    per_si: float = 1.0
    sign: float = 1.0

    def value(self, si: float) -> float:
        """Returns a value in SI and the paper's frame as the data set would state it."""
        return self.sign * self.per_si * si

    def size(self, si: float) -> float:
        """Returns a size without a sign, such as an rms."""
        return self.per_si * si


def own_units(dataset: Dataset, signals: Iterable[str]) -> dict[str, OwnUnit]:
    """Returns signal -> how the data set states it; a signal that it does not state, such as a rate, is in SI."""
    return {name: own_unit(dataset, name) for name in signals}


def own_unit(dataset: Dataset, signal: str) -> OwnUnit:
    """Returns how the data set states a signal. If it writes the SI unit in another way, this is kept."""
    stated = dataset.signals.get(signal)
    sign = -1.0 if dataset.frame == "FLU" and signal in TURNS_WITH_FRAME else 1.0
    if stated is None or stated.to_si == 1.0:
        return OwnUnit(SIGNALS[signal].unit, 1.0, sign)
    return OwnUnit(stated.unit, 1 / stated.to_si, sign)


def frame_text(dataset: Dataset) -> str:
    """Returns the frame of a data set in words; empty for a motor, which has none."""
    return "" if dataset.vehicle == "motor" else f"{dataset.frame}: {FRAME_WORDS[dataset.frame]}"
