"""The result of a function that writes a folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, repr=False)
class Made:
    """A folder that was written.

    Attributes:
        folder: with the page, the figures and the other files of the command of the same name.
        sentence: the result in words.
        figures: the output of `--json`, SI.
    """

    folder: Path
    sentence: str
    figures: Mapping[str, Any]

    def __repr__(self) -> str:
        """Returns the sentence and the folder."""
        return f"{self.sentence}\n  in {self.folder}, with {len(self.figures)} figures"
