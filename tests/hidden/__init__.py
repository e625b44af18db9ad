"""Makes data sets with hidden effects. The physics is written again here: nothing of Brickpilot is imported."""
