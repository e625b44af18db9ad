"""`brickpilot bench`."""

from __future__ import annotations

import dataclasses
import sys

import click

from brickpilot.cli.terminal import as_json, profile_option, show
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
@profile_option("With h8: the controller's constants; default coupled.")
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
    "machine; writes report.html and scaling.json. It needs a checkout.",
)
@click.option("--out", metavar="DIR", help="With --scaling: the folder to write; default runs/bench-scaling.")
@as_json
def bench(
    target: str, profile: str | None, sensors: str | None, seconds: float | None, scaling: bool, out: str | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Measures speed: on this machine compared with peers, or on a brick's processor.

    MuJoCo and SciPy are the peers of the full loop and of the plant. With a checkout and the bricks' compilers, the
    control law is compared with Q16.16 and with floating point in software, on the processor of each brick.
    """
    if scaling:
        if target != "host":
            raise InputError("works only without --target", field="--scaling")
        _refuse("h8", profile=profile, sensors=sensors)
        _refuse("h8 or avr", seconds=seconds)
        words = ["--out", out or "runs/bench-scaling", *(["--json"] if as_json else [])]
        sys.exit(in_lab("scaling_page", *words, field="--scaling").returncode)
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
    from brickpilot.bench import speed

    host = speed.host()
    laws, missing = speed.control_law()
    for reason in missing:
        click.echo(f"not measured: {reason}", err=True)
    figures = {name: dataclasses.asdict(figure) for name, figure in (host | laws).items()}
    show(figures, speed.lines(host, laws), as_json=as_json)


def _refuse(target: str, **given: str | float | None) -> None:
    """Raises InputError if a `given` option has a value, because the options work only with `--target` and `target`."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"works only with --target {target}", field=f"--{name}")
