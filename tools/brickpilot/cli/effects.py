"""`brickpilot effects`."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import as_json, effect_names
from brickpilot.cli.terminal import mechanisms as mechanism_names
from brickpilot.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from brickpilot.catalogue import EffectInfo, ParameterInfo


@click.command()
@click.argument("word", metavar="[NAME|WORD]", required=False, shell_complete=effect_names)
@click.option(
    "--mechanism",
    metavar="NAME",
    shell_complete=mechanism_names,
    help="Only the effects of this part of the robot, such as bearing or sensor.",
)
@click.option("--long", "whole", is_flag=True, help="Show equation, source, prior and parameters of each effect.")
@as_json
def effects(word: str | None, mechanism: str | None, whole: bool, as_json: bool) -> None:
    """Lists the effects that the simulator can switch on: a line with name, mechanism and description for each.

    With NAME, it shows one effect with its equation, source, prior and parameters. With WORD, it lists the effects
    whose name or description contains this word.
    """
    from brickpilot import catalogue

    known = [effect for effect in catalogue.effects() if mechanism in (None, effect.mechanism)]
    if not known:
        mechanisms = dict.fromkeys(effect.mechanism for effect in catalogue.effects())
        raise InputError(f"is no mechanism; known: {', '.join(mechanisms)}", field=f"--mechanism {mechanism}")
    chosen = _chosen(known, word, mechanism)
    if as_json:
        click.echo(json.dumps({effect.name: dataclasses.asdict(effect) for effect in chosen}))
    elif whole or [effect.name for effect in chosen] == [word]:
        click.echo("\n\n".join(_text(effect) for effect in chosen))
    else:
        click.echo("\n".join(f"{effect.name:26} {effect.mechanism:8} {effect.summary}" for effect in chosen))


def _chosen(known: Sequence[EffectInfo], word: str | None, mechanism: str | None) -> list[EffectInfo]:
    """Returns the effect with the name `word`, else the effects whose texts contain this word.

    Raises:
        InputError: there is no such effect; the message lists similar names.
    """
    if word is None:
        return list(known)
    chosen = [effect for effect in known if effect.name == word]
    chosen = chosen or [effect for effect in known if word.lower() in f"{effect.name} {effect.summary}".lower()]
    if not chosen:
        among = f" of the mechanism {mechanism}" if mechanism else ""
        like = did_you_mean(word, [effect.name for effect in known])
        raise InputError(f"is no effect{among}, and no description has this word{like}", field=word)
    return chosen


def _text(effect: EffectInfo) -> str:
    """Returns an effect as a paragraph, with a line for each parameter."""
    head = f"{effect.name}  (acts on: {effect.acts_on}; mechanism: {effect.mechanism})"
    lines = [effect.summary, f"equation: {effect.equation}", f"source: {effect.source}"]
    lines.append(f"prior: {effect.prior}. {effect.prior_reason}")
    if effect.advice:
        lines.append(f"what to do: {effect.advice}")
    if effect.contains:
        lines.append(f"contains: {', '.join(effect.contains)}")
    if effect.made_of:
        lines.append(f"made of: {', '.join(effect.made_of)}")
    if effect.variant_of:
        lines.insert(1, f"variant: {effect.variant_of}, but {effect.variation}")
    return "\n  ".join([head, *lines, *(_line(parameter) for parameter in effect.parameters)])


def _line(parameter: ParameterInfo) -> str:
    unit, linear = ("" if one == "1" else f" {one}" for one in (parameter.unit, parameter.linear_unit))
    span = f"{parameter.minimum:g} to {parameter.maximum:g}{unit}, preset {parameter.preset:g}"
    other = f"; in{linear} where the input commands a force" if linear != unit else ""
    return f"{parameter.name} ({parameter.role}): {parameter.meaning}; {span}{other}"
