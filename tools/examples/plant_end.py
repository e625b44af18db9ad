"""The plant's end of a link, with only Python's standard library: your own robot behind hal/README.md's messages.

.venv/bin/brickpilot brick --pty                                        prints serial:/dev/pts/N
python tools/examples/plant_end.py /dev/pts/N hal/wire/brickpilot.dbc   in another terminal

It runs in lockstep: in each step, the robot waits for the motor command. Put your own simulator in place of `Robot`.
"""

from __future__ import annotations

import binascii
import math
import os
import select
import struct
import sys
import tty
from pathlib import Path

OPEN, HELLO, COMMAND, COMMAND_REPLY = 32, 33, 48, 49
BATTERY, REFERENCE_X, REFERENCE_Y, REFERENCE_TURN = 130, 131, 132, 133
SYNC, MOTORS, WAYPOINT_REQUEST, WAYPOINT, ROUTE_REQUEST, ROUTE, HEARTBEAT = 134, 144, 258, 259, 260, 261, 384
PROTOCOL, COUPLED, LOCKSTEP, START, WRITE, ARRIVED, FAULT = 1, 0, 0, 1, 64, 2, 3
STATUSES = 0b00000101  # status of IMU and rotation sensors: absent; of battery and reference: ok
STEP_MS, LONGEST_MS = 3, 60_000
Message = tuple[int, bytes]


class Robot:
    """Two wheels with a lag, seen from above: x forward, y right, angles clockwise. SI units."""

    x = y = heading = left = right = 0.0

    def step(self, left_duty: float, right_duty: float) -> None:
        self.left += (1.5 * left_duty - self.left) * STEP_MS / 350
        self.right += (1.5 * right_duty - self.right) * STEP_MS / 350
        self.heading += self.yaw_rate() * STEP_MS / 1000
        self.x += self.speed() * math.cos(self.heading) * STEP_MS / 1000
        self.y += self.speed() * math.sin(self.heading) * STEP_MS / 1000

    def speed(self) -> float:
        return (self.left + self.right) / 2

    def yaw_rate(self) -> float:
        return (self.left - self.right) / 0.14


def crc(data: bytes) -> bytes:
    return struct.pack("<H", binascii.crc_hqx(data, 0xFFFF))


def framed(message: Message) -> bytes:
    raw = struct.pack("<HB", message[0], len(message[1])) + message[1]
    return b"".join(bytes([len(part) + 1]) + part for part in (raw + crc(raw)).split(b"\0")) + b"\0"


def unframed(block: bytes) -> Message | None:
    raw, at = b"", 0
    while at < len(block):
        raw, at = raw + block[at + 1 : at + block[at]] + b"\0", at + block[at]
    raw = raw[:-1]  # the last 0 is not data
    return (raw[0] | raw[1] << 8, raw[3:-2]) if len(raw) >= 5 and crc(raw[:-2]) == raw[-2:] else None


class Line:
    """A serial line to the brick. `mode` is the mode in the brick's newest heartbeat."""

    def __init__(self, path: str) -> None:
        self.file, self.rest, self.mode, self.sequence = os.open(path, os.O_RDWR | os.O_NOCTTY), b"", 0, 0
        tty.setraw(self.file)
        os.write(self.file, b"\0")  # ends a frame that another program has left

    def ask(self, messages: list[Message], reply: int, place: int) -> bytes:
        """Sends messages, up to four times, until a reply comes whose byte at `place` is their sequence number."""
        for _ in range(4):
            os.write(self.file, b"".join(map(framed, messages)))
            while select.select([self.file], [], [], 0.25)[0]:
                *blocks, self.rest = (self.rest + os.read(self.file, 4096)).split(b"\0")
                came = [message for message in map(unframed, blocks) if message]
                self.mode = next((data[6] & 15 for identifier, data in came if identifier == HEARTBEAT), self.mode)
                for identifier, data in came:
                    if identifier == reply and data[place] == self.sequence:
                        return data
        raise TimeoutError(f"the brick does not reply to message {messages[-1][0]}")

    def request(self, identifier: int, reply: int, form: str, *values: int) -> bytes:
        self.sequence = self.sequence + 1 & 255
        data = struct.pack("<B" + form, self.sequence, *values).ljust(6, b"\0")
        return self.ask([(identifier, data + crc(struct.pack("<H", identifier) + data))], reply, 0)

    def step(self, time_ms: int, robot: Robot) -> tuple[int, int]:
        """Sends the sensors' readings as a set, and returns both duties, -32767..32767."""
        self.sequence = self.sequence + 1 & 255
        end = struct.pack("<BB", self.sequence, time_ms & 255)  # of each part
        turn = (round(robot.heading * 32768 / math.pi) + 0x8000 & 0xFFFF) - 0x8000
        parts = [
            (BATTERY, struct.pack("<H4x", 9000) + end),
            (REFERENCE_X, struct.pack("<ih", round(robot.x * 1e6), turn) + end),
            (REFERENCE_Y, struct.pack("<ih", round(robot.y * 1e6), round(robot.speed() * 16000)) + end),
            (REFERENCE_TURN, struct.pack("<h4x", round(robot.yaw_rate() * 1000)) + end),
        ]
        head = struct.pack("<IBB", time_ms, self.sequence, STATUSES)
        check = crc(struct.pack("<H", SYNC) + head + b"".join(data for _, data in parts))
        left, right = struct.unpack_from("<hh", self.ask([*parts, (SYNC, head + check)], MOTORS, 4))
        return left, right


def fly(path: str, dbc: bytes, route_mm: list[tuple[int, int]]) -> tuple[bool, list[tuple[float, float]]]:
    """Flies the route. Returns whether the brick reports its arrival, and the positions in all steps, in m."""
    line, robot, track = Line(path), Robot(), []
    hello = line.request(OPEN, HELLO, "BHBB", PROTOCOL, binascii.crc_hqx(dbc, 0xFFFF), COUPLED, LOCKSTEP)
    refused = [hello[5]]
    for index, (x, y) in enumerate(route_mm):
        refused.append(line.request(WAYPOINT_REQUEST, WAYPOINT, "Bhh", index | WRITE, x, y)[1] >> 6)
    check = binascii.crc_hqx(b"".join(struct.pack("<hh", x, y) for x, y in route_mm), 0xFFFF)
    refused.append(line.request(ROUTE_REQUEST, ROUTE, "BH", len(route_mm) | WRITE, check)[4])
    refused.append(line.request(COMMAND, COMMAND_REPLY, "B", START)[3])
    if any(refused):
        raise ValueError(f"the brick refuses: {refused}")
    for time_ms in range(STEP_MS, LONGEST_MS, STEP_MS):
        left, right = line.step(time_ms, robot)
        robot.step(left / 32767, right / 32767)
        track.append((robot.x, robot.y))
        if line.mode in (ARRIVED, FAULT):
            break
    os.close(line.file)
    return line.mode == ARRIVED, track


if __name__ == "__main__":
    arrived, track = fly(sys.argv[1], Path(sys.argv[2]).read_bytes(), [(1000, 0), (1000, 1000), (0, 1000)])
    x, y = track[-1]
    print(f"{'arrived' if arrived else 'not arrived'} at {x:.2f}, {y:.2f} m after {len(track)} steps")
    sys.exit(not arrived)
