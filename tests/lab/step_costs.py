"""Prints what a control step costs on a brick: the program that `brickpilot bench --target` runs in a checkout.

python -m lab.step_costs TARGET --profile P --sensors S [--seconds S] [--json]    a table, or its figures
python -m lab.step_costs law                                          the control law beside its peers, as JSON
"""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import click
import numpy as np
from brickpilot.cli.main import run_to_exit
from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.hil import ends
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.hil.rcx_flight import CLOCK_HZ

from lab import avr_budget, control_peers, rcx_budget

_KERNEL_S = 8.0
"""Length, s, of the first part of the mission. The kernel's share is measured there, as it does not change later."""


@click.command()
@click.argument("target")
@click.option("--profile", default="coupled", help="Of an RCX: the controller's constants.")
@click.option("--sensors", default="imu+encoders", help="Of an RCX.")
@click.option("--seconds", type=float, help="Of the mission; default: all of it.")
@as_json
def step_costs(target: str, profile: str, sensors: str, seconds: float | None, as_json: bool) -> None:
    """Measures TARGET: h8, h8:imu, h8:rotation, avr, one of avr's images, or law."""
    if target == "law":
        figures, missing = control_peers.figures_here()
        told = {name: dataclasses.asdict(figure) for name, figure in figures.items()}
        click.echo(json.dumps({"figures": told, "missing": missing}))
    elif target.startswith("avr"):
        _avr(target, seconds, as_json)
    else:
        _h8(target.replace("h8", "h8sim"), profile, sensors, seconds, as_json)


def _avr(target: str, seconds: float | None, as_json: bool) -> None:
    """Measures one of `AVR_TARGETS`, or all of them if `target` is avr."""
    found: dict[str, dict[str, Any]] = {}
    for name in [target] if target in AVR_TARGETS else AVR_TARGETS:
        with progress_shown(as_json) as progress:
            found[name] = avr_budget.as_dict(avr_budget.mission(name, seconds, progress))
        if not as_json:
            _print_avr(name, found[name])
    if as_json:
        click.echo(json.dumps(found.get(target, found)))


def _print_avr(target: str, found: dict[str, Any]) -> None:
    click.echo(f"{target:18} {'cycles, typical':>15} {'most':>7} {'most, ms':>9} {'share of the period':>20}")
    for name, cycles in found["cycles"].items():
        most = cycles["most"]
        click.echo(
            f"{name:18} {cycles['typical']:15d} {most:7d} {1e3 * most / found['clock_hz']:9.2f} "
            f"{100 * most / found['period_cycles']:18.1f} %"
        )
    click.echo(f"{found['periods']} periods of {found['period_cycles']} cycles")
    click.echo(f"flash: {found['flash_bytes']} of {found['flash_of']} bytes")
    left = found["ram_of"] - found["ram_bytes"] - found["stack_bytes"]
    click.echo(
        f"RAM: {found['ram_bytes']} bytes of variables and at most {found['stack_bytes']} of stack, "
        f"of {found['ram_of']}: {left} left"
    )


def _h8(target: str, profile: str, sensors: str, seconds: float | None, as_json: bool) -> None:
    built_for = ends.H8SIM_TARGETS[target]
    with progress_shown(as_json) as progress:
        found = rcx_budget.mission(target, profile, sensors, seconds, progress)
        kernel = None
        if built_for is not None:
            kernel = rcx_budget.shares_as_dict(
                rcx_budget.measure_shares(built_for, min(seconds or _KERNEL_S, _KERNEL_S), progress)
            )
    if as_json:
        click.echo(json.dumps(rcx_budget.as_dict(found) | ({} if kernel is None else {"kernel": kernel})))
        return
    click.echo(f"{'':10} {'instructions':>15}   {'states, all in external RAM':>30}   {'states, all on chip':>30}")
    click.echo(f"{'':10} {'typical':>7} {'most':>7}" + f"   {'typical':>7} {'most':>7} {'most, ms':>14}" * 2)
    for name, counts in found.stages.items():
        line = f"{name:10} {np.median(counts.instructions):7.0f} {counts.instructions.max():7d}"
        for taken in counts.states.values():
            line += f"   {np.median(taken):7.0f} {taken.max():7d} {1e3 * taken.max() / CLOCK_HZ:14.2f}"
        click.echo(line)
    click.echo(f"{len(found.stages['step'].instructions)} steps; at most {found.stack} bytes of stack")
    click.echo(f"{'bytes of':24} {'text':>6} {'data':>6} {'bss':>6}")
    for name, size in found.sizes.items():
        click.echo(f"{name:24} {size.text:6d} {size.data:6d} {size.bss:6d}")
    if kernel is not None:
        _print_kernel(kernel, rcx_budget.LABELS)


def _print_kernel(kernel: dict[str, Any], labels: dict[str, str]) -> None:
    click.echo(f"of the processor's time, in {kernel['seconds']:.1f} s of the mission under brickOS:")
    for kind, label in labels.items():
        share = kernel["shares"][kind]
        often = f"{share['per_s']:9.0f} per s of {share['states']:5.0f} states" if share["per_s"] else ""
        click.echo(f"  {label:40} {100 * share['share']:5.1f} % {often}".rstrip())
    tick = kernel["tick_ms"]
    click.echo(
        f"from a control step to the next: median {tick['median']:.1f}, p99 {tick['p99']:.1f}, "
        f"most {tick['most']:.1f} ms"
    )


if __name__ == "__main__":
    run_to_exit(step_costs, None, "brickpilot")
