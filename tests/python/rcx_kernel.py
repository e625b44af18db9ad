"""The kernel of brickOS in a simulated RCX with an infrared link: a device for `rcx_brick.RcxBrick`."""

from __future__ import annotations

from brickpilot.hil.rcx_flight import RUN_BUTTON, SimulatedRcx

__all__ = ["PROGRAMS", "RUN_BUTTON", "Kernel"]

RECEIVED, TASKS, SYSTEM_TASKS, PROGRAMS = 0xAD72, 0xAD34, 0xAD38, 0xAC30
"""Addresses in the kernel of Debian's package brickos. The word at RECEIVED is 0 between two packets. The table at
PROGRAMS begins with the address of the first program."""

_REPLY_MS = 300
"""Longest wait for a reply, ms. If all tasks of a kernel wait, the kernel replies sooner."""
_STEP_MS = 10


class Kernel(SimulatedRcx):
    """A brick with brickOS and no program, which is switched on."""

    def __enter__(self) -> Kernel:
        return self

    def silence(self, quiet_s: float) -> None:
        """Lets `quiet_s` seconds pass in the brick too, because a brick receives nothing while it sends telemetry."""
        self.run(max(2 * _STEP_MS, round(1000 * quiet_s)))

    def damaged(self) -> None:
        self.bring(0, wrong=True)

    def byte(self, value: int) -> bytes:
        """Sends a byte to the brick; returns what the brick sends. After the end of a packet, waits for the reply."""
        before = self.word(RECEIVED) != 0
        sent = self.bring(value) + self.run(2)  # the interrupt takes up to 1 ms to copy a whole packet
        receiving = self.word(RECEIVED) != 0
        if receiving or not before:
            return sent
        for _ in range(0, _REPLY_MS, _STEP_MS):
            more = self.run(_STEP_MS)
            if sent and not more:
                break
            sent += more
        return sent

    @property
    def user_tasks(self) -> int:
        return self.word(TASKS) - self.word(SYSTEM_TASKS)
