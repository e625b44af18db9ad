"""Checks that the Unity tests of this folder reach every function, branch and condition (MC/DC) of firmware/.

    cmake --preset coverage && cmake --build --preset coverage
    .venv/bin/python tests/unit/coverage.py

MC/DC: for each condition of a decision, two runs differ in the decision because of this condition alone. A condition
does not count if the compiler knows its value. An example is a condition for a motor model without sway: the model of
the host's build has sway.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/coverage"
RAW = BUILD / "raw"
DEMANDED = ("functions", "branches", "mcdc")


def measured() -> dict[str, Any]:
    """Runs all unit tests and returns the coverage of all tests together, as llvm-cov exports it."""
    RAW.mkdir(exist_ok=True)
    for old in RAW.iterdir():
        old.unlink()
    tests = ["ctest", "--preset", "coverage", "-j", str(os.cpu_count()), "-R", "^unit_", "--quiet"]
    subprocess.run(tests, cwd=ROOT, env=os.environ | {"LLVM_PROFILE_FILE": f"{RAW}/%p.profraw"}, check=True)
    merged = BUILD / "unit.profdata"
    subprocess.run(["llvm-profdata-19", "merge", "-o", merged, *RAW.iterdir()], check=True)
    programs = [path for path in (BUILD / "tests").glob("unit_*") if path.is_file()]
    objects = [word for path in programs for word in ("-object", str(path))]
    command = ["llvm-cov-19", "export", "-instr-profile", str(merged), *objects]
    made = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    exported: dict[str, Any] = json.loads(made.stdout)["data"][0]
    return exported


def missed(exported: dict[str, Any]) -> list[str]:
    """Returns a line for each coverage of a file below 100 %, and a line for each condition that MC/DC lacks there."""
    found = []
    for file in exported["files"]:
        lines = []
        name = Path(file["filename"]).relative_to(ROOT)
        for what in DEMANDED:
            one = file["summary"][what]
            if one["covered"] < one["count"]:
                lines.append(f"{name}: {one['covered']} of {one['count']} {what}")
        for line, column, *_, conditions in file["mcdc_records"] if lines else ():
            lines += [f"{name}:{line}:{column}: condition {n + 1}" for n, seen in enumerate(conditions) if not seen]
        found += lines
    return found


def main() -> None:
    """Prints the total coverage and what the tests miss; ends with status 1 if they miss something."""
    exported = measured()
    totals = exported["totals"]
    if not totals["mcdc"]["count"]:
        sys.exit("no condition of firmware/ is measured: build the preset coverage first")
    print(
        "firmware/ by unit tests:", ", ".join(f"{totals[k]['covered']} of {totals[k]['count']} {k}" for k in DEMANDED)
    )
    lines = missed(exported)
    print(*lines, sep="\n", end="\n" if lines else "")
    sys.exit(bool(lines))


if __name__ == "__main__":
    main()
