"""`brickpilot bench`."""

from __future__ import annotations

import dataclasses
import json
import shlex
from pathlib import Path
from typing import Any

import click
import numpy as np

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError
from brickpilot.hil.checkout import AVR_TARGETS

_KERNEL_S = 8.0
"""s of the mission in which the kernel's share is measured; it does not change later."""


@click.command()
@click.option(
    "--target",
    type=click.Choice(["host", "h8", "h8:imu", "h8:rotation", "avr", *AVR_TARGETS]),
    default="host",
    help="host measures the speed on this machine beside a peer. h8 counts the instructions and states of a control "
    "step during a mission on the simulator of the RCX's processor. h8:imu and h8:rotation do the same with the "
    "firmware that is built for an RCX with these sensors. avr:328p-imu, avr:328p-rotation and avr:2560 count the "
    "cycles of the image for an ATmega328P or ATmega2560 on simavr, with drivers and interrupts; avr does all three.",
)
@click.option(
    "--profile", type=click.Choice(["coupled", "paper"]), help="With h8: the controller's constants; default coupled."
)
@click.option("--sensors", type=click.Choice(["ideal", "imu", "imu+encoders"]), help="With h8: default imu+encoders.")
@click.option(
    "--seconds",
    type=click.FloatRange(STEP_S),
    help="With h8 and avr: fly this much of the mission; the default is all of it, which takes one or two minutes.",
)
@click.option(
    "--scaling",
    is_flag=True,
    help="Measure how time grows with runs, samples, candidates and workers instead, in about four minutes of a quiet "
    "machine; writes report.html and scaling.json.",
)
@click.option("--out", metavar="DIR", help="With --scaling: the folder to write; default runs/bench-scaling.")
@as_json
def bench(
    target: str, profile: str | None, sensors: str | None, seconds: float | None, scaling: bool, out: str | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Measures speed: on this machine beside peers, or on a brick's processor.

    On this machine the full loop and the plant run beside MuJoCo and SciPy; and with a checkout and the bricks'
    compilers, the control law on each brick's processor beside Q16.16 and floating point in software.
    """
    if scaling:
        if target != "host":
            raise InputError("works only without --target", field="--scaling")
        _refuse("h8", profile=profile, sensors=sensors)
        _refuse("h8 or avr", seconds=seconds)
        _scaling(Path(out or "runs/bench-scaling"), as_json)
        return
    if out is not None:
        raise InputError("works only with --scaling", field="--out")
    if target.startswith("avr"):
        _refuse("h8", profile=profile, sensors=sensors)
        _avr(target, seconds, as_json)
        return
    if target != "host":
        _h8(target.replace("h8", "h8sim"), profile or "coupled", sensors or "imu+encoders", seconds, as_json)
        return
    _refuse("h8", profile=profile, sensors=sensors)
    _refuse("h8 or avr", seconds=seconds)
    from brickpilot.bench import speed as bench_module

    found = bench_module.host()
    laws, missing = bench_module.control_law()
    for reason in missing:
        click.echo(f"not measured: {reason}", err=True)
    if as_json:
        click.echo(json.dumps({name: dataclasses.asdict(figure) for name, figure in (found | laws).items()}))
        return
    for line in bench_module.lines(found, laws):
        click.echo(line)


def _scaling(folder: Path, as_json: bool) -> None:
    """Measures how time grows, and writes its page and its figures."""
    from brickpilot.bench import scaling as scaling_module
    from brickpilot.report import run_folder, scaling_page

    with run_folder.fresh_folder(folder, ("report.html", "scaling.json")) as beside:
        with progress_shown(as_json) as progress:
            found = scaling_module.as_dict(scaling_module.measure(progress))
        command = shlex.join(["brickpilot", "bench", "--scaling", "--out", str(folder)])
        (beside / "scaling.json").write_text(json.dumps(found, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        (beside / "report.html").write_text(scaling_page.page(found, command), encoding="utf-8")
    if as_json:
        click.echo(json.dumps(found, allow_nan=False))
        return
    click.echo(f"on {found['machine']}")
    for one in found["sweeps"].values():
        low, high = one["exponent"]["ci95"]
        growth = f"{one['growth']}, exponent {one['exponent']['value']:.2f} ({low:.2f} to {high:.2f})"
        ratio = f"{one['times_as_long']:6.1f} times as long for {one['times_work']:4.1f} times the {one['unit']}"
        click.echo(f"{ratio}: {growth}; {one['what']}")
    for number, gain in zip(found["workers"]["numbers"], found["workers"]["gain"], strict=True):
        click.echo(f"{gain:6.2f} times the flights of one worker with {number} on {found['workers']['cores']} cores")
    click.echo(f"report: {folder / 'report.html'}")


def _refuse(target: str, **given: str | float | None) -> None:
    """Raises InputError for an option that is given, and works only with another target."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"works only with --target {target}", field=f"--{name}")


def _avr(target: str, seconds: float | None, as_json: bool) -> None:
    """Measures one of `AVR_TARGETS`, or all of them where `target` is avr."""
    from brickpilot.bench import avr_budget

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
    from brickpilot.bench import h8_states, rcx_budget
    from brickpilot.hil import ends

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
            line += f"   {np.median(taken):7.0f} {taken.max():7d} {1e3 * taken.max() / h8_states.CLOCK_HZ:14.2f}"
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
