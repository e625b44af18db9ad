"""Options, formats and the progress bar that several commands share."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from tqdm import tqdm

from brickpilot.errors import InputError

as_json = click.option(
    "--json", "as_json", is_flag=True, help="Print one machine-readable object on stdout and nothing else."
)

seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    default=0,
    show_default=True,
    help="The seed of the random starting points.",
)

jobs_option = click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=2,
    show_default=True,
    help="The number of fits that run at the same time.",
)


def settings_of(written: tuple[str, ...]) -> dict[str, int]:
    """Reads the options `--set NAME=VALUE`. Raises InputError if a value is no whole number."""
    found = {}
    for pair in written:
        name, _, value = pair.partition("=")
        try:
            found[name] = int(value)
        except ValueError:
            raise InputError("needs NAME=VALUE with a whole number", field=f"--set {pair}") from None
    return found


def interval(ci95: tuple[float, float] | None) -> str:
    """Returns a 95 % confidence interval as text; None means that the data do not identify the parameter."""
    return "not identifiable" if ci95 is None else "{:.4g}..{:.4g}".format(*ci95)


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
    """Yields a function that takes (done, total, text) and shows the progress.

    On a terminal it draws a bar. Where stderr is piped it prints a line for each new text. `quiet` shows nothing.
    """
    piped = not sys.stderr.isatty()
    with tqdm(total=1, disable=quiet or piped, leave=False, bar_format="{desc} {bar} {percentage:3.0f}%") as bar:
        printed = ""

        def report(done: int, total: int, text: str) -> None:
            nonlocal printed
            bar.total, bar.n = total, done
            bar.set_description_str(text)
            if not quiet and piped and text != printed:
                click.echo(text, err=True)
            printed = text

        yield report
