"""`brickpilot bench`: how fast the simulator is, and what a control step costs on a brick.

speed.py           the simulator and the links, beside a peer in the same process
scaling.py         how time grows with the amount of work
control_peers.py   the control law on a brick's processor, beside other arithmetic
rcx_budget.py      instructions, states, stack and bytes of a control step on the H8 simulator; the kernel's share
h8_states.py       states of each H8/300 instruction
avr_budget.py      cycles, stack and bytes of a control period on simavr, drivers and interrupts included
"""
