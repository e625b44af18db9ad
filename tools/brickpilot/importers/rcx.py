"""Fetches a recording of an RCX through the infrared tower and makes a data set of it.

firmware/targets/rcx/recorder.c makes the recordings and sends them in blocks. Block 0 describes the recording; the
other blocks hold its samples.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import COUNTS_PER_TURN
from brickpilot.data.signals import SIGNALS
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector
from brickpilot.importers.writer import NewDataset, NewRun
from brickpilot.link import lnp
from brickpilot.link.tower import BYTE_S, Tower

PATIENCE = 4.0  # s: longest wait for a reply, because the brick may first wait until the line is quiet
TRIES = 8  # largest number of requests of a block
VERSION = 1
BLOCK_SAMPLES, SAMPLE_SIZE = 20, 5  # samples in a block; bytes of a sample
BATTERY_V = 43.988 / 1560  # V per count, from brickOS


class Line(Protocol):
    """The part of `Tower` that this module uses."""

    def exchange(
        self, packet: bytes, find: Callable[[bytes], bytes | None], reply_bytes: int, patience: float, /
    ) -> bytes | None: ...


@dataclass(frozen=True)
class Axis:
    """An analogue sensor, whose value in m/s^2 or rad/s is (raw - zero) * scale."""

    zero: int
    scale: float

    def of(self, raw: Vector) -> Vector:
        return (raw - self.zero) * self.scale


@dataclass(frozen=True)
class Manoeuvre:
    """Constant duty of both motors, -1..1, for a number of samples."""

    left: float
    right: float
    samples: int

    @property
    def label(self) -> str:
        """The name of the manoeuvre's run; "": both motors rest."""
        if self.left == self.right:
            return "forward" if self.left > 0 else "backward" if self.left < 0 else ""
        return "spin" if self.left == -self.right else "turn"


@dataclass(frozen=True)
class Description:
    """Block 0 of a recording.

    Attributes:
        period_s: time between samples in s.
        samples: number of logged samples.
        late: number of samples that were taken late.
        gyro: zero and scale of the gyro.
        accelerometers: zero and scale of the accelerometers of surge and sway; None: rotation sensors were logged.
        reversed_wheels: whether the left and the right rotation sensor count backward.
        manoeuvres: the manoeuvres in order.
    """

    period_s: float
    samples: int
    late: int
    gyro: Axis
    accelerometers: tuple[Axis, Axis] | None
    reversed_wheels: tuple[bool, bool]
    manoeuvres: tuple[Manoeuvre, ...]


def import_rcx(
    ports: Sequence[Path],
    *,
    progress: Callable[[int, int, str], None] | None = None,
    byte_s: float = BYTE_S,
) -> NewDataset:
    """Fetches the recording of a brick and returns a data set of it.

    Args:
        ports: exactly one port, the serial port of the tower.
        progress: called with (blocks fetched, all blocks, text).
        byte_s: time in s that a byte takes on the line.

    Raises:
        InputError: there is no such port, no tower or no reply; or the reply is no recording.
    """
    if len(ports) != 1:
        raise InputError("needs exactly one serial port, that of the tower", field="FILE")
    (port,) = ports
    try:
        with Tower(str(port), byte_s) as tower:
            description, samples = fetch(tower, port, progress)
    except TimeoutError as error:
        raise InputError(str(error)) from error
    return dataset_of(description, samples)


def fetch(
    line: Line, port: Path, progress: Callable[[int, int, str], None] | None = None
) -> tuple[Description, NDArray[np.int64]]:
    """Fetches the description and the samples; each sample has four raw numbers.

    Raises:
        InputError: there is no reply, or the reply is no part of a recording.
    """
    description = describe(_request(line, port, 0), port)
    blocks = -(-description.samples // BLOCK_SAMPLES)
    content = b""
    for number in range(1, blocks + 1):
        block = _request(line, port, number)
        wanted = min(BLOCK_SAMPLES, description.samples - (number - 1) * BLOCK_SAMPLES) * SAMPLE_SIZE
        if len(block) != wanted:
            message = f"block {number} has {len(block)} bytes, not {wanted}: run the recorder again"
            raise InputError(message, file=port)
        content += block
        if progress is not None:
            progress(number, blocks, "fetching")
    return description, unpack(content)


def _request(line: Line, port: Path, number: int) -> bytes:
    """Requests block `number` until it arrives complete, at most `TRIES` times, and returns it."""
    wanted = struct.pack("<H", number)

    def block_in(received: bytes) -> bytes | None:
        data = lnp.find(received, lnp.HOST, lnp.BRICK)
        return data[2:] if data is not None and data[:2] == wanted else None

    packet = lnp.packet(wanted, lnp.BRICK, lnp.HOST)
    for _ in range(TRIES):
        block = line.exchange(packet, block_in, BLOCK_SAMPLES * SAMPLE_SIZE + 7, PATIENCE)
        if block is not None:
            return block
    if number == 0:
        raise InputError(
            "no answer: is the tower plugged in, in sight of the brick, and does the brick show SEnd?", file=port
        )
    raise InputError(f"block {number} did not come in {TRIES} tries: move the tower nearer", file=port)


def describe(block: bytes, port: Path) -> Description:
    """Reads block 0.

    Raises:
        InputError: another version of the recorder wrote the block, or bytes are missing.
    """
    if block[:1] != bytes([VERSION]):
        message = f"recorder of version {block[:1].hex()}, not {VERSION:02x}: build it and load it again"
        raise InputError(message, file=port)
    try:
        kind, period_ms, samples, late = struct.unpack_from("<BBHH", block, 1)
        at = 7
        axes = []
        for _ in range(1 if kind == 1 else 3):
            zero, scale_q8, mirrored = struct.unpack_from("<HHB", block, at)
            axes.append(Axis(zero, (-1 if mirrored else 1) * scale_q8 / 256 / 1000))
            at += 5
        wheels = (False, False)
        if kind == 1:
            wheels = (bool(block[at]), bool(block[at + 1]))
            at += 2
        rows = list(struct.iter_unpack("<hhH", block[at + 1 :]))
        if kind > 1 or len(rows) != block[at] or sum(row[2] for row in rows) != samples or period_ms == 0:
            raise ValueError
    except (struct.error, IndexError, ValueError) as error:
        raise InputError("the description is not whole: run the recorder to its end", file=port) from error
    manoeuvres = tuple(Manoeuvre(left / 32768, right / 32768, count) for left, right, count in rows)
    accelerometers = (axes[1], axes[2]) if kind == 0 else None
    return Description(period_ms / 1000, samples, late, axes[0], accelerometers, wheels, manoeuvres)


def unpack(content: bytes) -> NDArray[np.int64]:
    """Returns the raw numbers, (samples, 4). 5 bytes hold four numbers of 10 bits, the first in the lowest bits."""
    packed = np.frombuffer(content, dtype=np.uint8).reshape(-1, SAMPLE_SIZE).astype(np.int64)
    whole: NDArray[np.int64] = (packed << np.arange(0, 8 * SAMPLE_SIZE, 8)).sum(axis=1)
    numbers: NDArray[np.int64] = (whole[:, None] >> np.arange(0, 40, 10)) & 1023
    return numbers


def dataset_of(description: Description, samples: NDArray[np.int64]) -> NewDataset:
    """Makes a run of each manoeuvre with the rest after it. The first run also has the rest before its manoeuvre."""
    columns = _columns(description, samples)
    runs = [
        NewRun(
            label,
            {
                "time": np.arange(end - begin, dtype=np.float64) * description.period_s,
                **{signal: values[begin:end] for signal, values in columns.items()},
            },
        )
        for label, begin, end in _runs(description)
    ]
    units = {signal: SIGNALS[signal].unit for signal in ("time", *columns)}
    notes = [f"{description.late} of {description.samples} samples were late"] if description.late else []
    return NewDataset("diff_drive", "FRD", units, runs, notes=notes)


def _columns(description: Description, samples: NDArray[np.int64]) -> dict[str, Vector]:
    first, second, gyro, battery = samples.T.astype(np.float64)
    parts = [np.tile([one.left, one.right], (one.samples, 1)) for one in description.manoeuvres]
    duty = np.concatenate(parts or [np.zeros((0, 2))])
    columns: dict[str, Vector] = {
        "duty_left": duty[:, 0],
        "duty_right": duty[:, 1],
        "battery_voltage": battery * BATTERY_V,
        "yaw_rate": description.gyro.of(gyro),
    }
    if description.accelerometers is not None:
        surge, sway = description.accelerometers
        return columns | {"accel_surge": surge.of(first), "accel_sway": sway.of(second)}
    left_reversed, right_reversed = description.reversed_wheels
    wheels = {"wheel_angle_left": _turned(first, left_reversed), "wheel_angle_right": _turned(second, right_reversed)}
    return columns | wheels


def _turned(raw: Vector, mirrored: bool) -> Vector:
    """Returns the angle of a wheel in rad from the low 10 bits of its counts; the angle begins at 0."""
    angle: Vector = np.unwrap(raw - raw[0], period=1024) * (2 * math.pi / COUNTS_PER_TURN)
    return -angle if mirrored else angle


def _runs(description: Description) -> Iterator[tuple[str, int, int]]:
    """Yields the name of each run, the index of its first sample, and the index after its last sample."""
    begin = at = 0
    label = ""
    for manoeuvre in description.manoeuvres:
        if manoeuvre.label:
            if label:
                yield label, begin, at
                begin = at
            label = manoeuvre.label
        at += manoeuvre.samples
    if label:
        yield label, begin, at
