"""`brickpilot bench`: the speed of the simulator and the links, compared with peers.

The cost of a control step on a brick, and the growth of time with the amount of work, are measured in `tests/lab`.
"""
