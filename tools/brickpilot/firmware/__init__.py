"""One's own robot into firmware: its constants in fixed point, the image of a board, and its flight in simulation."""
