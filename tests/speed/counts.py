"""Counts the instructions of the plant's and the firmware's inner loops under callgrind; prints or keeps them.

    cmake --preset release && cmake --build --preset release --target speed_kernels
    .venv/bin/python tests/speed/counts.py           # prints the counts, and their change from the kept counts
    .venv/bin/python tests/speed/counts.py --write   # also keeps the counts, for the compiler of the program

Times on a shared machine say little, but the instructions of the same program repeat exactly. Only the program's own
instructions are counted, because libm chooses its functions by the processor. Each compiler makes other code, so the
counts are kept by compiler, and tests/gates/test_instruction_counts.py compares counts of the same compiler. Counts of
several runs at a time also depend on whether the processor has AVX2.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "build/release/tests/speed_kernels"
KEPT = Path(__file__).with_suffix(".json")

STEPS, SAMPLES, RUNS, MOTOR_STEPS = 400, 200, 8, 10
"""How often the kernels of kernels.c repeat their work: the same numbers as there."""

TOLERANCE = 0.02
"""Share by which a count may differ from the kept count. Counts repeat exactly, so a change of 2 % has its cause in the
code."""


@dataclass(frozen=True)
class Kernel:
    """One run of the program: the function whose instructions are counted, and how many times the work is repeated."""

    name: str
    function: str
    times: int


KERNELS = (
    Kernel("fly", "bp_fly", STEPS),
    Kernel("fly", "step_run", STEPS),
    Kernel("body_of_1", "plant_advance", STEPS),
    Kernel("body_of_10", "plant_advance", STEPS),
    Kernel("effects_of_10", "plant_advance", STEPS),
    Kernel("simulate_1", "bp_simulate", SAMPLES - 1),
    Kernel("simulate_8", "bp_simulate", RUNS * (SAMPLES - 1)),
    Kernel("simulate_8_effects", "bp_simulate", RUNS * (SAMPLES - 1)),
)

Counted = Mapping[tuple[str, str], float]

FIGURES: dict[str, Callable[[Counted], float]] = {
    "control step of the firmware": lambda n: n["fly", "step_run"],
    "full loop, a control step": lambda n: n["fly", "bp_fly"],
    "body step of 10 motor steps": lambda n: n["body_of_10", "plant_advance"],
    "motor step": lambda n: (n["body_of_10", "plant_advance"] - n["body_of_1", "plant_advance"]) / (MOTOR_STEPS - 1),
    "body step with two effects": lambda n: n["effects_of_10", "plant_advance"],
    "simulate, a sample of 10 ms": lambda n: n["simulate_1", "bp_simulate"],
    "simulate 8 runs, a sample of one": lambda n: n["simulate_8", "bp_simulate"],
    "simulate 8 runs with two effects, a sample of one": lambda n: n["simulate_8_effects", "bp_simulate"],
}
"""Name of a figure -> a function that computes its instructions from the kernels' counts per repetition."""


def compiler(program: Path = PROGRAM) -> str:
    """Returns the key of the kept figures: the compiler of the program, and the vector registers that it finds."""
    return subprocess.run([program], stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def count(kernel: Kernel, program: Path = PROGRAM) -> float:
    """Returns the program's own instructions in the kernel's function, per repetition of the work."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [
            "valgrind", "--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={kernel.function}",
            f"--callgrind-out-file={out}", program, kernel.name,
        ]  # fmt: skip
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return own(out.read_text(encoding="utf-8"), program.name) / kernel.times


def own(text: str, program: str) -> int:
    """Returns the number of instructions of `program` itself in the text of a callgrind file, without its libraries'.

    The line after "calls=" is left out: it holds the cost of a call, which the lines of the called function also hold.
    """
    objects: dict[str, str] = {}
    inside, called, total = False, False, 0
    for line in text.splitlines():
        key, _, value = line.partition("=")
        if key in ("ob", "cob"):
            number, _, path = value.partition(" ")
            if path:
                objects[number] = path
            if key == "ob":
                inside = Path(objects[number]).name == program
        elif key == "calls":
            called = True
        elif line.startswith(tuple("0123456789+-*")):
            if inside and not called:
                total += int(line.split()[1])
            called = False
    return total


def figures(program: Path = PROGRAM) -> dict[str, float]:
    """Returns figure -> instructions, rounded to 0.1, for each of `FIGURES`."""
    counted = {(kernel.name, kernel.function): count(kernel, program) for kernel in KERNELS}
    return {name: round(figure(counted), 1) for name, figure in FIGURES.items()}


def kept() -> dict[str, dict[str, float]]:
    """Returns compiler -> figures, from the file of kept counts."""
    found: dict[str, dict[str, float]] = json.loads(KEPT.read_text(encoding="utf-8"))
    return found


def changed(found: Mapping[str, float], wanted: Mapping[str, float]) -> list[str]:
    """Returns a line for each figure that differs from the kept figure by more than the share `TOLERANCE`."""
    lines = []
    for name in sorted({*found, *wanted}):
        now, before = found.get(name), wanted.get(name)
        if now is None or before is None:
            lines.append(f"{name}: is {'not counted' if now is None else 'not kept'}")
        elif abs(now - before) > TOLERANCE * before:
            lines.append(f"{name}: {now:.0f} instructions, kept {before:.0f} ({100 * (now / before - 1):+.1f} %)")
    return lines


def main() -> None:
    """Prints the counts, and keeps them with --write."""
    by, found = compiler(), figures()
    before = kept().get(by, {})
    print(f"instructions, built by {by}")
    for name, value in found.items():
        old = f"{100 * (value / before[name] - 1):+6.1f} %" if name in before else "   new"
        print(f"{value:10.1f} {old}  {name}")
    if "--write" in sys.argv[1:]:
        KEPT.write_text(json.dumps(kept() | {by: found}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
