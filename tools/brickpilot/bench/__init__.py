"""`brickpilot bench`: how fast the simulator and the links are, beside peers.

What a control step costs on a brick, and how time grows with the amount of work, is measured in `tests/lab`.
"""
