"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next.

`brickpilot.discover` is this room of the package and also the public function. An import of any module in here would
otherwise put the room in the place of the function.
"""

from brickpilot import make_callable

make_callable(__name__)
