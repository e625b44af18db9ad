"""With the readings of an AVR, the control loop on the host has the AVR's state after each tick, bit for bit."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from brickpilot.hil import avr_flight
from brickpilot.hil import fly as over_a_link
from brickpilot.hil.avr_flight import AvrRobot, avr_image, open_robot
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.settings import settings

ROOT = Path(__file__).parents[2]
REST_S, SECONDS = 1.0, 3.0
MOTOR_STEP_S = 0.0003


def build_on_host(target: str, folder: Path) -> Path:
    """Compiles the control loop for this machine; returns the program.

    The flags are those of the image for `target`, and variables have the same layout as on the chip.
    """
    flags = subprocess.run(
        [ROOT / "firmware/targets/avr/flags", *AVR_TARGETS[target].build], capture_output=True, text=True, check=True
    ).stdout.split()
    of_the_image = [flag for flag in flags if not flag.startswith(("-mmcu", "-DAVR_"))]
    sources = [
        path for path in (ROOT / "firmware").rglob("*.c") if not {"targets", "h8"} & set(path.relative_to(ROOT).parts)
    ]
    program = folder / "avr_on_host"
    subprocess.run(
        [
            shutil.which("cc") or "cc",
            "-std=c99",
            "-O2",
            "-fpack-struct",
            "-fshort-enums",
            "-Wno-address-of-packed-member",
            *of_the_image,
        ]
        + [f"-I{ROOT / folder}" for folder in ("firmware", "hal", "hal/include")]
        + [ROOT / "tests/python/avr_on_host.c", *sources, ROOT / "hal/sil/sil.c", *(ROOT / "hal/wire").glob("*.c")]
        + ["-o", program],
        check=True,
    )
    return program


class Watch(AvrRobot):
    """A robot that records the state of the control loop after each tick, while the chip sleeps.

    Args:
        address, size: place of the state in the chip's memory, bytes.
        tick_at: offset of the number of ticks in the state, bytes.
    """

    def __init__(self, robot: AvrRobot, address: int, size: int, tick_at: int) -> None:
        self.__dict__ = robot.__dict__
        self.records: list[bytes] = []
        self._address, self._size, self._tick_at = address, size, tick_at
        self._tick = self.tick()

    def tick(self) -> int:
        """Returns the number of ticks that the control loop has completed."""
        return int.from_bytes(self.read(self._address + self._tick_at, 4), "little")

    def wait(self, motor_steps: int) -> None:
        for _ in range(motor_steps):
            super().wait(1)
            if (tick := self.tick()) != self._tick:
                assert tick == self._tick + 1
                self._tick = tick
                self.records.append(self.read(self._address, self._size))


def address_of(name: str, elf: Path) -> tuple[int, int]:
    """Returns address and size, in bytes, of a variable of the image."""
    listed = subprocess.run(["avr-nm", "-S", elf], capture_output=True, text=True, check=True).stdout
    fields = next(line.split() for line in listed.splitlines() if line.split()[3:] == [name])
    return int(fields[0], 16) & 0xFFFF, int(fields[1], 16)


@pytest.mark.parametrize("target", ["avr:328p-imu", "avr:2560"])
def test_with_the_same_readings_the_host_does_the_same_to_the_bit(
    target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    image, host = avr_image(target), build_on_host(target, tmp_path)
    address, size = address_of("state", image)
    layout = subprocess.run([host], capture_output=True, text=True, check=True).stdout.split()
    assert int(layout[0]) == size
    plan = flight.plan(
        scenario.load(scenario.packaged()["mission"]), rcx(), profile="coupled", sensors=AVR_TARGETS[target].sensors[0]
    )
    log, motors = np.zeros((plan.steps, len(flight.log_names()))), np.zeros((plan.steps, 2), dtype=np.int16)
    with open_robot(plan, image, AVR_TARGETS[target].chip, log, motors) as robot:
        session = Session(robot, target, reply_s=avr_flight.REPLY_S)
        over_a_link.prepare(session, plan, REALTIME, 10, {})
        robot.wait(round((REST_S) / MOTOR_STEP_S))
        watch = Watch(robot, address, size, int(layout[1]))
        session.link = watch
        session.command("start")
        watch.wait(round(SECONDS / MOTOR_STEP_S))
        duty = watch.tell().duty[0]

    cruise = settings()["cruise"]
    route = [str(round(value * 1e3)) for point in plan.scenario.waypoints for value in point]
    done = subprocess.run(
        [host, str(cruise.number), str(cruise.raw(plan.cruise)), *route],
        input=b"".join(watch.records),
        capture_output=True,
        check=True,
    )
    records, differing, first = (int(text) for text in done.stdout.split())
    assert records == len(watch.records) - 1 >= SECONDS / 0.003
    assert (differing, first) == (0, -1)
    assert duty > 0.2  # the robot was driving
