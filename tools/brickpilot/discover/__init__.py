"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next.

`brickpilot.discover` is this room of the package and also the public function: `brickpilot.discover(dataset)` calls
`pipeline.discover`. An import of any module in here would otherwise put the room in the place of the function.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any


class _CallableRoom(ModuleType):
    """A package that can be called; `inspect.signature` and `help` find the function behind it."""

    @property
    def __wrapped__(self) -> Any:
        return importlib.import_module("brickpilot.discover.pipeline").discover

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.__wrapped__(*args, **kwargs)


sys.modules[__name__].__class__ = _CallableRoom
