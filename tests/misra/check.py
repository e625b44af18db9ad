"""Checks the C code of firmware/, hal/ and sim_host/ against MISRA C:2012 with cppcheck's addon.

    .venv/bin/python tests/misra/check.py [--all]    # --all also lists what the deviations allow
    .venv/bin/python tests/misra/check.py --write    # writes the numbers of findings into counts.toml

A deviation in deviations.toml says why a rule is not kept in a folder; counts.toml says how many findings of the rule
each file has. The check fails if a file has more or fewer findings than its count, so that counts never rise. It also
fails if a deviation allows no finding. Generated files and the headers of the FMI standard are left out. The texts of
the rules belong to MISRA and are not here.
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
COUNTS = Path(__file__).with_name("counts.toml")
TOPS = ("firmware", "hal", "sim_host")
INCLUDES = ("firmware", "hal/include", "hal", "sim_host", "sim_host/include")
FINDING = re.compile(r"(?P<file>\S+?):(?P<line>\d+): misra-c2012-(?P<rule>[\d.]+)")
UNSEEN = "__clang__", "sim_host/effects/real.h"
"""A macro, and the only file that tests the macro. The tested lines are for several robots at once. As LANES is 1,
cppcheck does not see these lines. Without -U, it would check 70 sources twice, with the same text."""


def findings() -> dict[tuple[str, int, str], None]:
    """Returns file, line and rule of each finding, sorted."""
    listed = subprocess.run(["git", "ls-files", *(f"{top}/*.[ch]" for top in TOPS)], cwd=ROOT, stdout=-1, check=True)
    files = [name for name in listed.stdout.decode().split() if not _left_out(name)]
    macro, header = UNSEEN
    asking = [name for name in files if macro in (ROOT / name).read_text(encoding="utf-8")]
    if asking != [header]:
        sys.exit(f"check.py: {header} alone may ask for {macro}, and these do: {', '.join(asking)}")
    with tempfile.TemporaryDirectory() as folder:  # without a folder, -j leaves the addon's files beside the sources
        command = [
            "cppcheck", "--addon=misra", "--std=c99", "--quiet", f"-j{os.cpu_count()}", "--max-configs=3", f"-U{macro}",
            f"--cppcheck-build-dir={folder}", "--template={file}:{line}: {id}", *(f"-I{at}" for at in INCLUDES),
        ]  # fmt: skip
        sources = [name for name in files if name.endswith(".c")]
        done = subprocess.run([*command, *sources], cwd=ROOT, stderr=subprocess.PIPE, text=True, check=True)
    found = {(m["file"], int(m["line"]), m["rule"]): None for m in FINDING.finditer(done.stderr)}
    return {one: None for one in sorted(found) if not _left_out(one[0])}


def _left_out(name: str) -> bool:
    return "_gen." in name or "fmi/standard/" in name or not name.startswith(TOPS)


def _tool() -> str:
    return subprocess.run(["cppcheck", "--version"], stdout=-1, text=True, check=True).stdout.strip()


def _write(counts: Counter[tuple[str, str]]) -> None:
    lines = ["# Findings of each rule in each file, for check.py, which writes this file.", f'tool = "{_tool()}"']
    for rule in sorted({rule for rule, _ in counts}, key=lambda one: [int(part) for part in one.split(".")]):
        lines += ["", f'["{rule}"]', *(f'"{file}" = {counts[of, file]}' for of, file in sorted(counts) if of == rule)]
    COUNTS.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _kept() -> Counter[tuple[str, str]]:
    """Returns the counts of counts.toml; exits if another tool has written them."""
    read = tomllib.loads(COUNTS.read_text(encoding="utf-8"))
    if read.pop("tool") != _tool():
        sys.exit(f"counts.toml is not of {_tool()}: its findings may differ; --write keeps new ones")
    return Counter({(rule, file): count for rule, files in read.items() for file, count in files.items()})


def told(found: list[tuple[str, int, str]], allowed: dict[tuple[str, str], str]) -> list[str]:
    """Returns a line for each finding that is not allowed, each count that is too large, and each unused deviation."""
    counts = Counter((rule, file) for file, _, rule in found)
    if "--write" in sys.argv[1:]:
        _write(counts)
    kept = _kept()
    wrong = []
    for file, line, rule in found:
        there, before = counts[rule, file], kept[rule, file]
        if (rule, file.partition("/")[0]) not in allowed or "--all" in sys.argv[1:]:
            wrong.append(f"{file}:{line}: rule {rule}")
        elif there > before:
            wrong.append(f"{file}:{line}: rule {rule}, one of {there} here; counts.toml allows {before}")
    for (rule, file), before in kept.items():
        if counts[rule, file] < before:
            wrong.append(f"counts.toml: rule {rule} in {file}: {counts[rule, file]} and not {before}; --write keeps it")
    used = {(rule, file.partition("/")[0]) for rule, file in counts}
    return wrong + [f"deviations.toml: rule {rule} in {top} allows nothing" for rule, top in allowed.keys() - used]


def main() -> None:
    """Prints the findings that no deviation allows; exit status 1 if there are such findings."""
    text = Path(__file__).with_name("deviations.toml").read_text(encoding="utf-8")
    allowed = {(one["rule"], top): one["reason"] for one in tomllib.loads(text)["deviation"] for top in one["in"]}
    found = list(findings())
    wrong = told(found, allowed)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    print(f"MISRA C:2012: {len(found)} findings of {len({rule for *_, rule in found})} rules, {len(wrong)} not allowed")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
