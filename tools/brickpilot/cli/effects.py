"""`brickpilot effects`."""

from __future__ import annotations

import dataclasses
import json

import click

from brickpilot.cli.terminal import as_json
from brickpilot.errors import InputError


@click.command()
@click.argument("name", required=False)
@as_json
def effects(name: str | None, as_json: bool) -> None:
    """Lists the effects of the library, or only the effect NAME."""
    from brickpilot import catalogue

    known = {effect.name: effect for effect in catalogue.effects()}
    if name is not None and name not in known:
        raise InputError(f"is no effect; known effects: {', '.join(known)}", field=name)
    chosen = list(known.values()) if name is None else [known[name]]
    if as_json:
        click.echo(json.dumps({effect.name: dataclasses.asdict(effect) for effect in chosen}))
        return
    for effect in chosen:
        click.echo(f"{effect.name}  (acts on: {effect.acts_on})\n  {effect.equation}\n  source: {effect.source}")
        for parameter in effect.parameters:
            span = f"{parameter.minimum:g}..{parameter.maximum:g} {parameter.unit}"
            click.echo(f"  {parameter.name}: {parameter.meaning}; {span}, preset {parameter.preset:g}")
