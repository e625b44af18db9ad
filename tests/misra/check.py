"""Checks the C of firmware/, hal/ and sim_host/ against MISRA C:2012 by cppcheck's addon, but for deviations.toml.

    .venv/bin/python tests/misra/check.py [--all]    # --all also lists what the deviations allow

A finding fails that no deviation allows, and so does a deviation that allows nothing. Generated files and the headers
of the FMI standard are left out. The texts of the rules are MISRA's, and are not here.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOPS = ("firmware", "hal", "sim_host")
INCLUDES = ("firmware", "hal/include", "hal", "sim_host", "sim_host/include")
FINDING = re.compile(r"(?P<file>\S+?):(?P<line>\d+): misra-c2012-(?P<rule>[\d.]+)")


def findings() -> dict[tuple[str, int, str], None]:
    """Returns file, line and rule of each finding, in their order."""
    listed = subprocess.run(["git", "ls-files", *(f"{top}/*.c" for top in TOPS)], cwd=ROOT, stdout=-1, check=True)
    sources = [name for name in listed.stdout.decode().split() if not _left_out(name)]
    with tempfile.TemporaryDirectory() as folder:  # without one, -j leaves the addon's files beside the sources
        command = [
            "cppcheck", "--addon=misra", "--std=c99", "--quiet", f"-j{os.cpu_count()}", "--max-configs=3",
            f"--cppcheck-build-dir={folder}", "--template={file}:{line}: {id}", *(f"-I{at}" for at in INCLUDES),
        ]  # fmt: skip
        done = subprocess.run([*command, *sources], cwd=ROOT, stderr=subprocess.PIPE, text=True, check=True)
    found = {(m["file"], int(m["line"]), m["rule"]): None for m in FINDING.finditer(done.stderr)}
    return {one: None for one in sorted(found) if not _left_out(one[0])}


def _left_out(name: str) -> bool:
    return "_gen." in name or "fmi/standard/" in name or not name.startswith(TOPS)


def main() -> None:
    """Prints the findings that nothing allows; exit status 1 if there are any."""
    text = Path(__file__).with_name("deviations.toml").read_text(encoding="utf-8")
    allowed = {(one["rule"], top): one["reason"] for one in tomllib.loads(text)["deviation"] for top in one["in"]}
    used: Counter[tuple[str, str]] = Counter()
    wrong = []
    for file, line, rule in findings():
        used[rule, file.partition("/")[0]] += 1
        if (rule, file.partition("/")[0]) not in allowed or "--all" in sys.argv[1:]:
            wrong.append(f"{file}:{line}: rule {rule}")
    wrong += [f"deviations.toml: rule {rule} in {top} allows nothing" for rule, top in allowed if not used[rule, top]]
    print(*wrong, sep="\n", end="\n" if wrong else "")
    print(f"MISRA C:2012: {used.total()} findings of {len({rule for rule, _ in used})} rules, {len(wrong)} not allowed")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
