"""What the runs of a data set excite."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from brickpilot.discover.gates import LEAST_PERIODS_PER_TURN


@dataclass(frozen=True)
class Excitation:
    """How far a vehicle was driven, and what of it was measured.

    Attributes:
        largest: the largest command, under "voltage", and the largest reading of each signal.
        orders: orders (periods per turn) at which the wheels' acceleration repeats.
        least_order: an effect of a lower order is not periodic: it shows less than about one period.
        wheels_measured: wheel angles or speeds were measured, so that simulations can start from measured states.
        windowed: simulations do start so, every short window, and the wheels keep their phase.
    """

    largest: Mapping[str, float]
    orders: tuple[float, ...] = ()
    least_order: float = LEAST_PERIODS_PER_TURN
    wheels_measured: bool = False
    windowed: bool = False
