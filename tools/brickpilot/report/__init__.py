"""Pages and plots: what the commands write for people to read."""
