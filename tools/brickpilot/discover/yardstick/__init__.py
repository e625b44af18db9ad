"""The yardstick that a real machine can be held to."""

from brickpilot.discover.yardstick.measure import Reference, measure, reference
from brickpilot.discover.yardstick.record import Yardstick

__all__ = ["Reference", "Yardstick", "measure", "reference"]
