"""`brickpilot export`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brickpilot.cli.completion import model_files
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.vehicle.model import Model


@click.group()
def export() -> None:
    """Writes a model or a run for other programs."""


def _model(file: str | None) -> Model:
    from brickpilot.vehicle import model

    return model.load(file) if file else model.rcx()


def _file(out: str | None, default: Path) -> Path:
    """Returns the file to write. Raises InputError if `out` can only be a folder."""
    path = Path(out) if out else default
    if path.name in ("", ".."):
        raise InputError("is a folder; name a file", file=out)
    return path


def _beside(folder: Path, ending: str) -> Path:
    whole = folder.resolve()
    return (
        folder.parent / (whole.name + ending) if folder.name not in ("", "..") else whole.with_name(whole.name + ending)
    )


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
    from brickpilot.export import files
    from brickpilot.export import fmu as fmus

    model = _model(model_file)
    path = _file(out, Path(f"{fmus.identifier(model)}.fmu"))
    versions = fmus.VERSIONS if fmi == "both" else (fmi,)
    ends = {version: f"-fmi{version[0]}" if fmi == "both" else "" for version in versions}
    made = {
        path.with_name(f"{path.stem}{ends[version]}{path.suffix}"): fmus.archive(
            model, version, binary=not sources_only
        )
        for version in versions
    }
    files.write(made)
    for one in made:
        click.echo(f"FMU: {one}")


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.xml.")
def mjcf(model_file: str | None, out: str | None) -> None:
    """Writes a model as MJCF, for MuJoCo 3.8 or newer.

    Masses, wheels on the floor, motors and losses, and those effects that MuJoCo has a counterpart for. What is not in
    the file is printed, and stands in it as a comment.
    """
    from brickpilot.export import files
    from brickpilot.export import mjcf as mjcfs

    model = _model(model_file)
    path = _file(out, Path(f"{files.plain_name(model.name)}.xml"))
    made = mjcfs.write(model)
    files.write({path: made.text.encode()})
    _tell(f"MJCF: {path}", made.left_out)


@export.command()
@_model_option
@click.option("--out", metavar="FILE", help="The file to write; default NAME.urdf.")
def urdf(model_file: str | None, out: str | None) -> None:
    """Writes a model as URDF: links, masses, wheels, losses and limits.

    What is not in the file is printed, and stands in it as a comment.
    """
    from brickpilot.export import files
    from brickpilot.export import urdf as urdfs

    model = _model(model_file)
    path = _file(out, Path(f"{files.plain_name(model.name)}.urdf"))
    made = urdfs.write(model)
    files.write({path: made.text.encode()})
    _tell(f"URDF: {path}", made.left_out)


def _tell(line: str, left_out: Sequence[str]) -> None:
    for one in left_out:
        click.echo(f"not in the file: {one}")
    click.echo(line)


@export.command()
@click.argument("source", metavar="SOURCE")
@click.option("--out", metavar="FILE", help="The file to write; default SOURCE with the ending .mcap.")
def mcap(source: str, out: str | None) -> None:
    """Writes a run as MCAP, and a layout for Foxglove beside it.

    SOURCE is a run folder of `run` or `hil`, or a recording of `hil --record`. Every column and every signal is there
    at every sample, as JSON with a schema; of a run also its poses. The layout has the same name and ends in
    .foxglove.json.
    """
    from brickpilot.export import files, foxglove, mcap_file, run_read, run_topics, traffic_topics

    given = Path(source)
    if given.is_dir() or not given.exists():
        run = run_read.read(given)
        topics = run_topics.topics(run)
        content = mcap_file.write(topics, run_topics.samples(run), {"summary.json": run.summary})
        layout = foxglove.run_layout(topics)
    else:
        topics, samples = traffic_topics.read(given)
        content = mcap_file.write(topics, samples, {})
        layout = foxglove.traffic_layout(topics)
    path = _file(out, given.with_suffix(".mcap") if given.is_file() else _beside(given, ".mcap"))
    files.write({path: content, path.with_suffix(".foxglove.json"): layout.encode()})
    click.echo(f"MCAP: {path}")
    click.echo(f"layout of Foxglove: {path.with_suffix('.foxglove.json')}")


@export.command()
@click.argument("source", metavar="DIR")
@click.option("--out", metavar="FILE", help="The file to write; default DIR.parquet.")
def parquet(source: str, out: str | None) -> None:
    """Writes the log of the run folder DIR as Parquet.

    Each column has its unit in its metadata. A flight over a link gives a second file, which ends in -ticks.parquet.
    """
    from brickpilot.export import files, parquet_file, run_read

    path = _file(out, _beside(Path(source), ".parquet"))
    tables = parquet_file.tables(run_read.read(Path(source)))
    made = {path.with_name(f"{path.stem}{ending}{path.suffix}"): content for ending, content in tables.items()}
    files.write(made)
    for one in made:
        click.echo(f"Parquet: {one}")
