"""Hardware in the loop: the plant at one end of a link, a brick at the other. hal/README.md is the manual."""

from brickpilot import make_callable

make_callable(__name__)
