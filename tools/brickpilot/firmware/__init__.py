"""Makes firmware for a user's robot: constants in fixed point, the image for a board, and a simulated flight."""

from brickpilot import make_callable

make_callable(__name__)
