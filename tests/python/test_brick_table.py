"""firmware/README.md holds the table of bricks that brick_table.py writes from the kept figures."""

from __future__ import annotations

import json
import re

import brick_table


def test_the_readme_has_the_table_of_the_kept_figures() -> None:
    results = json.loads(brick_table.FIGURES.read_text())
    assert set(results) == set(brick_table.NAMES)
    readme = brick_table.README.read_text(encoding="utf-8")
    assert brick_table.written(readme, results) == readme


def test_every_brick_has_a_share_of_the_period_for_each_stage_of_a_step() -> None:
    rows = brick_table.table(json.loads(brick_table.FIGURES.read_text())).splitlines()
    of_stages = [row for row in rows if "%" in row][: brick_table.STAGES.index("step") + 1]
    assert len(of_stages) == brick_table.STAGES.index("step") + 1
    for row in of_stages:
        shares = [int(share) for share in re.findall(r"(\d+)%", row)]
        assert len(shares) == len(brick_table.NAMES), row
        assert max(shares) < 100
