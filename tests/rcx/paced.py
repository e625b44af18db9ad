"""paced.py PATH: a simulated RCX before an infrared tower, in real time, at the serial port PATH, for an hour at most.

Its kernel is brickOS's own, the line carries 2400 baud, and every instruction takes its time (hal/h8sim): what the
tools take for a real brick, they take for this one.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import time
import tty
from collections import deque
from pathlib import Path

from brickpilot.hil.rcx_flight import SimulatedRcx

IDLE_MS = 4
NINE_VOLTS, LEVEL = 319, 512


def new_port(path: Path) -> int:
    """A fresh pseudo-terminal: one that is opened again cannot be set up again."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path.unlink(missing_ok=True)
    path.symlink_to(os.ttyname(slave))
    os.close(slave)
    return master


def heard(master: int) -> bytes | None:
    """What has come; None where nobody has the port open."""
    if not select.select([master], [], [], 0)[0]:
        return b""
    try:
        return os.read(master, 4096)
    except OSError as error:
        if error.errno != errno.EIO:
            raise
        return None


def serve(kernel: SimulatedRcx, path: Path) -> None:
    master, opened, waiting = new_port(path), False, deque[int]()
    began, began_ms = time.monotonic(), kernel.ms
    while True:
        received = heard(master)
        if received is None and opened:
            os.close(master)
            master, opened = new_port(path), False
        elif received:
            opened = True
            waiting.extend(received)
        if waiting:
            value = waiting.popleft()
            sent = bytes([value]) + kernel.bring(value)
        else:
            sent = kernel.run(IDLE_MS)
        time.sleep(max(0.0, began + (kernel.ms - began_ms) / 1000 - time.monotonic()))
        if sent and opened:
            os.write(master, sent)


def main() -> None:
    path = Path(sys.argv[1])
    with SimulatedRcx() as kernel:
        kernel.convert(NINE_VOLTS, LEVEL, LEVEL, LEVEL)
        try:
            serve(kernel, path)
        except KeyboardInterrupt:
            pass
        finally:
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
