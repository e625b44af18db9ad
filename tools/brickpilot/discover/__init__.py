"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next.

`brickpilot.discover` is this package and also the public function. `make_callable` makes the package callable like that
function, and the package stays callable when one of its modules is imported.
"""

from brickpilot import make_callable

make_callable(__name__)
