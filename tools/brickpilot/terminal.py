"""What commands share on a terminal: the option for one machine-readable object, and the progress bar."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from tqdm import tqdm

as_json = click.option(
    "--json", "as_json", is_flag=True, help="Print one machine-readable object on stdout, nothing else."
)


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
