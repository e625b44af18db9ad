"""The AVR port keeps the contract on a board that simavr simulates; its images keep to stack and control period."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import avr_stack
import pytest
from brickpilot.hil.checkout import AVR_TARGETS
from command import brickpilot
from stack_walk import REQUESTS

ROOT = Path(__file__).resolve().parents[2]
PORT = ROOT / "hal/avr"
IMAGES = [("328p", "imu"), ("328p", "rotation"), ("2560", "all"), ("328p", "imu-mpu6050"), ("2560", "all-lsm6ds")]

# Tests that are skipped, because the simulator or the chip cannot show their cases; hal/avr/README.md lists them, too.
ABSENT = "test_a_device_that_is_not_there_is_absent"
SILENT = "test_a_silent_device_is_stale_and_recovers"
CANNOT = {"imu": {ABSENT}, "rotation": {ABSENT, SILENT}, "all": {ABSENT, SILENT}}

SHARE = 0.9
"""Largest busy share of a control period, with interrupts and commands. The rest is a reserve for time that simavr does
not count."""
STACK = 200
"""Largest stack that an image may need by its graph of calls, bytes. The build leaves at least 400 bytes."""


def run(name: str, chip: str, sensors: str, *port: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "tests/avr/run", name, chip, sensors, *port], capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize(("chip", "sensors"), IMAGES)
def test_the_port_keeps_the_contract(chip: str, sensors: str) -> None:
    done = run("contract", chip, sensors)
    told = dict(re.findall(r"^(test_\w+): (PASS|SKIP)", done.stdout, re.MULTILINE))
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(told) == 9
    assert {name for name, how in told.items() if how == "SKIP"} == CANNOT[sensors.split("-")[0]]


@pytest.mark.parametrize(("chip", "sensors"), IMAGES)
def test_the_port_counts_faults_and_stops_the_motors(chip: str, sensors: str) -> None:
    done = run("port", chip, sensors)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("test_after_a_reset_the_motors_coast_and_the_cause_is_told: PASS") == 3
    assert done.stdout.count(": PASS") == (6 if sensors.startswith("imu") else 8) + (3 if "-" in sensors else 0)


@pytest.mark.parametrize(
    ("file", "of", "to", "name"),
    [
        ("motors.c", "(size + 16U)", "(size + 0U)", "contract"),
        ("motors.c", "left - 1U", "left", "contract"),
        ("clock.c", "until_tick = BOARD_TICK_MS;\n    if", "until_tick = BOARD_TICK_MS + 1;\n    if", "contract"),
        ("analogue.c", "at = 0;", "at = 1;", "contract"),
        ("rotation.c", "{0, -1, 1, ERROR,", "{0, 1, -1, ERROR,", "contract"),
        ("serial.c", "if (put == in_taken) {\n        count_overrun();", "if (put == in_taken) {", "port"),
        ("analogue.c", "if (age < 255)\n        age++;", "", "port"),
        ("guard.c", "if (__heap_start == CANARY)", "", "port"),
        ("guard.c", "    motors_coast();\n    for (;;)", "    for (; __heap_start != 1;)", "port"),
        ("twi.c", "        PULL(BOARD_SCL);\n", "", "port"),
        ("twi.c", "(sent == to_send ? READ : 0)", "READ", "contract"),
        ("digital.c", "{0x1B, 0x10}", "{0x1B, 0x08}", "contract"),
        ("digital.c", "SWAY_AT = 3", "SWAY_AT = 5", "contract"),
        ("digital.c", "!BOARD_GYRO_REVERSED", "BOARD_GYRO_REVERSED", "contract"),
        ("digital.c", "if ((burst[0] & READY) == READY)", "if (SIZE > 0)", "port"),
        ("digital.c", "if (++without_data >= START_TICKS)\n        at = ASK;", "", "port"),
    ],
)
def test_a_slip_in_a_driver_is_caught(file: str, of: str, to: str, name: str, tmp_path: Path) -> None:
    shutil.copytree(PORT, tmp_path / "avr")
    path = tmp_path / "avr" / file
    text = path.read_text()
    assert of in text
    path.write_text(text.replace(of, to))
    sensors = "imu-mpu6050" if file in {"twi.c", "digital.c"} else "rotation"
    assert run(name, "328p", sensors, tmp_path / "avr").returncode != 0


@pytest.fixture(scope="module", params=IMAGES)
def image(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Returns a chip and the folder with an image for it."""
    chip, sensors = request.param
    folder = tmp_path_factory.mktemp(f"{chip}-{sensors}")
    subprocess.run([ROOT / "firmware/targets/avr/build", folder, chip, sensors], check=True, capture_output=True)
    return chip, folder


def test_no_path_through_an_image_takes_more_stack_than_there_is(image: tuple[str, Path]) -> None:
    chip, folder = image
    avr = avr_stack.Avr(folder / "brickpilot.elf", REQUESTS)
    bound = avr_stack.bound(avr, avr_stack.END_OF_RAM[chip])
    assert 100 < bound.all <= STACK
    assert bound.all <= bound.room


def test_an_image_is_elf_hex_and_sizes_with_the_fuses(image: tuple[str, Path], tmp_path: Path) -> None:
    _, folder = image
    elf = folder / "brickpilot.elf"
    told = (folder / "brickpilot.txt").read_text()
    assert re.search(r"^RAM: \d+ of (2048|8192) bytes for variables, \d+ left for the stack$", told, re.MULTILINE)
    for form, file in (("elf32-avr", elf), ("ihex", folder / "brickpilot.hex")):
        of_text = ["-R", ".fuse", "-R", ".comment"] if form == "elf32-avr" else []
        command = ["avr-objcopy", "-I", form, "-O", "binary", *of_text, file, tmp_path / form]
        subprocess.run(command, check=True)
    assert (tmp_path / "ihex").read_bytes() == (tmp_path / "elf32-avr").read_bytes()
    subprocess.run(["avr-objcopy", "-j", ".fuse", "-O", "binary", elf, tmp_path / "fuses"], check=True)
    assert (tmp_path / "fuses").read_bytes() == bytes([0xFF, 0xD9, 0xFC])  # crystal; no boot loader; reset below 4.3 V


@pytest.mark.parametrize("target", ["avr:328p-imu", "avr:2560"])
def test_a_period_ends_in_time_and_takes_no_more_stack_than_its_bound(target: str) -> None:
    done = brickpilot("bench", "--target", target, "--seconds", "3", "--json", cwd=ROOT, fresh=True)
    assert done.stderr == ""
    found = json.loads(done.stdout)
    assert found["cycles"]["all"]["most"] <= SHARE * found["period_cycles"]
    assert found["cycles"]["model"]["typical"] > 5000
    chip, sensors = AVR_TARGETS[target].build
    flown = avr_stack.Avr(ROOT / f"build/avr-{chip}-{sensors}/brickpilot.elf", REQUESTS)
    assert 100 < found["stack_bytes"] <= avr_stack.bound(flown, avr_stack.END_OF_RAM[chip]).all
    assert found["ram_bytes"] + 2 * STACK <= found["ram_of"]
