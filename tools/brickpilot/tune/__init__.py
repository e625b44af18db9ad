"""Tunes gains for all robots that the data allow: a search over flights of drawn robots, and a final comparison."""

from brickpilot import make_callable

make_callable(__name__)
