"""Campaigns: many flights of randomly drawn robots, a table of their figures, and its summary."""

from brickpilot import make_callable

make_callable(__name__)
