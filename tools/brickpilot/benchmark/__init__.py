"""Benchmarks: how often discovery is right, how fast the simulator is, what a step costs on the RCX."""
