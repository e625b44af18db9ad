"""A brick in a thread of this process, at one end of a CAN bus."""

from __future__ import annotations

import threading
import time
from typing import Any

import can

from brickpilot.compiled import interface


class BrickThread:
    """A brick in a thread of this process, at one end of a CAN bus.

    Args:
        bus: an open bus, which `stop` shuts down.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._ended = threading.Event()
        self._restart = threading.Event()
        self._thread = threading.Thread(target=self._run, name="brick", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        ffi: Any
        ffi, library = interface("brickpilot_brick")
        brick = ffi.gc(library.bp_brick_new(), library.bp_brick_free)
        identifier, data = ffi.new("unsigned int *"), ffi.new("unsigned char[8]")
        while not self._ended.is_set():
            if self._restart.is_set():
                brick = ffi.gc(library.bp_brick_new(), library.bp_brick_free)
                self._restart.clear()
            wait_us = library.bp_brick_time(brick, time.monotonic_ns() // 1000)
            self._send(library, brick, identifier, data, ffi)
            try:
                message = self._bus.recv(min(wait_us * 1e-6, 0.1))
            except (can.CanError, OSError):
                return
            if message is None or message.is_extended_id or message.is_remote_frame or message.is_fd:
                continue
            library.bp_brick_take(brick, message.arbitration_id, bytes(message.data), len(message.data))
            self._send(library, brick, identifier, data, ffi)

    def _send(self, library: Any, brick: Any, identifier: Any, data: Any, ffi: Any) -> None:
        while (size := library.bp_brick_give(brick, identifier, data)) >= 0:
            payload = bytes(ffi.buffer(data, size))
            self._bus.send(can.Message(arbitration_id=identifier[0], data=payload, is_extended_id=False, check=False))

    def restart(self) -> None:
        """Switches the brick off and on, and returns when it runs again."""
        self._restart.set()
        while self._restart.is_set() and self._thread.is_alive():
            time.sleep(0.001)

    def stop(self) -> None:
        """Ends the thread and shuts down the bus."""
        self._ended.set()
        self._thread.join(5.0)
        self._bus.shutdown()
