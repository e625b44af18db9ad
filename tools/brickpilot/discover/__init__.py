"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next.

`brickpilot.discover` is this room of the package and also the public function. `make_callable` lets the room be called
as the function, also after an import of a module in here.
"""

from brickpilot import make_callable

make_callable(__name__)
