"""Conducts a campaign in a folder: flies the runs that are missing, and writes table, summary and page."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from brickpilot.campaign import designs, engine, pictures, runs
from brickpilot.campaign.crew import Part, Workers
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.file import runs as count_of
from brickpilot.campaign.store import Parts
from brickpilot.campaign.summary import Table, summary
from brickpilot.data.toml_file import write_whole
from brickpilot.report import campaign_page

TABLE, SUMMARY, PAGE = "runs.parquet", "summary.json", "report.html"


def conduct(
    campaign: Campaign, folder: Path, workers: Workers, show: Callable[[int, int, str], None], command: str
) -> dict[str, Any]:
    """Flies the runs that `folder` does not hold, writes its files, and returns the content of `summary.json`.

    Args:
        show: called with (parts done, all parts, text).
        command: the command line that conducts this campaign; with `--replay` it flies one run again.

    Raises:
        InputError: the folder holds another campaign, or the workers cannot be reached.
        WorkFailedError: the disk is full, or no worker is left. Finished parts stay, and the same command resumes.
    """
    keys = [part.key for part in runs.parts(campaign)]
    identity = {"campaign": campaign.identity(), "runs": count_of(campaign), "design": designs.made_by(campaign)}
    with Parts(folder, identity) as parts:
        done = parts.done()
        left = (part for part in runs.parts(campaign) if part.key not in done)

        def keep(part: Part, rows: Any) -> None:
            parts.write(part.key, rows)

        what = f"parts of {runs.part_size(campaign)} runs or fewer"
        progress = engine.Progress(show, total=len(keys), done=len(done), what=what)
        if len(done) < len(keys):
            engine.run(runs.fly, left, keep=keep, workers=workers, progress=progress)
        parts.merge(keys, folder / TABLE)
        table = Table(folder / TABLE)
        found = summary(campaign, table)
        write_whole(folder / SUMMARY, json.dumps(found, indent=2, allow_nan=False) + "\n")
        drawn = pictures.histograms(table, found["figures"]), pictures.scatters(campaign, table, found["sensitivity"])
        write_whole(folder / PAGE, campaign_page.page(found, *drawn, command))
    return found
