"""Gains that hold for all robots that the data allow: a search over flights of drawn robots, and its judge."""
