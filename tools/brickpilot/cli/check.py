"""`brickpilot check`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, jobs_option, seed_option, wiring_lines


@click.command()
@click.argument("dataset")
@seed_option
@jobs_option
@as_json
def check(dataset: str, seed: int, jobs: int, as_json: bool) -> None:
    """Shows within seconds what a measured DATASET can tell.

    It shows timing, noise and damage, what the runs tell about each nominal value, which effects they would show and
    from which size, which manoeuvres would tell more, and how long discover will take. It writes nothing.
    """
    from brickpilot.data import reading
    from brickpilot.readiness import data_check as check_module
    from brickpilot.report import check_text

    measured = reading.read(Path(dataset))
    wiring = [one.sentence for one in measured.wiring]
    found = check_module.check(measured, seed=seed, jobs=jobs)
    if as_json:
        click.echo(json.dumps({"wiring": wiring, **found.to_json()}, allow_nan=False))
        return
    for line in (*wiring_lines(wiring), *check_text.lines(found)):
        click.echo(line)
