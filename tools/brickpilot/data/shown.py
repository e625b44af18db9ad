"""The display of all results: as a table in a notebook, and as values for JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import brickpilot


class Result:
    """A result that a notebook shows as a table, and a terminal as a few lines of text."""

    def __init_subclass__(cls) -> None:
        """Gives each subclass the short text of `Result.__repr__`, because a dataclass would show all fields."""
        super().__init_subclass__()
        if "__repr__" not in vars(cls):
            cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def __repr__(self: Any) -> str:
        """Returns a few lines of text, through `brickpilot`, because this module may not import `report`."""
        return brickpilot.to_text(self)

    def _repr_html_(self: Any) -> str:
        """Returns the HTML table that `report` makes."""
        return brickpilot.to_html(self)


def valid(value: Any) -> Any:
    """Returns `value` as JSON can hold it: records as objects, sequences as lists, and None for NaN and Infinity."""
    if hasattr(value, "to_json"):
        value = value.to_json()
    elif dataclasses.is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {key: valid(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [valid(entry) for entry in value]
    if isinstance(value, float):  # numpy's float64 is a float, too
        return float(value) if math.isfinite(value) else None
    return value
