"""``python -m hidden SUITE OUT``: writes a suite's data sets and their truths. PYTHONPATH must hold `tests`.

Existing data sets are kept, so that an interrupted call continues where it stopped.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path

from hidden import folder, suites
from hidden.recipe import Recipe


def _make(parent: Path, recipe: Recipe) -> str:
    folder.write(recipe, parent)
    return recipe.name


def main() -> int:
    parser = argparse.ArgumentParser(prog="hidden", description="writes data sets with hidden effects")
    parser.add_argument("suite", choices=sorted(suites.SUITES))
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed-offset", type=int, default=0, metavar="N", help="other noise and nominal values")
    parser.add_argument("--engine", choices=("mujoco", "planar"), default="mujoco")
    parser.add_argument(
        "--only", action="append", metavar="PATTERN", help="these names alone (shell pattern); may be given again"
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    options = parser.parse_args()
    recipes = suites.SUITES[options.suite](options.seed_offset, options.engine)
    if options.only:
        recipes = [recipe for recipe in recipes if any(fnmatchcase(recipe.name, pattern) for pattern in options.only)]
        if not recipes:
            parser.error(f"suite {options.suite} has no {', '.join(options.only)}")
    recipes = [recipe for recipe in recipes if not (options.out / recipe.name).exists()]
    make = partial(_make, options.out)
    if options.jobs > 1:
        with multiprocessing.Pool(options.jobs) as pool:
            for name in pool.imap_unordered(make, recipes, chunksize=4):
                sys.stdout.write(f"{name}\n")
    else:
        for recipe in recipes:
            sys.stdout.write(f"{make(recipe)}\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
