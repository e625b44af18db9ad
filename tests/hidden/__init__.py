"""Makes data sets with hidden effects by independent physics; imports nothing of the program under test."""
