"""Hardware in the loop: the plant at this end of a link, a brick at the other. The manual is hal/README.md."""
