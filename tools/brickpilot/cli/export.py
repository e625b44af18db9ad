"""`brickpilot export`."""

from __future__ import annotations

from typing import Any

import click

from brickpilot.cli.terminal import model_option


@click.group()
def export() -> None:
    """Writes a model or a run for other programs."""


_model_option = model_option("A model.toml of discover or calibrate, or your own; default the packaged robot.")


@export.command()
@_model_option
@click.option(
    "--fmi",
    type=click.Choice(["3.0", "2.0", "both"]),
    default="3.0",
    show_default=True,
    help="The version of FMI. both: two files, with -fmi2 and -fmi3 in their names.",
)
@click.option("--sources-only", is_flag=True, help="Leave out the binary, so that no C compiler is needed here.")
@click.option("--out", metavar="FILE", help="The file to write; default NAME.fmu.")
def fmu(model: str | None, fmi: str, sources_only: bool, out: str | None) -> None:
    """Writes a model, effects included, as an FMU for co-simulation.

    The inputs are the voltages of the motors, and the outputs are the signals of the plant. The parameters are those of
    the model and of its effects. The FMU holds the C sources and a binary for this machine, made by the C compiler of
    CC, or else cc. The FMU gives the same numbers as `brickpilot run`.
    """
    _write(model, "fmu", out, fmi=fmi, binary=not sources_only)


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.xml.")
def mjcf(model: str | None, out: str | None) -> None:
    """Writes a model as MJCF, for MuJoCo 3.8 or newer.

    The file holds masses, wheels on the floor, motors, losses, and the effects that MuJoCo can simulate. The missing
    parts are printed, and listed in a comment of the file.
    """
    _write(model, "mjcf", out)


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.urdf.")
def urdf(model: str | None, out: str | None) -> None:
    """Writes a model as URDF: links, masses, wheels, losses and limits.

    The missing parts are printed, and listed in a comment of the file.
    """
    _write(model, "urdf", out)


@export.command()
@click.argument("source", metavar="SOURCE")
@click.option("--out", metavar="FILE", help="The file to write; default SOURCE with the ending .mcap.")
def mcap(source: str, out: str | None) -> None:
    """Writes a run as MCAP, and a layout for Foxglove beside it.

    SOURCE is a run folder of `run` or `hil`, or a recording of `hil --record`. The file has every column and every
    signal at every sample, as JSON with a schema, and the poses of a run. The layout has the same name and ends in
    .foxglove.json.
    """
    _write(source, "mcap", out, "MCAP", "layout of Foxglove")


@export.command()
@click.argument("source", metavar="DIR")
@click.option("--out", metavar="FILE", help="The file to write; default DIR.parquet.")
def parquet(source: str, out: str | None) -> None:
    """Writes the log of the run folder DIR as Parquet.

    Each column has its unit in its metadata. A flight over a link gives a second file, which ends in -ticks.parquet.
    """
    _write(source, "parquet", out, "Parquet")


def _write(what: str | None, kind: str, out: str | None, *labels: str, **options: Any) -> None:
    """Writes the files; prints the missing parts, then each file with its label. Further files have the last label."""
    from brickpilot.public.making import export

    made = export(what, kind, out, **options)
    for part in made.left_out:
        click.echo(f"not in the file: {part}")
    labels = labels or (kind.upper(),)
    for number, file in enumerate(made.files):
        click.echo(f"{labels[min(number, len(labels) - 1)]}: {file}")
