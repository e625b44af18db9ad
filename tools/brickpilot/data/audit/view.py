"""One run under audit, the behaviour of channels across all runs, and which drive moves which channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.audit.held import Held
from brickpilot.data.signals import of_motors

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_FROZEN = 20
"""Number of equal samples: fewer are never reported as frozen."""

_REVERSES = 0.3  # share of samples at which noise changes direction
_REPEATS = 0.02  # share of repeats of a channel that changes with every sample


@dataclass(frozen=True, eq=False)
class RunView:
    """One run under audit.

    Attributes:
        outputs: blanked as faults are found.
        resolution: by signal, SI.
        held: the channels that hold each sample for several rows (`held`).
    """

    time: Vector
    inputs: Mapping[str, Vector]
    outputs: dict[str, Vector]
    resolution: Mapping[str, float]
    held: Mapping[str, Held] = field(default_factory=dict)

    def sampled(self, name: str) -> NDArray[np.intp]:
        """Returns the rows with a known, new sample of a channel."""
        known = np.isfinite(self.outputs[name])
        return np.flatnonzero(known & self.held[name].fresh if name in self.held else known)

    def once(self, name: str, part: slice = slice(None)) -> Vector:
        """Returns the values of a channel in a part of the run, each held sample once."""
        values = self.outputs[name][part]
        return values[self.held[name].fresh[part]] if name in self.held else values

    @cached_property
    def drives(self) -> Mapping[str, Vector]:
        """See `drives`."""
        return drives(self.inputs)

    @cached_property
    def interval(self) -> float:
        """s between samples, the median."""
        return float(np.median(np.diff(self.time)))


class AcrossRuns:
    """How the channels behave in all runs together. Each result is computed when it is first needed, and kept."""

    def __init__(self, views: Sequence[RunView]) -> None:
        self.views = views
        self._noise: dict[str, bool] = {}
        self._usual_drive: dict[str, float | None] = {}

    def is_noise(self, name: str) -> bool:
        """Whether a signal changes direction at most samples: noise does, motion does not."""
        if name not in self._noise:
            changes = np.concatenate([np.diff(one.outputs[name]) for one in self.views])
            self._noise[name] = bool(np.mean(changes[1:] * changes[:-1] < 0.0) > _REVERSES)
        return self._noise[name]

    def usual_drive(self, name: str) -> float | None:
        """Returns the mean size of a channel's drive while the channel moves.

        None: the channel repeats values outside long stretches of one value.
        """
        if name not in self._usual_drive:
            self._usual_drive[name] = self._drive_while_moving(name)
        return self._usual_drive[name]

    def _drive_while_moving(self, name: str) -> float | None:
        repeats = samples = 0
        level = 0.0
        for one in self.views:
            same = np.diff(one.outputs[name]) == 0.0
            outside = np.isfinite(one.outputs[name])
            for first, last in stretches(same, LEAST_FROZEN - 1):
                same[first:last] = False
                outside[first : last + 1] = False
            repeats += int(np.count_nonzero(same))
            samples += int(np.count_nonzero(outside))
            level += float(np.sum(np.abs(one.drives[driven_by(name)][outside])))
        return level / samples if samples >= LEAST_FROZEN and repeats <= _REPEATS * samples else None


def stretches(mask: Mask, least: int = 1) -> list[tuple[int, int]]:
    """Returns start and stop (exclusive) of each stretch of `least` true values or more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    long = np.diff(edges)[::2] >= least
    return list(zip(edges[::2][long].tolist(), edges[1::2][long].tolist(), strict=True))


def drives(inputs: Mapping[str, Vector]) -> dict[str, Vector]:
    """Returns the drives "left", "right" and "yaw" (left less right), or "shaft", in the inputs' unit.

    A drive is 0 where its motor floats.
    """
    columns = np.nan_to_num(of_motors(inputs, catalogue.parameter("half_track").preset)).T
    if len(columns) == 1:
        return {"shaft": columns[0]}
    return {"left": columns[0], "right": columns[1], "yaw": columns[0] - columns[1]}


def driven_by(name: str) -> str:
    """Returns which of the `drives` moves what a channel measures; "": more than one of them."""
    if name.endswith(("_left", "_right")):
        return name.rsplit("_", 1)[1]
    if name.startswith("yaw_"):
        return "yaw"
    return "shaft" if name in {"speed", "angle", "position", "velocity", "current", "force"} else ""
