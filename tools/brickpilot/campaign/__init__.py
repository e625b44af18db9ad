"""Campaigns: many flights of drawn robots, their figures as a table, and what the table says."""

from brickpilot import make_callable

make_callable(__name__)
