"""Further commands that `tests/lab` calls. They list the sets of a suite, and add an experiment to a set.

``python -m hidden.benchmark list SUITE`` prints name and seed of each set, in order. ``python -m hidden.benchmark
add FOLDER OUT --manoeuvre TABLE.json`` writes OUT/NAME: the set with one more run, made by the same engine with the
same truth. With ``--wheel-speeds`` instead it writes the same runs with measured wheel speeds.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from hidden import folder, measure, suites
from hidden.manoeuvre import Manoeuvre, from_table
from hidden.recipe import Recipe, Vehicle

ADDED = "next_experiment"
"""The name of the added run."""


def recipe_of(data: Path) -> Recipe:
    """Returns the recipe of the set in `data` from its truth, with the voltages of its logs, which have five digits."""
    facts = json.loads(data.with_name(f"{data.name}.truth.json").read_text(encoding="ascii"))["recipe"]
    runs = tuple(_driven(data, name) for name in facts["runs"])
    return Recipe(**{**facts, "vehicle": Vehicle(**facts["vehicle"]), "runs": runs})


def _driven(data: Path, run: str) -> Manoeuvre:
    time, left, right = np.loadtxt(data / f"{run}.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2)).T.tolist()
    return Manoeuvre(run, tuple(time), tuple(left), tuple(right), time[-1])


def with_run(data: Path, added: Manoeuvre, out: Path) -> Path:
    """Writes OUT/NAME: the set in `data` with one more fit run, `added`, which is driven after the other runs."""
    recipe = recipe_of(data)
    longer = replace(recipe, runs=(*recipe.runs, replace(added, name=ADDED)))
    logged = measure.log(measure.sense(measure.tracks(longer), longer), longer)[-1]
    made = shutil.copytree(data, out / data.name)
    table = folder._table(longer, longer.runs[-1].held(longer.sample_s), logged)
    (made / f"{ADDED}.csv").write_text(table, encoding="ascii")
    with (made / "dataset.toml").open("a", encoding="ascii") as file:
        file.write(f'\n[[runs]]\nname = "{ADDED}"\nfile = "{ADDED}.csv"\nrole = "fit"\n')
    return made


def with_wheel_speeds(data: Path, out: Path) -> Path:
    """Writes OUT/NAME: the same runs, with measured wheel speeds added."""
    return folder.write(replace(recipe_of(data), sensors="imu+encoders"), out)


def main() -> int:
    parser = argparse.ArgumentParser(prog="hidden.benchmark")
    commands = parser.add_subparsers(dest="command", required=True)
    listing = commands.add_parser("list")
    listing.add_argument("suite", choices=sorted(suites.SUITES))
    listing.add_argument("--seed-offset", type=int, default=suites.CALIBRATION)
    listing.add_argument("--engine", choices=("mujoco", "planar"), default="mujoco")
    add = commands.add_parser("add")
    add.add_argument("data", type=Path)
    add.add_argument("out", type=Path)
    what = add.add_mutually_exclusive_group(required=True)
    what.add_argument("--manoeuvre", type=Path, metavar="TABLE.json", help="the next_experiment of a verdict")
    what.add_argument("--wheel-speeds", action="store_true")
    options = parser.parse_args()
    if options.command == "list":
        for recipe in suites.SUITES[options.suite](options.seed_offset, options.engine):
            sys.stdout.write(json.dumps({"name": recipe.name, "seed": recipe.seed}) + "\n")
    elif options.wheel_speeds:
        with_wheel_speeds(options.data, options.out)
    else:
        table = json.loads(options.manoeuvre.read_text(encoding="utf-8"))
        with_run(options.data, from_table(table), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
