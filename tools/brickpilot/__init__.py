"""Brickpilot: fly, compare, calibrate a LEGO-RCX-class differential-drive robot."""

__version__ = "0.1.0"
