"""hal/h8/shared_parts.awk does not change the program: with its jumps expanded, its output is the compiler's text."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ON_HOSTS = ("body_pose", "pid_start")
SOURCES = sorted(
    [path for path in (ROOT / "firmware").rglob("*.c") if "targets" not in path.parts and path.stem not in ON_HOSTS]
    + [*(ROOT / "hal/rcx").glob("*.c"), *(ROOT / "firmware/targets/rcx").glob("*.c")]
)
BRICKOS = ["-isystem", "/usr/include/brickos", "-isystem", "/usr/include/brickos/lnp"]
WORTH_BYTES = 250  # least number of bytes that make the script worth keeping
SAVE = ["\tmov.w\tr4,@-r7", "\tmov.w\tr5,@-r7", "\tmov.w\tr6,@-r7"]
RESTORE_TWO = ["\tmov.w\t@r7+,r5", "\tmov.w\t@r7+,r4"]
RESTORE = ["\tmov.w\t@r7+,r6", *RESTORE_TWO]
RETURN = "\trts"
TARGET = re.compile(r"\tj(?:sr|mp)\t@_(\w+)")


def moved(frame: int) -> list[str]:
    """Returns the compiler's code that reserves `frame` bytes of locals, or, if `frame` is negative, frees them."""
    if abs(frame) <= 4:
        return [f"\t{'subs' if frame > 0 else 'adds'}\t#2,r7"] * (abs(frame) // 2)
    return [f"\tmov.w\t#{-frame},r3", "\tadd.w\tr3,r7"]


def written_out(lines: list[str]) -> tuple[list[str], dict[str, int]]:
    """Returns the text with each jump replaced by its code from firmware/core/h8/frames.S, and jump -> how often."""
    out: list[str] = []
    counts: dict[str, int] = {}
    for line in lines:
        found = TARGET.fullmatch(line)
        name = found[1] if found else ""
        if name.endswith("_framed"):
            frame = int(re.fullmatch(r"\tmov\.b\t#(\d+),r[23]l", out.pop())[1])  # type: ignore[index]
            out += [*moved(frame), *SAVE] if name == "begin_saved_framed" else [*RESTORE, *moved(-frame), RETURN]
        elif name in ("begin_saved", "end_saved", "end_two_saved"):
            out += {"begin_saved": SAVE, "end_saved": [*RESTORE, RETURN], "end_two_saved": [*RESTORE_TWO, RETURN]}[name]
        elif name and line.startswith("\tjmp"):  # the compiler itself jumps only to labels within a function: .L
            out += [f"\tjsr\t@_{name}", RETURN]
            name = "last call"
        else:
            out.append(line)
            continue
        counts[name] = counts.get(name, 0) + 1
    return out, counts


def text_bytes(*objects: Path) -> int:
    sizes = subprocess.run(["h8300-hms-size", *objects], capture_output=True, text=True, check=True).stdout
    return sum(int(line.split()[0]) for line in sizes.splitlines()[1:])


@pytest.mark.parametrize("sensors", ["imu", "rotation"])
def test_written_out_again_it_is_what_the_compiler_made_and_it_is_worth_its_place(tmp_path: Path, sensors: str) -> None:
    kept, tools = tmp_path / "kept", tmp_path / "tools"
    kept.mkdir()
    tools.mkdir()
    assembler = tools / "h8300-hms-as"  # keeps its input and the text before shared_parts.awk
    real = shutil.which("h8300-hms-as")
    assert real, "no h8300-hms-as: tests/run installs it"
    assembler.write_text(f'#!/bin/sh\ncp "$3" "${{3%.s}}.gcc" "{kept}"\nexec {real} "$@"\n')
    assembler.chmod(0o755)
    flags = subprocess.run(
        [ROOT / "firmware/targets/rcx/flags", sensors], check=True, stdout=subprocess.PIPE, text=True
    ).stdout.split()
    with_path = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    objects = []
    for number, source in enumerate(SOURCES):
        objects.append(tmp_path / f"{number}_{source.stem}.o")
        command = [ROOT / "hal/h8/compile", *flags, "-DBODY_VELOCITY_ONLY", *BRICKOS, source, objects[-1]]
        subprocess.run(command, check=True, env=with_path)

    total: dict[str, int] = {}
    plain = []
    for made in objects:
        compiled = [line for line in (kept / f"{made.name}.gcc").read_text().split("\n") if line]
        out, counts = written_out((kept / f"{made.name}.s").read_text().splitlines())
        assert out == compiled, f"{made.name}: not what the compiler made"
        total = {name: total.get(name, 0) + counts.get(name, 0) for name in {**total, **counts}}
        plain.append(tmp_path / f"plain_{made.name}")
        subprocess.run([real, "-o", plain[-1], kept / f"{made.name}.gcc"], check=True)
    assert set(total) == {
        "begin_saved",
        "begin_saved_framed",
        "end_saved",
        "end_saved_framed",
        "end_two_saved",
        "last call",
    }

    frames = tmp_path / "frames.o"
    subprocess.run([ROOT / "hal/h8/compile", ROOT / "firmware/core/h8/frames.S", frames], check=True)
    saved = text_bytes(*plain) - text_bytes(*objects) - text_bytes(frames)
    print(f"{sensors}: {saved} bytes saved, {total}")
    assert saved >= WORTH_BYTES
