"""`brickpilot bench`."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError
from brickpilot.hil.checkout import AVR_TARGETS, in_lab


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
    if not target.startswith("h8"):
        _refuse("h8", profile=profile, sensors=sensors)
    if target != "host":
        chosen = {"--profile": profile, "--sensors": sensors, "--seconds": seconds}
        words = [str(word) for flag, value in chosen.items() if value is not None for word in (flag, value)]
        words += ["--json"] if as_json else []
        sys.exit(in_lab("step_costs", target, *words, field=f"--target {target}").returncode)
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
    from brickpilot.public.doors import command_line
    from brickpilot.report import run_folder, scaling_page

    with run_folder.fresh_folder(folder, ("report.html", "scaling.json")) as beside:
        with progress_shown(as_json) as progress:
            found = scaling_module.as_dict(scaling_module.measure(progress))
        command = command_line("bench", scaling=True, out=folder)
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
