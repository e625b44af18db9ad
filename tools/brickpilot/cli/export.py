"""`brickpilot export`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import model_files


@click.group()
def export() -> None:
    """Writes a model or a run for other programs."""


_model_option = click.option(
    "--model",
    "model_file",
    metavar="FILE",
    shell_complete=model_files,
    help="A model.toml of discover or calibrate, or your own; default the packaged robot.",
)


@export.command()
@_model_option
@click.option(
    "--fmi",
    "fmi",
    type=click.Choice(["3.0", "2.0", "both"]),
    default="3.0",
    show_default=True,
    help="The version of FMI. both: two files, with -fmi2 and -fmi3 in their names.",
)
@click.option("--sources-only", is_flag=True, help="Without a binary, which needs no C compiler here.")
@click.option("--out", metavar="FILE", help="The file to write; default NAME.fmu.")
def fmu(model_file: str | None, fmi: str, sources_only: bool, out: str | None) -> None:
    """Writes a model, effects included, as an FMU for co-simulation.

    Inputs are the voltages of the motors, outputs the signals of the plant, parameters those of the model and of its
    effects. The FMU holds the C sources and a binary for this machine, made by the C compiler of CC, or else cc. Its
    numbers are those of `brickpilot run`.
    """
    for one in _written(model_file, "fmu", out, fmi=fmi, binary=not sources_only):
        click.echo(f"FMU: {one}")


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.xml.")
def mjcf(model_file: str | None, out: str | None) -> None:
    """Writes a model as MJCF, for MuJoCo 3.8 or newer.

    The file holds masses, wheels on the floor, motors, losses, and the effects that MuJoCo can simulate. The missing
    parts are printed, and listed in a comment of the file.
    """
    for one in _written(model_file, "mjcf", out):
        click.echo(f"MJCF: {one}")


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.urdf.")
def urdf(model_file: str | None, out: str | None) -> None:
    """Writes a model as URDF: links, masses, wheels, losses and limits.

    The missing parts are printed, and listed in a comment of the file.
    """
    for one in _written(model_file, "urdf", out):
        click.echo(f"URDF: {one}")


def _written(what: str | None, kind: str, out: str | None, **options: Any) -> tuple[Path, ...]:
    """Writes the files, prints the missing parts, and returns the files."""
    from brickpilot.public.making import export

    made = export(what, kind, out, **options)
    for one in made.left_out:
        click.echo(f"not in the file: {one}")
    return made.files


@export.command()
@click.argument("source", metavar="SOURCE")
@click.option("--out", metavar="FILE", help="The file to write; default SOURCE with the ending .mcap.")
def mcap(source: str, out: str | None) -> None:
    """Writes a run as MCAP, and a layout for Foxglove beside it.

    SOURCE is a run folder of `run` or `hil`, or a recording of `hil --record`. The file has every column and every
    signal at every sample, as JSON with a schema, and the poses of a run. The layout has the same name and ends in
    .foxglove.json.
    """
    content, layout = _written(source, "mcap", out)
    click.echo(f"MCAP: {content}")
    click.echo(f"layout of Foxglove: {layout}")


@export.command()
@click.argument("source", metavar="DIR")
@click.option("--out", metavar="FILE", help="The file to write; default DIR.parquet.")
def parquet(source: str, out: str | None) -> None:
    """Writes the log of the run folder DIR as Parquet.

    Each column has its unit in its metadata. A flight over a link gives a second file, which ends in -ticks.parquet.
    """
    for one in _written(source, "parquet", out):
        click.echo(f"Parquet: {one}")
