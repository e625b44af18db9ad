"""Options, formats, completion in the shell and the progress bar that several commands share.

Completion knows scenarios, kinds of log, effects, settings and mechanisms, by `shell_complete` of click.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields

import click
from click.shell_completion import CompletionItem
from tqdm import tqdm

from brickpilot.constants import VEHICLES
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


def scenario_names(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the packaged scenarios, or files if no scenario begins like this."""
    from brickpilot.vehicle.scenario import packaged

    found = [CompletionItem(name) for name in packaged() if name.startswith(typed)]
    return found or [CompletionItem(typed, type="file")]


def model_files(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes files."""
    return [CompletionItem(typed, type="file")]


def import_kinds(context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the kinds of log as the first word, and files where none begins so and behind it."""
    from brickpilot.importers import IMPORTERS

    first = not context.params.get("words")
    found = [CompletionItem(row.kind, help=row.help) for row in IMPORTERS if first and row.kind.startswith(typed)]
    return found or [CompletionItem(typed, type="file")]


def effect_names(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the names of effects, with a description if the shell shows it."""
    from brickpilot import catalogue

    return [CompletionItem(one.name, help=one.summary) for one in catalogue.effects() if one.name.startswith(typed)]


def mechanisms(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the mechanisms that effects have."""
    from brickpilot import catalogue

    known = dict.fromkeys(one.mechanism for one in catalogue.effects())
    return [CompletionItem(name) for name in known if name.startswith(typed)]


def setting_names(_context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the names of settings; after `--set` with the sign before the value."""
    from brickpilot.vehicle.settings import settings

    end = "=" if isinstance(parameter, click.Option) else ""
    return [CompletionItem(name + end, help=row.meaning) for name, row in settings().items() if name.startswith(typed)]


_FLIGHT_OPTIONS = (
    click.argument("scenario_name", metavar="[SCENARIO]", required=False, shell_complete=scenario_names),
    click.option(
        "--scenario",
        "scenario_file",
        metavar="FILE",
        shell_complete=scenario_names,
        help="A scenario file; the same as the argument.",
    ),
    click.option(
        "--profile",
        type=click.Choice(["coupled", "paper"]),
        help="The constants of plant and controller; default: the scenario's, else the model's.",
    ),
    click.option(
        "--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="The robot's sensors; default ideal."
    ),
    click.option("--model", "model_file", metavar="FILE", help="Fly this model.toml instead of the packaged robot."),
    click.option(
        "--compensation",
        "compensation_file",
        metavar="FILE",
        help="Send this compensation.toml of the robot to the firmware.",
    ),
    click.option(
        "--gains",
        "gains_file",
        metavar="FILE",
        help="Send this gains.toml of `brickpilot tune` to the firmware.",
    ),
    click.option("--seed", type=click.IntRange(0, 2**63 - 1), help="The seed of the sensors' noise; default 0."),
)


def flight_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the shared options to `command` and passes them to it as one `FlightRequest`, its first argument."""

    @functools.wraps(command)
    def with_request(**given: object) -> None:
        from brickpilot.public.doors import FlightRequest

        shared = {field.name: given.pop(field.name) for field in fields(FlightRequest)}
        command(FlightRequest(**shared), **given)  # type: ignore[arg-type]

    decorated: Callable[..., None] = with_request
    for option in reversed(_FLIGHT_OPTIONS):
        decorated = option(decorated)
    return decorated


_LOG_OPTIONS = (
    click.option("--vehicle", type=click.Choice(VEHICLES), help="Of logs; default: guessed from a table."),
    click.option("--frame", type=click.Choice(["FLU", "FRD"]), help="Of logs; default: guessed from a table, or FRD."),
    click.option("--map", "mapping", multiple=True, metavar="SIGNAL=FORMULA[:UNIT]", help="As in import; repeatable."),
    click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable."),
    click.option("--as-wired", is_flag=True, help="Keep channels that look wired wrongly: notes name them."),
)


def log_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the options that say how logs are read, by the keywords of `public.logs.why`."""
    for option in reversed(_LOG_OPTIONS):
        command = option(command)
    return command
