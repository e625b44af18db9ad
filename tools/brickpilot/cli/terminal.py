"""Options, output, completion in the shell and the progress bar that several commands share."""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import click
from click.shell_completion import CompletionItem
from tqdm import tqdm

from brickpilot.constants import VEHICLES
from brickpilot.errors import InputError

_SHOWN_S = 2.0  # s: a shorter remaining time is not shown

Option = Callable[[Callable[..., Any]], Callable[..., Any]]
"""A decorator that adds an option to a command."""


def show(figures: object, lines: Iterable[str], *, as_json: bool) -> None:
    """Prints the figures as one JSON object, or else the lines."""
    for line in [json.dumps(figures)] if as_json else lines:
        click.echo(line)


def settings_of(written: tuple[str, ...]) -> dict[str, int]:
    """Reads the options `--set NAME=VALUE`.

    Raises:
        InputError: a value is no whole number or out of its range, or no setting has that name.
    """
    from brickpilot.vehicle.settings import named

    values = {}
    for pair in written:
        name, _, value = pair.partition("=")
        try:
            values[name] = int(value)
        except ValueError:
            raise InputError("needs NAME=VALUE with a whole number", field=f"--set {pair}") from None
        named(name).check(values[name])
    return values


def interval(ci95: tuple[float, float] | None) -> str:
    """Returns a 95 % confidence interval as text; None means that the data do not identify the parameter."""
    return "not identifiable" if ci95 is None else "{:.4g}..{:.4g}".format(*ci95)


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
    """Yields a function that takes (done, total, text) and shows the progress; for 0 of 0, it shows only the text.

    On a terminal, it draws a bar. If stderr is piped, it prints a line for each new text. Bar and line show the
    remaining time, estimated from the time so far. If `quiet`, it shows nothing.
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
    """Returns the lines on channels that are wired or stated wrongly; these lines come before all other lines."""
    return [*(f"wiring: {sentence}" for sentence in sentences), *([f"to mend it in the log: {mend}"] if mend else [])]


def _beginning(typed: str, known: Mapping[str, str | None], *, or_file: bool = False) -> list[CompletionItem]:
    """Returns the names in `known` (name -> description) that begin with `typed`; if none and `or_file`, files."""
    items = [CompletionItem(name, help=text) for name, text in known.items() if name.startswith(typed)]
    return items or ([CompletionItem(typed, type="file")] if or_file else [])


def _files(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    return _beginning(typed, {}, or_file=True)


def scenario_names(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the packaged scenarios, or files if no scenario begins with `typed`."""
    from brickpilot.vehicle.scenario import packaged

    return _beginning(typed, dict.fromkeys(packaged()), or_file=True)


def import_kinds(context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the first word to a kind of log or a file, and all further words to files."""
    from brickpilot.importers import IMPORTERS

    is_first = not context.params.get("words")
    return _beginning(typed, {row.kind: row.help for row in IMPORTERS if is_first}, or_file=True)


def effect_names(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the names of effects."""
    from brickpilot import catalogue

    return _beginning(typed, {effect.name: effect.summary for effect in catalogue.effects()})


def mechanisms(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the mechanisms that effects have."""
    from brickpilot import catalogue

    return _beginning(typed, dict.fromkeys(effect.mechanism for effect in catalogue.effects()))


def setting_names(_context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Completes the names of settings, and "=" after a name for `--set`."""
    from brickpilot.vehicle.settings import settings

    end = "=" if isinstance(parameter, click.Option) else ""
    return _beginning(typed, {name + end: row.meaning for name, row in settings().items()})


as_json = click.option(
    "--json", "as_json", is_flag=True, help="Print one machine-readable object on stdout and nothing else."
)

SEEDS = click.IntRange(0, 2**63 - 1)
JOBS = click.IntRange(1, 256)

seed_option = click.option(
    "--seed", type=SEEDS, default=0, show_default=True, help="The seed of the random starting points."
)
jobs_option = click.option(
    "--jobs", type=JOBS, default=2, show_default=True, help="The number of fits that run at the same time."
)


def search_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the options `--seed`, `--jobs` and `--json`."""
    return with_options(command, (seed_option, jobs_option, as_json))


def budget_option(text: str) -> Option:
    """Returns the option `--budget` of a search, in s."""
    return click.option("--budget", type=click.FloatRange(min=0, min_open=True), metavar="SECONDS", help=text)


def model_option(text: str, *, required: bool = False) -> Option:
    """Returns the option `--model` of a command that reads a model file; the shell completes the names of files."""
    return click.option("--model", metavar="FILE", required=required, shell_complete=_files, help=text)


def scenario_option(text: str) -> Option:
    """Returns the option `--scenario`."""
    return click.option("--scenario", metavar="FILE", shell_complete=scenario_names, help=text)


def profile_option(text: str, default: str | None = None) -> Option:
    """Returns the option `--profile`."""
    kinds = click.Choice(["coupled", "paper"])
    return click.option("--profile", type=kinds, default=default, show_default=default is not None, help=text)


def target_option(text: str) -> Option:
    """Returns the option `--target`, which says what runs at the brick's end of a link."""
    kinds = ["host", "h8sim", "h8sim:imu", "h8sim:rotation", "avr:328p-imu", "avr:328p-rotation", "avr:2560"]
    return click.option("--target", type=click.Choice(kinds), default="host", show_default=True, help=text)


def set_option(text: str) -> Option:
    """Returns the option `--set`, whose values `settings_of` reads."""
    return click.option(
        "--set", "written", multiple=True, metavar="NAME=VALUE", shell_complete=setting_names, help=text
    )


_FLIGHT_OPTIONS = (
    click.argument("scenario_name", metavar="[SCENARIO]", required=False, shell_complete=scenario_names),
    click.option(
        "--scenario", "scenario_file", metavar="FILE", shell_complete=scenario_names,
        help="A scenario file; the same as the argument.",
    ),
    profile_option("The constants of plant and controller; default: the scenario's, else the model's."),
    click.option(
        "--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="The robot's sensors; default ideal."
    ),
    click.option("--model", "model_file", metavar="FILE", help="Fly this model.toml instead of the packaged robot."),
    click.option(
        "--compensation", "compensation_file", metavar="FILE",
        help="Send this compensation.toml of the robot to the firmware.",
    ),
    click.option(
        "--gains", "gains_file", metavar="FILE", help="Send this gains.toml of `brickpilot tune` to the firmware."
    ),
    click.option("--seed", type=SEEDS, help="The seed of the sensors' noise; default 0."),
)  # fmt: skip


def flight_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the shared options to `command` and passes them to it as one `FlightRequest`, its first argument."""

    @functools.wraps(command)
    def with_request(**given: object) -> None:
        from brickpilot.public.doors import FlightRequest

        shared = {field.name: given.pop(field.name) for field in fields(FlightRequest)}
        command(FlightRequest(**shared), **given)  # type: ignore[arg-type]

    return with_options(with_request, _FLIGHT_OPTIONS)


_LOG_OPTIONS = (
    click.option("--vehicle", type=click.Choice(VEHICLES), help="Of logs; default: guessed from a table."),
    click.option("--frame", type=click.Choice(["FLU", "FRD"]), help="Of logs; default: guessed for a table, else FRD."),
    click.option("--map", "mapping", multiple=True, metavar="SIGNAL=FORMULA[:UNIT]", help="As in import; repeatable."),
    click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable."),
    click.option("--as-wired", is_flag=True, help="Keep channels that look wired wrongly: notes name them."),
)


def log_options(command: Callable[..., None]) -> Callable[..., None]:
    """Adds the options that say how logs are read; their names are those of keywords of `public.logs.why`."""
    return with_options(command, _LOG_OPTIONS)


def with_options(command: Callable[..., Any], options: Sequence[Option]) -> Callable[..., Any]:
    """Returns `command` with these options; its help lists them in this order."""
    for option in reversed(options):
        command = option(command)
    return command
