"""Lets a robot fly missions that separate the possible explanations, until one explanation is left."""

from brickpilot import make_callable

make_callable(__name__)
