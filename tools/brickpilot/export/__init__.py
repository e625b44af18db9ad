"""Vehicles and runs for other programs: FMU, MJCF, URDF, MCAP, Parquet."""
