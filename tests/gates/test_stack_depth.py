"""The graph of calls bounds the firmware's stack on this machine; planted faults are found here, on AVR and on H8.

test_avr.py and test_rcx.py bound the stacks of the images that they build.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import avr_stack
import h8_stack
import host_stack
import pytest
from stack_walk import REQUESTS, UnboundedError

ROOT = Path(__file__).resolve().parents[2]
HOST_STACK = 1024
"""Largest stack of the firmware on this machine, bytes. Its pointers are four times as large as a brick's."""


def test_the_firmware_keeps_within_a_kilobyte_on_this_machine(tmp_path: Path) -> None:
    script = (ROOT / "firmware/targets/host/build").read_text(encoding="utf-8")
    assert "firmware/targets/h8sim/main.c firmware/targets/host/system.c" in script
    sources = [ROOT / f"firmware/targets/{name}.c" for name in ("h8sim/main", "host/system")]
    sources += (ROOT / f"hal/wire/{name}.c" for name in ("crc", "codecs_gen", "frame", "message"))
    sources += (ROOT / "hal/link").glob("*.c")
    sources += (one for one in (ROOT / "firmware").rglob("*.c") if "targets" not in one.parts)
    host_stack.compiled(tmp_path, sources, *(f"-I{ROOT / folder}" for folder in ("firmware", "hal", "hal/include")))
    assert 200 < host_stack.most(tmp_path, "main", REQUESTS) <= HOST_STACK


RECURSION = "int again(int n); int again(int n) { return n < 2 ? 1 : n + again(n - 1) * again(n - 2); }"
ARRAY = "volatile char a[512]; for (int i = 0; i < 512; i++) a[i] = (char)n; return a[n & 511];"
LARGE = f"int again(int n); int again(int n) {{ {ARRAY} }}"
POINTER = "int (*volatile chosen)(int); int again(int n); int again(int n) { return chosen(n) + 1; }"
MAIN = "volatile int input; int main(void) { return again(input); }"


def _avr(folder: Path, source: Path) -> int:
    subprocess.run([ROOT / "hal/avr/compile", "-mmcu=atmega328p", source, folder / "a.o"], check=True)
    subprocess.run(["avr-gcc", "-mmcu=atmega328p", "-o", folder / "a.elf", folder / "a.o"], check=True)
    return avr_stack.bound(avr_stack.Avr(folder / "a.elf", {}), avr_stack.END_OF_RAM["328p"]).all


def _h8(folder: Path, source: Path) -> int:
    objects = [folder / "a.o", folder / "frames.o"]
    for one, made in zip((source, ROOT / "firmware/core/h8/frames.S"), objects, strict=True):
        subprocess.run([ROOT / "hal/h8/compile", one, made], check=True)
    options = ["-T", h8_stack.LINKER_SCRIPT, "-Ttext", "0xb000", "--oformat", "coff-h8300"]
    subprocess.run(["h8300-hms-ld", *options, "-o", folder / "a.coff", *objects], check=True)
    return h8_stack.bounds(h8_stack.H8(folder / "a.coff", h8_stack.kernel(), {}), ("main",))["main"].all


def _host(folder: Path, source: Path) -> int:
    host_stack.compiled(folder, [source])
    return host_stack.most(folder, "main", {})


def test_interrupts_that_let_others_in_are_counted_all(tmp_path: Path) -> None:
    handlers = "".join(f"ISR({one}_vect{{}}) {{ input++; }}\n" for one in ("ADC", "TIMER2_COMPA"))
    source, found = tmp_path / "planted.c", []
    for how in ("", ", ISR_NOBLOCK"):
        text = f"#include <avr/interrupt.h>\nvolatile int input;\n{handlers.replace('{}', how)}"
        source.write_text(f"{text}int main(void) {{ return input; }}\n", encoding="utf-8")
        found.append(_avr(tmp_path, source))
    assert found[1] > found[0] + 5


@pytest.mark.parametrize(("of", "room"), [(_avr, 500), (_h8, 344), (_host, 500)])
def test_recursion_a_large_array_and_an_unlisted_pointer_are_found(
    of: Callable[[Path, Path], int], room: int, tmp_path: Path
) -> None:
    source = tmp_path / "planted.c"
    source.write_text(f"{RECURSION}\n{MAIN}\n", encoding="utf-8")
    with pytest.raises(UnboundedError, match="recursion: again -> again"):
        of(tmp_path, source)
    source.write_text(f"{LARGE}\n{MAIN}\n", encoding="utf-8")
    assert of(tmp_path, source) > room
    source.write_text(f"{POINTER}\n{MAIN}\n", encoding="utf-8")
    with pytest.raises(UnboundedError, match="no list says where"):
        of(tmp_path, source)
