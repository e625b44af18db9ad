"""`brickpilot bench`: how fast the simulator is. What a control step costs on a brick is measured in `tests/lab`.

speed.py           the simulator and the links, beside a peer in the same process
scaling.py         how time grows with the amount of work
this_machine.py    the machine's processor, cores and compiler
"""
