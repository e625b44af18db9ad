"""An RCX with brickOS in simulated time: processor, interrupts, converter, timers and serial line (hal/h8sim)."""

from __future__ import annotations

import os
import struct
import subprocess
import threading
from dataclasses import dataclass
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import SimulationError
from brickpilot.hil.checkout import script_output

CLOCK_HZ = 16_000_000
RUN_BUTTON = 2
BYTE_MS = 11 / 2.4
PRESS_MS = 250
"""Long enough for the kernel's driver of the buttons, which notices a change twice in 100 ms."""

KINDS = ("idle", "program", "kernel", "clock", "motors", "subsystems", "ERI", "RXI", "TXI", "TEI", "converter")
"""The uses of the processor's time, in the order of hal/h8sim.

idle: it sleeps; program, kernel: tasks; the others are interrupts: clock is the NMI of each ms; motors, the timer's
compare match A of every 2 ms, which also switches tasks; subsystems, its match B: buttons, display, time-outs; ERI to
TEI: the serial line; converter: the A/D converter.
"""

DISPLAY, FONT = 0xEF43, 0xA906
"""Addresses in Debian's kernel: the display's memory, and the segments of each character."""

# For each digit from left to right: byte and bit of the font's bits 0 to 6 in the display's memory.
_SEGMENTS = (
    ((3, 5), (7, 1), (3, 4), (7, 5), (7, 7), (3, 7), (7, 3)),
    ((3, 1), (8, 1), (3, 0), (8, 5), (8, 7), (3, 3), (8, 3)),
    ((1, 1), (5, 1), (1, 0), (6, 5), (6, 7), (1, 3), (5, 3)),
    ((0, 5), (4, 1), (0, 4), (5, 5), (5, 7), (0, 7), (4, 3)),
    ((1, 5), (2, 5), (1, 4), (4, 5), (4, 7), (1, 7), (2, 7)),
)


@dataclass(frozen=True)
class Tally:
    """The work of the processor in some time.

    Attributes:
        states: clock periods in all.
        count: kind -> how often the interrupt came; 0 for idle, program and kernel.
        spent: kind -> states.
    """

    states: int
    count: dict[str, int]
    spent: dict[str, int]

    def since(self, before: Tally) -> Tally:
        return Tally(
            self.states - before.states,
            {kind: self.count[kind] - before.count[kind] for kind in KINDS},
            {kind: self.spent[kind] - before.spent[kind] for kind in KINDS},
        )


class SimulatedRcx:
    """A brick with brickOS and no program, for the duration of a `with` block. Time passes only in `run` and `bring`.

    Attributes:
        ms: simulated time since the brick was switched on.
        driven: how long motors A and C were driven in the last `run` or `bring`, forward less backward, in us.

    Raises:
        InputError: no checkout of the project, no compiler or no brickOS.
    """

    def __init__(self) -> None:
        self.ms = 0.0
        self.driven = (0, 0)
        self._lock = threading.Lock()  # a line's thread may use it at the same time as the owner's
        simulator, kernel = script_output("hal/h8sim/simulator"), script_output("hal/h8sim/kernel")
        self._process = subprocess.Popen(
            [simulator, kernel],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"H8SIM_BRICK": "1"},
        )

    def __enter__(self) -> SimulatedRcx:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=10)

    def run(self, ms: int) -> bytes:
        """Lets time pass. Returns the bytes that the brick sends."""
        return self._pass(struct.pack(">sH", b"r", ms), ms)

    def bring(self, value: int, *, wrong: bool = False) -> bytes:
        """Brings a byte on the line; `wrong`: with a wrong parity. Returns the bytes that the brick sends meanwhile."""
        return self._pass(struct.pack(">sBB", b"l", value, wrong), BYTE_MS)

    def hold(self, keys: int) -> None:
        """Holds these buttons from now on, and no others."""
        with self._lock:
            self._write(struct.pack(">sB", b"k", keys))

    def press(self, key: int) -> None:
        """Presses a button long enough for the kernel's driver, and releases it."""
        for held in (key, 0):
            self.hold(held)
            self.run(PRESS_MS)

    def convert(self, battery: int, *inputs: int) -> None:
        """Sets the converter's readings of the battery and of inputs 1 to 3, 0..1023."""
        command = b"".join(struct.pack(">sBH", b"a", at, raw) for at, raw in enumerate((battery, *inputs)))
        with self._lock:
            self._write(command)

    def memory(self, address: int, size: int) -> bytes:
        with self._lock:
            self._write(struct.pack(">sHH", b"m", address, size))
            return self._read(size)

    def word(self, address: int) -> int:
        return int.from_bytes(self.memory(address, 2), "big")

    def shows(self, text: str) -> bool:
        """Returns whether the display shows `text` in its five digits."""
        display, font = self.memory(DISPLAY, 9), self.memory(FONT, 128)
        shown = [
            sum((display[byte] >> bit & 1) << segment for segment, (byte, bit) in enumerate(digit))
            for digit in _SEGMENTS
        ]
        return shown == [font[ord(character)] for character in text.ljust(len(_SEGMENTS))]

    def watch(self, address: int) -> None:
        """Records, from now on, each time at which the instruction at `address` begins. `watched` tells."""
        with self._lock:
            self._write(struct.pack(">sH", b"b", address))

    def watched(self) -> NDArray[np.float64]:
        """Returns the times since the last call, in s since the start; at most the first 4096."""
        with self._lock:
            self._write(b"e")
            count = int.from_bytes(self._read(2), "big")
            return np.frombuffer(self._read(8 * count), dtype=">u8").astype(float) / CLOCK_HZ

    def tally(self) -> Tally:
        """Returns the work of the processor since the start."""
        with self._lock:
            self._write(b"t")
            states = int.from_bytes(self._read(8), "big")
            rows = [struct.unpack(">IQ", self._read(12)) for _ in KINDS]
        counts, spent = zip(*rows, strict=True)
        return Tally(states, dict(zip(KINDS, counts, strict=True)), dict(zip(KINDS, spent, strict=True)))

    def _pass(self, command: bytes, ms: float) -> bytes:
        with self._lock:
            self._write(command)
            left, right, size = struct.unpack(">iiH", self._read(10))
            self.ms += ms
            self.driven = (left, right)
            return self._read(size)

    def _write(self, command: bytes) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(command)
        self._process.stdin.flush()

    def _read(self, size: int) -> bytes:
        assert self._process.stdout is not None
        received = self._process.stdout.read(size)
        if len(received) != size:
            raise SimulationError("the simulated RCX has been switched off")
        return received
