"""Writes those files of corpus/ that are named after flights: the messages of a short one, as the host sends them.

Files named by a hash come from fuzzing: few inputs that together reach the same code as all that were found
(-set_cover_merge=1 -use_counters=0).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from brickpilot.constants import STEP_S
from brickpilot.hil import ends, fly
from brickpilot.link.links import Link, Message, encode_frame
from brickpilot.link.messages import book
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx

CORPUS = Path(__file__).with_name("corpus")
STEPS = 12


class Listener:
    """A link that keeps what is sent."""

    def __init__(self, link: Link) -> None:
        self.damaged = 0
        self.sent: list[Message] = []
        self._link = link

    def send(self, messages: Sequence[Message]) -> None:
        self.sent += messages
        self._link.send(messages)

    def receive(self, timeout: float) -> list[Message]:
        return self._link.receive(timeout)

    def close(self) -> None: ...


def flown(sensors: str) -> list[Message]:
    """What a host sends in a flight of STEPS steps."""
    mission = scenario.load(scenario.packaged()["mission"])
    mission = dataclasses.replace(mission, duration=STEPS * STEP_S, start_at=0.0)
    with ends.both_ends("tcp") as both:
        link = Listener(both.link)
        plan = flight.plan(mission, rcx(), sensors=sensors, seed=0)
        fly.fly(ends.Ends(link, None), "tcp", plan, pace="lockstep", telemetry_every=1, progress=lambda *_: None)
    return link.sent


def record(message: Message) -> bytes:
    """As fuzz_brick.c reads it: sealed as it stands, or anew where the fuzzer has changed it."""
    identifier, data = message
    sync = identifier == book().by_name["SYNC"].id
    return bytes([2 if sync else 1]) + identifier.to_bytes(2, "little") + data


def main() -> None:
    """Writes all files."""
    for name in ("transports", "brick"):
        (CORPUS / name).mkdir(parents=True, exist_ok=True)
    for sensors in ("ideal", "imu+encoders"):
        frames = flown(sensors)
        slcan = b"\rO\r" + b"".join(f"t{i:03X}{len(d)}{d.hex().upper()}\r".encode() for i, d in frames)
        (CORPUS / "brick" / f"flight-{sensors}").write_bytes(b"".join(map(record, frames)))
        (CORPUS / "transports" / f"serial-{sensors}").write_bytes(b"".join(encode_frame(i, d) for i, d in frames))
        (CORPUS / "transports" / f"slcan-{sensors}").write_bytes(slcan)


if __name__ == "__main__":
    main()
