"""Values that vary from run to run and from frame to frame. In both engines they depend only on these two numbers."""

from __future__ import annotations

import numpy as np

from hidden.recipe import Floats

FRAME_S = 0.05
"""Length of a frame of commands, s; each frame has its own delay."""

_GOLDEN = 0.618033988749895


def place(number: int) -> float:
    """Returns a value from -1 to 1 for run `number`. The values of all runs are spread evenly (golden ratio)."""
    return 2 * ((number + 1) * _GOLDEN % 1.0) - 1


def delays(time: Floats, number: int, delay: float, jitter: float) -> Floats:
    """Returns the delay in s of the command at each `time` (n,) s: `delay` +- `jitter`, one value for each frame."""
    frames = np.floor(time / FRAME_S).astype(np.int64)
    drawn = np.random.default_rng([97, number]).uniform(-1.0, 1.0, int(frames.max(initial=0)) + 1)
    return np.asarray(np.maximum(delay + jitter * drawn[frames], 0.0), dtype=float)
