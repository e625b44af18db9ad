"""What a delivery reports while it runs, and counts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Bytes that have arrived, bytes in all, and what to say."""


@dataclasses.dataclass
class Tally:
    """Packets that carried the image, and how many of them were sent again; the brick's answers count as theirs."""

    packets: int = 0
    sent_again: int = 0

    def tried(self, again: bool) -> None:
        """Counts one packet."""
        self.packets += 1
        self.sent_again += again
