"""`brickpilot effects`."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import as_json
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.catalogue import EffectInfo, ParameterInfo


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
    click.echo("\n\n".join(_text(effect) for effect in chosen))


def _text(effect: EffectInfo) -> str:
    """An effect as a paragraph, with a line for each parameter."""
    head = f"{effect.name}  (acts on: {effect.acts_on}; mechanism: {effect.mechanism})"
    lines = [effect.summary, f"equation: {effect.equation}", f"source: {effect.source}"]
    if effect.variant_of:
        lines.insert(1, f"variant: {effect.variant_of}, but {effect.variation}")
    return "\n  ".join([head, *lines, *(_line(parameter) for parameter in effect.parameters)])


def _line(parameter: ParameterInfo) -> str:
    unit, linear = ("" if one == "1" else f" {one}" for one in (parameter.unit, parameter.linear_unit))
    span = f"{parameter.minimum:g} to {parameter.maximum:g}{unit}, preset {parameter.preset:g}"
    other = f"; in{linear} where the input commands a force" if linear != unit else ""
    return f"{parameter.name} ({parameter.role}): {parameter.meaning}; {span}{other}"
