"""`brickpilot bench`: the speed of the simulator and the links, compared with peers.

`tests/lab` measures the cost of a control step on a brick, and how time grows with the amount of work.
"""
