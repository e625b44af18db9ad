"""What changed between recordings of one machine.

`brickpilot.changed` is this room of the package and also the public function. An import of any module in here would
otherwise put the room in the place of the function.
"""

from brickpilot import make_callable

make_callable(__name__)
