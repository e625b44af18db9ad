"""Writes the table of firmware/README.md that puts the RCX beside the ATmega328P and the ATmega2560.

.venv/bin/python tests/loop/brick_table.py            measures by `brickpilot bench`, which takes minutes
.venv/bin/python tests/loop/brick_table.py --kept     writes the table from bricks.json beside this file
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from brickpilot.firmware import boards

ROOT = Path(__file__).resolve().parents[2]
FIGURES = Path(__file__).with_name("bricks.json")
README = ROOT / "firmware/README.md"
BEGIN, END = "<!-- bricks -->\n", "<!-- end of bricks -->\n"

SENSORS = {"h8:imu": "imu", "h8:rotation": "imu+encoders"}
NAMES = {
    "h8:imu": "RCX, IMU",
    "h8:rotation": "RCX, rotation sensors",
    "avr:328p-imu": "328P, IMU",
    "avr:328p-mpu6050": "328P, MPU-6050",
    "avr:328p-lsm6ds": "328P, LSM6DS",
    "avr:328p-rotation": "328P, rotation sensors",
    "avr:2560": "2560, all",
}
STAGES = (
    "model", "heading", "speed", "pose", "guidance", "control", "mixer", "telemetry", "rest", "step", "drivers",
    "commands", "interrupts", "all",
)  # fmt: skip
WHAT = {"step": "**a control step**", "commands": "requests of the host", "all": "**all that is not slept**"}


def _taken(kernel: Mapping[str, Any]) -> str:
    """Returns the mean share of processor time that is neither the program's time nor idle time."""
    return f"{1 - sum(kernel['shares'][kind]['share'] for kind in ('idle', 'program')):.0%}"


OF_THE_KERNEL: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "brickOS and its interrupts, mean": _taken,
    "idle, mean": lambda kernel: f"{kernel['shares']['idle']['share']:.0%}",
    "from one step to the next, p99 and most": lambda kernel: "{p99:.1f} and {most:.1f} ms".format(**kernel["tick_ms"]),
}


def bench(target: str, seconds: float | None) -> dict[str, Any]:
    """Returns the output of `brickpilot bench --target TARGET --json`; for an RCX also the sizes of the program."""
    command = [str(Path(sys.executable).with_name("brickpilot")), "bench", "--target", target, "--json"]
    command += [] if seconds is None else ["--seconds", str(seconds)]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return json.loads(done.stdout) | sizes(target)


def sizes(target: str) -> dict[str, Any]:
    """Returns the bytes of an RCX's program; empty for other targets, whose sizes `bench` gives."""
    if target not in SENSORS:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        found = boards.build(boards.RCX, SENSORS[target], ROOT / "firmware", Path(folder), ROOT)
    return {"program": found}


def step_s(target: str, found: Mapping[str, Any]) -> float:
    return 0.009 if target in SENSORS else found["period_cycles"] / found["clock_hz"]


def cycles(target: str, found: Mapping[str, Any], stage: str) -> str:
    """Returns a table cell: the largest number of cycles of a stage, and its share of the period."""
    if target in SENSORS:
        row = found["stages"].get(stage)
        most = None if row is None else row["states_external"]["most"]
    else:
        row = found["cycles"].get(stage)
        most = None if row is None else row["most"]
    if most is None:
        return "-"
    return f"{most:,}, {most / (step_s(target, found) * found['clock_hz']):.0%}"


def memory(target: str, found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the cells of flash, RAM and stack."""
    if target in SENSORS:
        program = found["program"]
        held = program["text"] + 2 * program["data"] + program["variables"]
        return {
            "flash": f"{program['text']:,}, in RAM",
            "RAM for the program": f"{held + program['stacks']:,} of {program['memory']:,}, text included",
            "variables": f"{program['data'] + program['variables']:,}",
            "stack of a step": f"{found['stack_bytes']}",
        }
    left = found["ram_of"] - found["ram_bytes"] - found["stack_bytes"]
    return {
        "flash": f"{found['flash_bytes']:,} of {found['flash_of']:,}",
        "RAM for the program": f"{found['ram_bytes'] + found['stack_bytes']:,} of {found['ram_of']:,}, {left:,} left",
        "variables": f"{found['ram_bytes']:,}",
        "stack of a step": f"{found['stack_bytes']}, interrupts included",
    }


def table(results: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns the table in Markdown."""
    targets = [target for target in NAMES if target in results]
    lines = [
        "| | " + " | ".join(NAMES[target] for target in targets) + " |",
        "|---|" + "---|" * len(targets),
        "| control step | " + " | ".join(f"{1e3 * step_s(one, results[one]):g} ms" for one in targets) + " |",
    ]
    cells = {target: memory(target, results[target]) for target in targets}
    for name in cells[targets[0]]:
        lines.append(f"| {name}, bytes | " + " | ".join(cells[target][name] for target in targets) + " |")
    for stage in STAGES:
        row = " | ".join(cycles(target, results[target], stage) for target in targets)
        lines.append(f"| {WHAT.get(stage, stage)} | {row} |")
    for name, cell in OF_THE_KERNEL.items():
        kernels = (results[target].get("kernel") for target in targets)
        lines.append(f"| {name} | " + " | ".join("-" if one is None else cell(one) for one in kernels) + " |")
    return "\n".join(lines) + "\n"


def written(readme: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns the README's text with the table in its place."""
    before, rest = readme.split(BEGIN)
    return before + BEGIN + "\n" + table(results) + "\n" + END + rest.split(END)[1]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--kept", action="store_true")
    options.add_argument("--seconds", type=float, help="of the mission; the default is all of it")
    chosen = options.parse_args()
    if not chosen.kept:
        results = {target: bench(target, chosen.seconds) for target in NAMES}
        FIGURES.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    README.write_text(written(README.read_text(encoding="utf-8"), json.loads(FIGURES.read_text())), encoding="utf-8")


if __name__ == "__main__":
    main()
