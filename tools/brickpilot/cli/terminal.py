"""What commands share on a terminal: options, and the progress bar."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from tqdm import tqdm

from brickpilot.errors import InputError

as_json = click.option(
    "--json", "as_json", is_flag=True, help="Print one machine-readable object on stdout, nothing else."
)


_FLIGHT = (
    click.argument("scenario_name", metavar="[SCENARIO]", required=False),
    click.option("--scenario", "scenario_file", metavar="FILE", help="A scenario file; the same as the argument."),
    click.option(
        "--profile", type=click.Choice(["coupled", "paper"]), help="Plant and controller constants; default coupled."
    ),
    click.option(
        "--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="What the robot feels; default ideal."
    ),
    click.option("--model", "model_file", metavar="FILE", help="Fly this model.toml instead of the packaged robot."),
    click.option(
        "--compensation",
        "compensation_file",
        metavar="FILE",
        help="Tell the firmware this compensation.toml of the robot.",
    ),
    click.option("--seed", type=click.IntRange(0, 2**63 - 1), help="Of the sensors' noise; default 0."),
)


def flight_options(command: Callable[..., None]) -> Callable[..., None]:
    """What to fly and in which robot, as `run` and `hil` share it."""
    for option in reversed(_FLIGHT):
        command = option(command)
    return command


def settings_of(written: tuple[str, ...]) -> dict[str, int]:
    """What `--set NAME=VALUE`, repeatable, says. Raises InputError where a value is no whole number."""
    found = {}
    for pair in written:
        name, _, value = pair.partition("=")
        try:
            found[name] = int(value)
        except ValueError:
            raise InputError("needs NAME=VALUE, a whole number", field=f"--set {pair}") from None
    return found


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
    """A progress bar on a terminal, a plain line for each new stage when piped, nothing with --json."""
    with tqdm(
        total=1, disable=quiet or not sys.stderr.isatty(), leave=False, bar_format="{desc} {bar} {percentage:3.0f}%"
    ) as bar:
        told = ""

        def report(done: int, total: int, text: str) -> None:
            nonlocal told
            bar.total, bar.n = total, done
            bar.set_description_str(text)
            if not quiet and not sys.stderr.isatty() and text != told:
                click.echo(text, err=True)
            told = text

        yield report
