"""brickOS's own kernel on the simulator of the RCX's processor, behind the infrared link; see tests/rcx/alone.c."""

from __future__ import annotations

import struct
import subprocess
import threading
from pathlib import Path
from types import TracebackType

ROOT = Path(__file__).resolve().parents[2]
RUN_BUTTON = 2
RECEIVED, DISPLAY, TASKS, SYSTEM_TASKS, FONT, PROGRAMS = 0xAD72, 0xEF43, 0xAD34, 0xAD38, 0xA906, 0xAC30
"""Addresses in Debian's kernel. RECEIVED is 0 between two packets; PROGRAMS begins with the first program's address."""

BYTE_MS = 11 / 2.4
_REPLY_MS = 300
"""A kernel whose tasks all wait replies sooner."""
_STEP_MS = 10

# For each digit from left to right: byte and bit of the font's bits 0 to 6 in the display's memory.
_SEGMENTS = (
    ((3, 5), (7, 1), (3, 4), (7, 5), (7, 7), (3, 7), (7, 3)),
    ((3, 1), (8, 1), (3, 0), (8, 5), (8, 7), (3, 3), (8, 3)),
    ((1, 1), (5, 1), (1, 0), (6, 5), (6, 7), (1, 3), (5, 3)),
    ((0, 5), (4, 1), (0, 4), (5, 5), (5, 7), (0, 7), (4, 3)),
    ((1, 5), (2, 5), (1, 4), (4, 5), (4, 7), (1, 7), (2, 7)),
)


class Kernel:
    """A brick with brickOS and no program, which is switched on; a device for `rcx_brick.RcxBrick`.

    Its time passes only while it receives bytes, while it replies, and in `run`. `ms` is the time since it was switched
    on.
    """

    def __init__(self) -> None:
        self.ms = 0.0
        self.driven = (0, 0)
        """Pulses of motors A and C in the last `run`, forward less backward."""
        self._receiving = False
        self._lock = threading.Lock()  # for the thread of the line and the test's own
        self._brick = subprocess.Popen(
            [ROOT / "tests/rcx/run", "loader"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self) -> Kernel:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._brick.stdin is not None
        self._brick.stdin.close()
        self._brick.wait(timeout=10)

    def silence(self) -> None:
        """Lets time pass for longer than the receiver waits."""
        self.run(_STEP_MS)

    def damaged(self) -> None:
        self._pass(struct.pack(">sBB", b"l", 0, 1), BYTE_MS)

    def byte(self, value: int) -> bytes:
        sent = self.bring(value)
        before, self._receiving = self._receiving, self.word(RECEIVED) != 0
        if self._receiving or not before:
            return sent
        for _ in range(0, _REPLY_MS, _STEP_MS):
            more = self.run(_STEP_MS)
            if sent and not more:
                break
            sent += more
        return sent

    def bring(self, value: int) -> bytes:
        """Brings one byte. Returns the bytes that the brick sends meanwhile."""
        return self._pass(struct.pack(">sBB", b"l", value, 0), BYTE_MS)

    def run(self, ms: int) -> bytes:
        """Lets time pass. Returns the bytes that the brick sends."""
        sent, pulses = b"", (0, 0)
        for begin in range(0, ms, 1000):
            step = min(1000, ms - begin)
            sent += self._pass(struct.pack(">sH", b"r", step), step)
            pulses = (pulses[0] + self.driven[0], pulses[1] + self.driven[1])
        self.driven = pulses
        return sent

    def press(self, key: int) -> None:
        """Presses a key long enough for the kernel's driver, and releases it."""
        for held in (key, 0):
            with self._lock:
                self._command(struct.pack(">sB", b"k", held))
            self.run(250)

    def convert(self, battery: int, *inputs: int) -> None:
        """Sets the readings of the analogue-to-digital converter, 0..1023."""
        for at, raw in enumerate((battery, *inputs)):
            with self._lock:
                self._command(struct.pack(">sBH", b"a", at, raw))

    def memory(self, address: int, size: int) -> bytes:
        with self._lock:
            self._command(struct.pack(">sHH", b"m", address, size))
            return self._read(size)

    def word(self, address: int) -> int:
        return int.from_bytes(self.memory(address, 2), "big")

    @property
    def user_tasks(self) -> int:
        return self.word(TASKS) - self.word(SYSTEM_TASKS)

    def shows(self, text: str) -> bool:
        """Returns whether the display shows `text` in its five digits."""
        display, font = self.memory(DISPLAY, 9), self.memory(FONT, 128)
        shown = [
            sum((display[byte] >> bit & 1) << segment for segment, (byte, bit) in enumerate(digit))
            for digit in _SEGMENTS
        ]
        return shown == [font[ord(character)] for character in text.ljust(len(_SEGMENTS))]

    def _pass(self, command: bytes, ms: float) -> bytes:
        with self._lock:
            self._command(command)
            self.ms += ms
            left, right, size = struct.unpack(">hhB", self._read(5))
            self.driven = (left, right)
            return self._read(size)

    def _command(self, command: bytes) -> None:
        assert self._brick.stdin is not None
        self._brick.stdin.write(command)
        self._brick.stdin.flush()

    def _read(self, size: int) -> bytes:
        assert self._brick.stdout is not None
        received = self._brick.stdout.read(size)
        assert len(received) == size, "the brick has been switched off"
        return received
