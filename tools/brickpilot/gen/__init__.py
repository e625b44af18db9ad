"""Generated files: made from the vehicle file, committed, and compared by ``python -m brickpilot.gen --check``."""
