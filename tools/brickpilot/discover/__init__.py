"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next.

`brickpilot.discover` is this room of the package and also the public function. `make_callable` keeps the room callable,
also after an import of one of its modules.
"""

from brickpilot import make_callable

make_callable(__name__)
