"""What changed between recordings of one machine.

`brickpilot.changed` is this package and also the public function. `make_callable` makes the package callable like the
function, also after one of its modules was imported.
"""

from brickpilot import make_callable

make_callable(__name__)
