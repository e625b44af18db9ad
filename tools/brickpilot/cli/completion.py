"""Completion in the shell: scenarios, kinds of log, effects, settings and mechanisms, by `shell_complete` of click."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem


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
