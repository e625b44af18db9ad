"""Gains that hold for all robots that the data allow: a search over flights of drawn robots, and its judge."""

from brickpilot import make_callable

make_callable(__name__)
