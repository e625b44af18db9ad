"""`brickpilot bench`."""

from __future__ import annotations

import dataclasses
import json

import click
import numpy as np

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError


@click.command()
@click.option(
    "--target",
    type=click.Choice(["host", "h8", "h8:imu", "h8:rotation"]),
    default="host",
    help="host measures the speed on this machine beside a peer. h8 counts the instructions and states of a control "
    "step during a mission on the simulator of the RCX's processor. h8:imu and h8:rotation do the same with the "
    "firmware that is built for an RCX with these sensors.",
)
@click.option(
    "--profile", type=click.Choice(["coupled", "paper"]), help="With h8: the controller's constants; default coupled."
)
@click.option("--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="With h8: default imu+encoders.")
@click.option(
    "--seconds",
    type=click.FloatRange(STEP_S),
    help="With h8: fly this much of the mission; the default is all of it, which takes one or two minutes.",
)
@as_json
def bench(target: str, profile: str | None, sensors: str | None, seconds: float | None, as_json: bool) -> None:
    """Measures speed: on this machine beside a peer, or on a brick's processor."""
    if target != "host":
        _h8(target.replace("h8", "h8sim"), profile or "coupled", sensors or "imu+encoders", seconds, as_json)
        return
    for name, value in (("profile", profile), ("sensors", sensors), ("seconds", seconds)):
        if value is not None:
            raise InputError("works only with --target h8", field=f"--{name}")
    from brickpilot.benchmark import speed as bench_module

    figures = {name: dataclasses.asdict(figure) for name, figure in bench_module.host().items()}
    if as_json:
        click.echo(json.dumps(figures))
        return
    for name, figure in figures.items():
        click.echo(f"{name}: {figure['value']:.0f} {figure['unit']}, {figure['ratio']:.1f} times {figure['peer']}")


def _h8(target: str, profile: str, sensors: str, seconds: float | None, as_json: bool) -> None:
    from brickpilot.benchmark import h8_states, step_budget

    with progress_shown(not as_json) as progress:
        found = step_budget.mission(target, profile, sensors, seconds, progress)
    if as_json:
        click.echo(json.dumps(step_budget.as_dict(found)))
        return
    click.echo(f"{'':10} {'instructions':>15}   {'states, all in external RAM':>30}   {'states, all on chip':>30}")
    click.echo(f"{'':10} {'typical':>7} {'most':>7}" + f"   {'typical':>7} {'most':>7} {'most, ms':>14}" * 2)
    for name, counts in found.stages.items():
        line = f"{name:10} {np.median(counts.instructions):7.0f} {counts.instructions.max():7d}"
        for taken in counts.states.values():
            line += f"   {np.median(taken):7.0f} {taken.max():7d} {1e3 * taken.max() / h8_states.CLOCK_HZ:14.2f}"
        click.echo(line)
    click.echo(f"{len(found.stages['step'].instructions)} steps; at most {found.stack} bytes of stack")
    click.echo(f"{'bytes of':24} {'text':>6} {'data':>6} {'bss':>6}")
    for name, size in found.sizes.items():
        click.echo(f"{name:24} {size.text:6d} {size.data:6d} {size.bss:6d}")
