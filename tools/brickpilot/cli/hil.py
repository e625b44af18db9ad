"""`brickpilot hil` and `brickpilot brick`."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.settings_table import setting_lines
from brickpilot.cli.terminal import (
    as_json,
    flight_options,
    progress_shown,
    set_option,
    settings_of,
    show,
    target_option,
)
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError, SimulationError, WorkFailedError
from brickpilot.report.flight_text import figure_lines, link_lines, waypoint_lines

if TYPE_CHECKING:
    from brickpilot.public.doors import FlightRequest


@click.command()
@flight_options
@click.option(
    "--link",
    "spec",
    metavar="LINK",
    help="serial:pty, tcp, can:slcan, can:virtual and can:udp_multicast start a brick on this machine. serial:PORT, "
    "tcp:HOST:PORT, can:slcan:PORT and can:socketcan:CHANNEL connect to a brick that runs already.",
)
@target_option(
    "host: the brick is a program of this machine. h8sim: the same firmware on a simulator of the RCX's "
    "processor, in lockstep and without --link. h8sim:imu, h8sim:rotation: the firmware that is built for an RCX with "
    "these sensors. avr:328p-imu, avr:328p-rotation, avr:2560: the image for an ATmega328P or ATmega2560 on simavr, "
    "which reads the plant's volts and edges at its pins and drives its motors, in simulated time.",
)
@click.option(
    "--image",
    "image_file",
    metavar="FILE",
    help="Fly this image, which `brickpilot firmware` has made, with the robot of --model and its mission. FILE.elf of "
    "an Arduino: the image itself on simavr, with the wiring of the folder's include/. brickpilot.h8sim of an RCX: the "
    "brick's firmware with the same headers, flags and compiler on the simulator of its processor, in lockstep; "
    "readings and route come as messages, without brickOS, the drivers and the wiring.",
)
@click.option(
    "--trace", "trace_file", metavar="FILE.vcd", help="With --target avr: write the signals at the pins to FILE (VCD)."
)
@click.option(
    "--lockstep/--realtime",
    default=True,
    help="Lockstep (default) simulates one step for each reply. Real time follows the clock.",
)
@click.option(
    "--telemetry-every",
    type=click.IntRange(1, 255),
    metavar="N",
    help="The brick sends telemetry every N steps; default 1 in lockstep, 10 in real time and with --target avr.",
)
@set_option("Write this raw value to a setting before the flight; repeatable.")
@click.option(
    "--settings",
    "list_settings",
    is_flag=True,
    help="Begin a session and list its settings; do not fly. Route and settings that were sent before are forgotten. "
    "`brickpilot settings` lists all without a brick.",
)
@click.option(
    "--record", "record_file", metavar="FILE", help="Write the link's traffic to FILE: .asc, .blf or .log (candump's)."
)
@click.option(
    "--replay", "replay_file", metavar="FILE", help="Send the traffic of FILE to the brick again and compare."
)
@click.option(
    "--junit",
    "junit_file",
    metavar="FILE",
    help="Write the checks of the flight as JUnit XML for Jenkins or GitLab: link, late ticks, controller, safe stops "
    "and each waypoint.",
)
@click.option("--out", metavar="DIR", help="The run folder to write; default runs/hil-SCENARIO-PROFILE-SENSORS.")
@as_json
def hil(
    request: FlightRequest, spec: str | None, target: str, image_file: str | None, trace_file: str | None,
    lockstep: bool, telemetry_every: int | None, written: tuple[str, ...], list_settings: bool,
    record_file: str | None, replay_file: str | None, junit_file: str | None, out: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Flies SCENARIO with the plant at one end of a link and the controller at the other.

    Without SCENARIO it flies the paper's eight waypoints. In lockstep the motor commands equal those of
    `brickpilot run`, bit for bit, to the end of the scenario. A flight in real time ends a second after the mission.
    The run folder holds log.csv, ticks.csv, summary.json and report.html. If a waypoint was missed, or a fault, a safe
    stop or a lost link occurred, one line says so and the exit status is 1.
    """
    from brickpilot.public import flights

    own = None if image_file is None else flights.image_of(Path(image_file), request, target)
    target, image = (target, None) if own is None else (own.target, own.path)
    spec = flights.link_of(spec, target, lockstep)
    if target.startswith("avr:") and list_settings:
        raise InputError("only flies; `brickpilot settings` lists the settings", field=f"--target {target}")
    if target.startswith("avr:") and replay_file is not None:
        raise InputError("has its own sensors, so no recorded readings can be replayed", field=f"--target {target}")
    if replay_file is not None:
        _replay(spec, Path(replay_file), image, as_json)
    elif list_settings:
        _list_settings(spec, request.profile or "coupled", image, as_json)
    else:
        record, junit, trace = (None if one is None else Path(one) for one in (record_file, junit_file, trace_file))
        session = flights.Session(spec, lockstep, telemetry_every, settings_of(written), record, junit, trace, own)
        with progress_shown(as_json or not sys.stderr.isatty()) as progress:

            def report(done: int, steps: int, text: str) -> None:
                progress(done, steps, f"{done * STEP_S:5.1f} s, {text}")

            made = flights.fly_over(request, session, out, report)
        show(made.figures, _lines(made.figures, made.folder, lockstep=lockstep), as_json=as_json)
        if made.figures["failure"] is not None:
            raise WorkFailedError(f"{spec}: {made.figures['failure']}")


def _lines(figures: Mapping[str, Any], folder: Path, *, lockstep: bool) -> Iterator[str]:
    yield from waypoint_lines(figures)
    yield from figure_lines(figures)
    yield from link_lines(figures)
    yield f"report: {folder / 'report.html'}"
    if not lockstep and not figures["realtime_priority"]:
        yield "note: the system grants no real-time priority (see ulimit -r), so other programs can delay ticks"


def _list_settings(spec: str, profile: str, image: Path | None, as_json: bool) -> None:
    """Prints every setting of the brick."""
    from brickpilot.hil import ends
    from brickpilot.link.session import LOCKSTEP, Session
    from brickpilot.vehicle.settings import settings

    with ends.both_ends(spec, image=image) as both:
        session = Session(both.link, spec)
        session.open(profile, LOCKSTEP)
        values = {name: session.read(name) for name in settings()}
    show(values, setting_lines(values, "now"), as_json=as_json)


def _replay(spec: str, file: Path, image: Path | None, as_json: bool) -> None:
    """Replays recorded traffic and ends with status 1 if a motor command differs."""
    from brickpilot.hil import ends, traffic_log

    with ends.both_ends(spec, image=image) as both:
        replayed = traffic_log.replay(both.link, spec, file)
    figures = {"link": spec, "replay": str(file), **dataclasses.asdict(replayed)}
    line = f"{replayed.steps} steps replayed, {replayed.differing} motor commands differ"
    show(figures, [line], as_json=as_json)
    if replayed.differing:
        raise SimulationError(f"{file}: the brick's motor command at step {replayed.first} differs from the recording")


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
def brick(options: tuple[str, ...]) -> None:
    """Runs the firmware as a brick on this machine until it is interrupted.

    OPTIONS: --pty, --serial PATH, --listen HOST:PORT, --slcan-pty or --slcan PATH. The first line that it prints is
    the link that `brickpilot hil --link` takes. An address that other machines reach needs a token of 16 to 64 bytes
    in the environment variable BRICKPILOT_TOKEN, here and where the link is opened.
    """
    from brickpilot.hil.checkout import BRICK_PROGRAM

    sys.stdout.flush()
    os.execv(BRICK_PROGRAM, [str(BRICK_PROGRAM), *options])
