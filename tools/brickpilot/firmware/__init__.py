"""One's own robot into firmware: its constants in fixed point, the image of a board, and its flight in simulation."""

from brickpilot import make_callable

make_callable(__name__)
