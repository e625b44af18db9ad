"""Writes models and runs as files for other programs: FMU, MJCF, URDF, MCAP, Parquet."""

from brickpilot import make_callable

make_callable(__name__)
