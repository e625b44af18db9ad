"""`brickpilot import`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError


@click.command("import")
@click.argument("kind", type=click.Choice(["wpilib", "matlab", "table", "rcx"]))
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--out", required=True, metavar="DATASET", help="The folder to write.")
@click.option(
    "--map",
    "mapping",
    multiple=True,
    metavar="SIGNAL=NAME[:UNIT]",
    help="The place of a signal: a MATLAB variable, NAME[INDEX] for a column of a matrix, a column's name, or a "
    "column's number from 0. The unit is SI unless UNIT is given; repeatable.",
)
@click.option(
    "--vehicle", type=click.Choice(["diff_drive", "motor"]), help="The kind of vehicle; matlab and table need it."
)
@click.option(
    "--frame",
    type=click.Choice(["FRD", "FLU"]),
    default="FRD",
    show_default=True,
    help="The frame of sway and yaw; for matlab and table.",
)
@click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable.")
@click.option("--name", help="The name of the data set; default: the name of the folder.")
@click.option("--delimiter", default=",", show_default=True, help="The character between the columns of a table.")
@click.option("--header", is_flag=True, help="The table's first line names its columns.")
@as_json
def import_log(
    kind: str, files: tuple[str, ...], out: str, mapping: tuple[str, ...], vehicle: Vehicle | None, frame: Frame,
    nominal: tuple[str, ...], name: str | None, delimiter: str, header: bool, as_json: bool,
) -> None:  # fmt: skip
    """Turns logs of other tools into a data set: WPILib SysId JSON (old and new), MATLAB files, plain tables.

    brickpilot import wpilib linear.json angular.json --out drivetrain

    brickpilot import matlab DATA.mat --vehicle motor --map time=t --map voltage=vir --map position=qm --out axis

    brickpilot import table log.txt --vehicle motor --map time=0:ms --map duty=1 --map speed=2:rpm --out bench

    This reads the recording that an RCX holds, over the tower at a serial port:

    brickpilot import rcx /dev/ttyUSB0 --out bench
    """
    from brickpilot.importers.mapping import parse_nominal
    from brickpilot.importers.matlab import import_matlab
    from brickpilot.importers.rcx import import_rcx
    from brickpilot.importers.table import import_table
    from brickpilot.importers.wpilib import import_wpilib

    paths, known = [Path(file) for file in files], parse_nominal(nominal)
    if kind in ("wpilib", "rcx") and (mapping or vehicle):
        raise InputError(
            "works only with matlab and table; a WPILib file and a brick describe their own signals",
            field="--map or --vehicle",
        )
    if kind == "rcx":
        if len(paths) > 1:
            raise InputError("needs exactly one serial port, that of the tower", field="FILE")
        with progress_shown(as_json) as progress:
            made = import_rcx(paths[0], Path(out), nominal=known, name=name, progress=progress)
    elif kind == "wpilib":
        made = import_wpilib(paths, Path(out), nominal=known, name=name)
    elif vehicle is None:
        raise InputError(f"is needed to import {kind}", field="--vehicle")
    elif kind == "matlab":
        made = import_matlab(paths, Path(out), mapping, vehicle=vehicle, frame=frame, nominal=known, name=name)
    else:
        made = import_table(
            paths,
            Path(out),
            mapping,
            vehicle=vehicle,
            frame=frame,
            delimiter=delimiter,
            header=header,
            nominal=known,
            name=name,
        )
    if as_json:
        click.echo(json.dumps({"dataset": str(made.folder), "runs": list(made.runs), "notes": list(made.notes)}))
        return
    for note in made.notes:
        click.echo(f"note: {note}")
    click.echo(f"{made.folder}: {len(made.runs)} runs")
