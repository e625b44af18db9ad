"""Options, formats and the progress bar that several commands share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import click
from tqdm import tqdm

from brickpilot.errors import InputError

_SHOWN_S = 2.0  # a shorter rest is not told

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

scheduler_option = click.option(
    "--scheduler", metavar="tcp://HOST:PORT", help="Run on the workers of this Dask scheduler, not on this machine."
)

at_a_time_option = click.option(
    "--workers",
    "at_a_time",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    help="The number of data sets at the same time, each with --jobs fits.",
)


def settings_of(written: tuple[str, ...]) -> dict[str, int]:
    """Reads the options `--set NAME=VALUE`.

    Raises:
        InputError: a value is no whole number or out of its range, or no setting has that name.
    """
    from brickpilot.vehicle.settings import named

    found = {}
    for pair in written:
        name, _, value = pair.partition("=")
        try:
            found[name] = int(value)
        except ValueError:
            raise InputError("needs NAME=VALUE with a whole number", field=f"--set {pair}") from None
        named(name).check(found[name])
    return found


def interval(ci95: tuple[float, float] | None) -> str:
    """Returns a 95 % confidence interval as text; None means that the data do not identify the parameter."""
    return "not identifiable" if ci95 is None else "{:.4g}..{:.4g}".format(*ci95)


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
    """Yields a function that takes (done, total, text) and shows the progress; 0 of 0 is a line on its own.

    On a terminal it draws a bar. If stderr is piped it prints a line for each new text. Both estimate the remaining
    time from the time so far. `quiet` shows nothing.
    """
    piped, began = not sys.stderr.isatty(), time.monotonic()
    with tqdm(total=1, disable=quiet or piped, leave=False, bar_format="{desc} {bar} {percentage:3.0f}%") as bar:
        printed = ""

        def report(done: int, total: int, text: str) -> None:
            nonlocal printed
            if total == 0:
                bar.write(text, file=sys.stderr) if not quiet else None
                return
            bar.total, bar.n = total, done
            left = (time.monotonic() - began) * (total - done) / done if done else 0.0
            line = f"{text}, about {left:.0f} s left" if left >= _SHOWN_S else text
            bar.set_description_str(line)
            if not quiet and piped and text != printed:
                click.echo(line, err=True)
            printed = text

        yield report


def wiring_lines(sentences: Sequence[str], mend: str = "") -> list[str]:
    """Returns the lines on channels that are wired or stated wrongly, which come before all others."""
    return [*(f"wiring: {one}" for one in sentences), *([f"to mend it in the log: {mend}"] if mend else [])]
