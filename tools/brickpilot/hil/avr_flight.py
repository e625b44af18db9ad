"""Flies a mission, in simulated time, with an AVR brick that reads its sensors and drives its motors itself.

The image runs on simavr, a simulator of AVR chips. The simulated pins are connected to the plant.
"""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import compiled
from brickpilot.constants import RCX, STEP_S
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError, SimulationError
from brickpilot.hil import fly as over_a_link
from brickpilot.hil.checkout import AVR_TARGETS, checkout, script_output
from brickpilot.hil.ends import Ends
from brickpilot.hil.linked_flight import LinkedFlight, Progress, Watch
from brickpilot.hil.plant_end import BROWN_OUT_MV
from brickpilot.hil.traffic_log import recorded
from brickpilot.link.brick import prepare
from brickpilot.link.links import Message, decode_frame, encode_frame
from brickpilot.link.session import REALTIME
from brickpilot.vehicle import flight
from brickpilot.vehicle.scenario import AVR_KINDS, MESSAGE_KINDS, Fault

REPLY_S = 2.0
"""Simulated time in s in which a reply has to arrive."""

RESET_STEPS = round(2.5 / STEP_S)
"""Control steps from a reset to the flight's end, 2.5 s: an image that wrongly starts by itself drives after 2 s."""

MOST_PULSES_PER_S = 20_000.0
"""False pulses per s that a fault `encoder_noise` with a rate of 1 adds at a rotation sensor."""


def fly(
    plan: flight.Plan,
    target: str,
    image: Path,
    *,
    telemetry_every: int,
    progress: Progress,
    settings: Mapping[str, int] = MappingProxyType({}),
    trace: Path | None = None,
    scales: Mapping[str, float] = MappingProxyType({}),
    record: Path | None = None,
    each_step: Callable[[AvrRobot, int], None] = lambda _robot, _step: None,
    watch: Watch = lambda _run: None,
) -> over_a_link.HilFlight:
    """Flies the plan on simavr. The same arguments give bit-identical results.

    Args:
        plan: the plan of a mission; the faults of its scenario are injected.
        target: one of `AVR_TARGETS`.
        image: the ELF file of the target.
        telemetry_every: the number of steps from one telemetry to the next, 1..255.
        progress: called with (steps done, steps in all, text).
        settings: raw values that are written before the flight; they override those of the plan.
        trace: a VCD file of the signals at the pins.
        scales: the scales of sensors that differ from those of the packaged image: see `open_robot`.
        record: the file for the messages on the line, with one of `traffic_log.SUFFIXES`.
        each_step: called with the robot and the number of the step, before each control step is flown.
        watch: called at the beginning of each step.

    Raises:
        InputError: the brick refuses a message, or the plan is for a manoeuvre or has faults of another kind of brick.
        SimulationError: the plant's state diverges.
    """
    _check_plan(plan, target)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors: NDArray[np.int16] = np.zeros((plan.steps, 2), dtype=np.int16)
    with (
        open_robot(plan, image, AVR_TARGETS[target].chip, log, motors, trace, scales) as robot,
        recorded(robot, record) as link,
    ):
        run = LinkedFlight(Ends(link, None, REPLY_S), target, plan, REALTIME, progress, watch)
        prepare(run.session, plan, REALTIME, telemetry_every, settings)
        began = time.perf_counter()
        _fly(run, robot, each_step)
        elapsed = time.perf_counter() - began
    flown = over_a_link.flown(run, log, motors, elapsed)
    ticks = flown.ticks | {"begun_s": flown.ticks["time_s"]}  # the ticks of a simulated brick have no jitter
    return dataclasses.replace(flown, ticks=ticks)


def _fly(run: LinkedFlight, robot: AvrRobot, each_step: Callable[[AvrRobot, int], None]) -> None:
    """Flies until a second after the mission's end, or until the robot's behaviour after a reset is clear."""
    resets = robot.tell().resets
    while run.step < run.plan.steps and run.over_for() < over_a_link.REST_STEPS:
        run.begin_step()
        for fault in run.plan.scenario.faults:
            _act(robot, fault, run.step)
        if start := run.start_due():
            run.link.send(start)
        each_step(robot, run.step)
        robot.fly()
        run.receive(0.0)
        if robot.tell().resets > resets and run.broke_off is None:
            run.break_off("the brick was reset by its watchdog or its brown-out detector", run.step)
            run.safe_stops += 1
            run.end_in(RESET_STEPS)
        if run.broke_off is None and run.break_off_if_reset():
            run.end_in(RESET_STEPS)
        run.end_step()


def _act(robot: AvrRobot, fault: Fault, step: int) -> None:
    """Begins a fault of the brick at the fault's first step, and ends the fault one step after its last step."""
    if fault.kind not in (*AVR_KINDS, "brown_out") or not (fault.begins(step) or fault.ends(step)):
        return
    name = {"brown_out": "BATTERY", "overrun": "LINE_OVERRUN"}.get(fault.kind, fault.kind.upper())
    sizes = {
        "brown_out": BROWN_OUT_MV * 1e-3,
        "overrun": fault.rate,
        "encoder_noise": fault.rate * MOST_PULSES_PER_S,
    }
    robot.fault(name, sizes.get(fault.kind, 1.0) if fault.begins(step) else 0.0)


def _check_plan(plan: flight.Plan, target: str) -> None:
    """Raises InputError if the plan cannot be flown by an AVR."""
    if plan.scenario.kind != "mission":
        raise InputError("is a manoeuvre, which needs no controller; hil flies missions", field=plan.scenario.name)
    possible = {*AVR_KINDS, *MESSAGE_KINDS, "brown_out"}
    if plan.before is not None:
        raise InputError("sets in during the flight; here the plant is the same all the time", field="sets_in_at_s")
    for fault in plan.scenario.faults:
        if fault.kind not in possible:
            raise InputError(
                f"an AVR has its own sensors and clock; its faults are {', '.join(sorted(possible))}",
                field=f"--target {target}: {fault.kind}",
            )
    if plan.controller != "coupled":
        raise InputError("the image has the profile coupled alone", field=f"--profile {plan.controller}")


BOOT_STEPS = 30
"""Number of motor steps until the image listens: 9 ms."""

OUT_ROOM = 4096

_TROUBLE = {
    -20: "is no image for an AVR: an ELF file is needed",
    -21: "simavr does not know the chip",
    -22: "is too large for the chip's flash",
}


def avr_image(target: str) -> Path:
    """Builds the image of a target by the project's script, and returns it.

    Raises:
        InputError: no checkout is in this folder or above it, the compiler is missing, or the build fails.
    """
    field = f"--target {target}"
    root = checkout(field)
    if shutil.which("avr-gcc") is None:
        raise InputError("needs the compiler: sudo apt-get install gcc-avr avr-libc", field=field)
    build = AVR_TARGETS[target].build
    folder = root / f"build/avr-{'-'.join(build)}"
    script_output("firmware/targets/avr/build", str(folder), *build, field=field)
    return folder / "brickpilot.elf"


class AvrRobot:
    """The simulated robot, which `open_robot` makes, and the host's end of its serial line: a `Link` in simulated time.

    Attributes:
        damaged: number of refused frames from the brick.
        ffi, library, brick: for calls of `brickpilot_avr.h` that have no method in this class.
    """

    def __init__(self, ffi: Any, library: Any, brick: Any) -> None:
        self.damaged = 0
        self.ffi, self.library, self.brick = ffi, library, brick
        self._report = ffi.new("bp_avr_report *")
        self._room = ffi.new("unsigned char[]", OUT_ROOM)
        self._rest = b""
        self._motor_step_s = float(TomlFile(RCX).data["rates"]["motor_step"]["value"])

    def send(self, messages: Sequence[Message]) -> None:
        """Puts messages on the line, which transmits them while simulated time passes."""
        data = b"".join([encode_frame(identifier, data) for identifier, data in messages])
        self.send_bytes(data)

    def send_bytes(self, data: bytes) -> None:
        """Puts any bytes on the line. Bytes that do not fit into the buffer are lost."""
        self.library.bp_avr_send(self.brick, data, len(data))

    def receive(self, timeout: float) -> list[Message]:
        """Returns the received messages; waits up to `timeout` s of simulated time for the first message."""
        for _ in range(round(max(0.0, timeout) / self._motor_step_s)):
            if messages := self._come():
                return messages
            self.wait(1)
        return self._come()

    def _come(self) -> list[Message]:
        size = self.library.bp_avr_receive(self.brick, self._room, OUT_ROOM)
        if size == 0:
            return []
        *blocks, self._rest = (self._rest + bytes(self.ffi.buffer(self._room, size))).split(b"\0")
        messages = [decode_frame(block) for block in blocks if block]
        self.damaged += messages.count(None)
        return [message for message in messages if message is not None]

    def close(self) -> None:
        """Does nothing: `open_robot` closes the robot."""

    def wait(self, motor_steps: int) -> None:
        """Lets time pass before the flight.

        Raises:
            SimulationError: the plant's state diverges.
        """
        self._check(self.library.bp_avr_wait(self.brick, motor_steps))

    def fly(self) -> None:
        """Flies one control step and logs it.

        Raises:
            SimulationError: the plant's state diverges.
        """
        self._check(self.library.bp_avr_fly(self.brick))

    def _check(self, status: int) -> None:
        if status:
            raise SimulationError(f"the simulation ended with status {status}")

    def fault(self, name: str, value: float) -> None:
        """Begins the fault `name` of `brickpilot_avr.h`, such as MAIN_HELD, with size `value`; 0 ends this fault."""
        number = getattr(self.library, f"BP_AVR_{name}")
        if self.library.bp_avr_fault(self.brick, number, value):
            raise ValueError(f"{name}: {value}")

    def tell(self) -> Any:
        """Returns what has happened since power-on, as a `bp_avr_report`."""
        self.library.bp_avr_tell(self.brick, self._report)
        return self._report

    def read(self, address: int, count: int) -> bytes:
        """Returns bytes of the processor's memory."""
        room = self.ffi.new("unsigned char[]", count)
        if self.library.bp_avr_read(self.brick, address, room, count):
            raise ValueError(f"no memory at {address}")
        return bytes(self.ffi.buffer(room))


def avr_interface() -> tuple[Any, Any]:
    """Returns cffi's `ffi` and the library with simavr.

    Raises:
        InputError: the package was built without simavr.
    """
    try:
        return compiled.interface("brickpilot_avr")
    except OSError as error:
        raise InputError(
            "this build has no simavr: sudo apt-get install libsimavr-dev libelf-dev, then install brickpilot again",
            field="--target avr",
        ) from error


@contextmanager
def open_robot(
    plan: flight.Plan,
    image: Path,
    chip: str,
    log: NDArray[np.float64],
    motors: NDArray[np.int16],
    trace: Path | None = None,
    scales: Mapping[str, float] = MappingProxyType({}),
) -> Iterator[AvrRobot]:
    """Powers on a robot with an image, and waits until the image listens. The flight fills `log` and `motors`.

    Args:
        plan: the plan of a mission.
        image: an ELF file.
        chip: simavr's name of the chip.
        log: (steps, columns), filled by the flight.
        motors: (steps, 2), filled by the flight with the motors' mean duty in each step.
        trace: a VCD file of the signals at the pins.
        scales: input, such as "GYRO" for `BP_AVR_GYRO` -> the size that the image gives one count of the
            10-bit converter, in rad/s, m/s^2 or V; an absent input has the scale of the packaged image.

    Raises:
        InputError: the package was built without simavr, or the image or the trace cannot be used.
        SimulationError: the plant does not start.
    """
    ffi, library = avr_interface()
    status = ffi.new("int *")
    with flight.request(plan, log, motors) as flight_request:
        trace_file = ffi.NULL if trace is None else str(trace).encode()
        brick = library.bp_avr_open(
            ffi.cast("bp_flight *", flight_request), str(image).encode(), chip.encode(), trace_file, status
        )
        if brick == ffi.NULL:
            if status[0] == -23:
                raise InputError("cannot be written", file=trace)
            if status[0] in _TROUBLE:
                raise InputError(_TROUBLE[status[0]], file=image)
            raise SimulationError(f"{plan.scenario.name}: the simulation does not start, status {status[0]}")
        try:
            robot = AvrRobot(ffi, library, brick)
            for name, per_count in scales.items():
                if library.bp_avr_scale(brick, getattr(library, f"BP_AVR_{name}"), per_count):
                    raise InputError(f"a count of {name} cannot mean {per_count:g}", file=image)
            robot.wait(BOOT_STEPS)
            yield robot
        finally:
            library.bp_avr_close(brick)
