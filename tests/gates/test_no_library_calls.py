"""The RCX's compiler (int has 16 bits) accepts firmware/ and hal/wire/, which call only each other and the HAL."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BRICKOS = Path("/usr/lib/brickos/brickOS.lds")
TARGET = ROOT / "firmware/targets/rcx"
PORT = ["-isystem", "/usr/include/brickos", "-isystem", "/usr/include/brickos/lnp"]
FIRMWARE = sorted(path for path in (ROOT / "firmware").rglob("*.[cS]") if "targets" not in path.parts)
HAL = set(re.findall(r"\bhal_\w+(?=\()", (ROOT / "hal/include/hal.h").read_text()))


def undefined_after_linking(sources: list[Path], folder: Path, *defines: str) -> set[str]:
    """Returns the symbols that are undefined after all `sources` are compiled for the H8/300 and linked together."""
    objects = []
    for number, source in enumerate(sources):
        objects.append(folder / f"{number}_{source.stem}.o")
        subprocess.run([ROOT / "hal/h8/compile", *defines, source, objects[-1]], check=True)
    whole = folder / "whole.o"
    subprocess.run(["h8300-hms-ld", "-r", "-o", str(whole), *map(str, objects)], check=True)
    listed = subprocess.run(["h8300-hms-nm", "-u", str(whole)], check=True, capture_output=True, text=True).stdout
    return {line.split()[-1].removeprefix("_") for line in listed.splitlines() if line.strip()}


@pytest.fixture(autouse=True)
def _compiler() -> None:
    assert shutil.which("h8300-hms-gcc"), "no h8300-hms-gcc: tests/run installs it"


@pytest.mark.parametrize("defines", [(), ("-DBODY_WITHOUT_PAPER",), ("-DBODY_WITHOUT_COUPLED",)])
def test_firmware_needs_nothing_but_the_hal(tmp_path: Path, defines: tuple[str, ...]) -> None:
    sources = FIRMWARE + sorted((ROOT / "hal/wire").glob("*.c"))
    sources += [ROOT / "hal/link/set.c"]
    assert len(sources) > 10
    missing = undefined_after_linking(sources, tmp_path, *defines)
    assert missing <= HAL, f"library calls: {sorted(missing - HAL)}"


def kernel_symbols() -> set[str]:
    """Returns the symbols of brickOS that a program may use: without arithmetic, as no test can run LEGO's ROM."""
    names = set(re.findall(r"^\s*_(\w+) = 0x", BRICKOS.read_text(), re.MULTILINE))
    assert "lnp_addressing_write" in names, f"{BRICKOS}: no list of symbols"
    return {name for name in names if not name.startswith("__")}


@pytest.mark.parametrize("sensors", ["imu", "rotation"])
def test_the_rcx_port_needs_nothing_but_the_kernel(tmp_path: Path, sensors: str) -> None:
    flags = subprocess.run([TARGET / "flags", sensors], check=True, stdout=subprocess.PIPE, text=True).stdout
    defines = flags.split()
    autopilot = [*FIRMWARE, *sorted((ROOT / "hal/rcx").glob("*.c")), TARGET / "main.c", TARGET / "panel.c"]
    autopilot += [ROOT / "hal/wire/crc.c", ROOT / "hal/wire/message.c"]
    recorder = [TARGET / "recorder.c", ROOT / "hal/rcx/motors.c", ROOT / "hal/rcx/sensors.c"]
    recorder.append(ROOT / "firmware/core/h8/frames.S")
    for sources in (autopilot, recorder):
        missing = undefined_after_linking(sources, tmp_path, *PORT, *defines)
        assert "lnp_addressing_write" in missing
        assert missing <= kernel_symbols(), f"neither ours nor the kernel's: {sorted(missing - kernel_symbols())}"


def test_arithmetic_of_the_rom_is_no_kernel_symbol() -> None:
    assert "__mulsi3" not in kernel_symbols()


def test_a_plain_product_is_caught(tmp_path: Path) -> None:
    source = tmp_path / "bad.c"
    source.write_text("long product(long a, long b) { return a * b; }\n")
    assert not undefined_after_linking([source], tmp_path) <= HAL
