"""A small campaign as a program that tests can kill: 40 parts of 20 rows, kept in a folder and merged at the end.

python campaign_program.py FOLDER JOBS|SCHEDULER [slow]
"""

from __future__ import annotations

import sys
from pathlib import Path

import campaign_parts
from brickpilot.campaign import workers
from brickpilot.campaign.run_parts import Part, PartProgress, run_parts
from brickpilot.campaign.store import Parts

KEYS = [f"p{seed:04}" for seed in range(40)]
TABLE = "results.parquet"


def main(folder: Path, where: str, *, slow: bool = False) -> None:
    """Runs the missing parts, and merges all parts.

    `slow` makes each part last longer, so that a signal can arrive; the written bytes are the same.
    """
    chosen = workers.Local(int(where)) if where.isdecimal() else workers.Cluster(where)
    with Parts(folder, {"seeds": len(KEYS)}) as kept:
        done = kept.done()
        run_parts(
            campaign_parts.slow_table if slow else campaign_parts.table,
            (Part(key, seed) for seed, key in enumerate(KEYS) if key not in done),
            keep=lambda part, table: kept.write(part.key, table),
            workers=chosen,
            progress=PartProgress(lambda *_: None, len(KEYS), len(done)),
        )
        kept.merge(KEYS, folder / TABLE)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], slow="slow" in sys.argv[3:])
