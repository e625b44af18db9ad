"""The RCX's processor: what an instruction costs, and a control step of the firmware."""
