"""The robot's own questions: missions that tell the possible explanations apart, flown until one is left."""

from brickpilot import make_callable

make_callable(__name__)
