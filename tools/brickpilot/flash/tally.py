"""Progress and packet counts of a delivery."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Takes the bytes that have arrived, the bytes in all, and a text."""


@dataclasses.dataclass
class Tally:
    """Counts the packets that carried the image, and those of them that were sent again."""

    packets: int = 0
    sent_again: int = 0

    def tried(self, again: bool) -> None:
        """Counts one packet."""
        self.packets += 1
        self.sent_again += again
