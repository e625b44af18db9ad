"""Runs campaigns in this process: to start other processes would take longer than the flights of a test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from brickpilot.campaign import file, workers
from brickpilot.campaign.run_campaign import run_campaign


def conducted(path: Path, out: Path, count: int | None = None) -> dict[str, Any]:
    """Runs the campaign of a file in this process and returns its summary."""
    given = file.load(path, count=count)
    return run_campaign(given, out, workers.Here(), lambda *_: None, f"brickpilot campaign {path.name}")
