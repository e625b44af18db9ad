"""Plants random faults ("mutants") in the C code of firmware/, and counts those that a unit test finds ("kills").

    cmake --preset debug && cmake --build --preset debug --target unit_tests
    .venv/bin/python tests/mutants/mutants.py [--count 40] [--seed 1] [--least 95] [--file control/pid.c]

A mutant changes one operator, comparison, constant, condition or statement. A mutant is replaced by another mutant if
it does not compile, or if gcc -O2 makes the same code for it. The mutants of equivalent.toml are not drawn, because
they have no effect either: the file gives the reasons. The programs of tests/unit are linked with each mutant and run
until one fails. A program that runs for more than 20 s counts as failed.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import Queue
from subprocess import DEVNULL

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
TESTS = ROOT / "build/debug/tests"
MODULES = ("app", "autopilot", "control", "core", "estimator", "mixer", "model", "monitor")
RUN_S = 20

SWAPS = {
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
    "+": ("-",), "-": ("+",), "*": ("+",), "/": ("*",), "+=": ("-=",), "-=": ("+=",), "&": ("|",), "|": ("&",),
    "<<": (">>",), ">>": ("<<",), "&&": ("||",), "||": ("&&",), "++": ("--",), "--": ("++",),
    "true": ("false",), "false": ("true",),
}  # fmt: skip
TOKEN = re.compile(r"(?P<number>\b\d\w*)|[A-Za-z_]\w*|->|<<=|>>=|<<|>>|[<>=!+*/&|-]=|&&|\|\||\+\+|--|[<>+*/&|-]")
STATEMENT = re.compile(r"\s+(?!return|break|continue|const|static|[a-z_0-9]+_t )[(a-z*+-].*[^{},];$")
MOST_NUMBERS = 6  # a line with more numbers than this is a row of a table, of which no number is changed


@dataclass(frozen=True, order=True)
class Mutant:
    """One changed line of a file of firmware/."""

    file: str
    line: int
    was: str
    becomes: str

    def text(self) -> str:
        """Returns the whole text of the file, with the fault."""
        lines = (FIRMWARE / self.file).read_text(encoding="utf-8").splitlines()
        lines[self.line - 1] = self.becomes
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        return f"firmware/{self.file}:{self.line}\n    was     {self.was.strip()}\n    becomes {self.becomes.strip()}"


def without_comments(text: str) -> str:
    """Returns C code with blanks in place of comments, strings and preprocessor lines, except macros of numbers."""
    blank = re.compile(r'/\*.*?\*/|"[^"\n]*"|^#(?!define \w+ [\d-]).*?$', re.DOTALL | re.MULTILINE)
    return blank.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def changes(line: str) -> Iterator[tuple[int, int, str]]:
    """Yields each possible fault: start and end of a part of the line, and the text that replaces this part."""
    if STATEMENT.fullmatch(line.rstrip()) and line.count("(") == line.count(")"):
        yield len(line) - len(line.lstrip()), len(line.rstrip()), ";"
    tokens = list(TOKEN.finditer(line))
    numbers = sum(token["number"] is not None for token in tokens)
    for token in tokens:
        start, end = token.span()
        if token["number"] is None:
            others: tuple[str, ...] = SWAPS.get(token[0], ())
        else:
            value = re.match(r"0x[0-9a-fA-F]+|\d+", token[0])[0]  # type: ignore[index]
            others = tuple(f"{n}{token[0][len(value) :]}" for n in (int(value, 0) + 1, int(value, 0) - 1) if n >= 0)
            others = () if numbers > MOST_NUMBERS else others
        yield from ((start, end, other) for other in others)
    for found in re.finditer(r"\b(if|while) \((.*)\)(?= \{$|$)", line):
        yield found.start(2), found.end(2), f"!({found[2]})"


def all_mutants() -> list[Mutant]:
    """Returns every mutant of the C files of `MODULES` and of the inline functions in their headers."""
    made = set()
    for path in sorted(path for module in MODULES for path in (FIRMWARE / module).glob("*.[ch]")):
        text = path.read_text(encoding="utf-8")
        if "_gen" in path.name or (path.suffix == ".h" and not re.search(r"(?i)inline [^;{]*\)\n\{", text)):
            continue
        inside = path.suffix == ".c"
        for at, (line, code) in enumerate(zip(text.splitlines(), without_comments(text).splitlines(), strict=True), 1):
            if path.suffix == ".h" and code[:1] in ("{", "}"):
                inside = code[:1] == "{"
            if inside:
                name = str(path.relative_to(FIRMWARE))
                made |= {Mutant(name, at, line, line[:a] + new + line[b:]) for a, b, new in changes(code)}
    return sorted(made)


class Bench:
    """A copy of firmware/, in which one mutant after the other is built and tested.

    Args:
        folder: an empty folder.
    """

    def __init__(self, folder: Path) -> None:
        self._sources = folder / "firmware"
        shutil.copytree(FIRMWARE, self._sources)
        self._linked = []  # the link command of each test, without the library of the firmware
        for module in MODULES:
            for made in sorted((TESTS / "CMakeFiles").glob(f"unit_{module}_*.dir/link.txt")):
                self._linked.append([word for word in shlex.split(made.read_text()) if "libfirmware" not in word])
        self._objects = {path: folder / f"{path.parent.name}_{path.stem}.o" for path in self._modules()}
        self._optimised = self._compiled(list(self._objects), "-O2")
        self._plain = self._compiled(list(self._objects), "-O0")

    def _modules(self) -> list[Path]:
        return sorted(path for module in MODULES for path in (self._sources / module).glob("*.c"))

    def _compiled(self, paths: list[Path], level: str) -> dict[Path, bytes]:
        """Compiles sources until one fails; returns source -> contents of its object. `level`: such as "-O2"."""
        found = {}
        for path in paths:
            out = self._objects[path]
            flags = [
                "-std=c99",
                "-w",
                "-Wmaybe-uninitialized",
                "-Werror=maybe-uninitialized",
                level,
                f"-I{self._sources}",
                f"-I{ROOT / 'hal/include'}",
                f"-I{ROOT / 'hal'}",
            ]
            if not quiet(["cc", *flags, "-c", str(path), "-o", str(out)], self._sources):
                break
            found[path] = out.read_bytes()
        return found

    def outcome(self, mutant: Mutant) -> str:
        """Returns the outcome of a mutant: "no build", "same code", "killed" or "survived"."""
        path = self._sources / mutant.file
        path.write_text(mutant.text(), encoding="utf-8")
        concerned = [path] if path.suffix == ".c" else list(self._objects)
        optimised = self._compiled(concerned, "-O2")
        plain = self._compiled(concerned, "-O0")
        path.write_bytes((FIRMWARE / mutant.file).read_bytes())
        if min(len(plain), len(optimised)) < len(concerned):
            return "no build"
        if all(self._optimised[one] == optimised[one] for one in concerned):
            return "same code"
        for one, out in self._objects.items():
            out.write_bytes(plain.get(one, self._plain[one]))
        own_first = sorted(
            self._linked, key=lambda command: Path(mutant.file).stem not in command[command.index("-o") + 1]
        )
        return "survived" if all(map(self._passes, own_first)) else "killed"

    def _passes(self, command: list[str]) -> bool:
        program = str(self._sources.parent / "test")
        at = command.index("-o")
        objects = [str(path) for path in self._objects.values()]
        linked = [*command[:at], "-o", program, *command[at + 2 :], *objects, *command[at + 2 :]]
        return quiet(linked, TESTS) and quiet([program], TESTS)


def quiet(command: list[str], folder: Path) -> bool:
    """Runs a command in a folder. Returns whether it ends with status 0 within `RUN_S` seconds."""
    try:
        ran = subprocess.run(command, cwd=folder, stdout=DEVNULL, stderr=DEVNULL, timeout=RUN_S, check=False)
    except subprocess.TimeoutExpired:
        return False
    return ran.returncode == 0


def drawn(mutants: list[Mutant], count: int, workers: int) -> Iterator[tuple[Mutant, str]]:
    """Yields the first `count` mutants whose compiled code differs from the firmware's, each with its outcome."""
    known = tomllib.loads(Path(__file__).with_name("equivalent.toml").read_text(encoding="utf-8"))["equivalent"]
    equivalent = {(one["file"], one["was"], becomes) for one in known for becomes in one["becomes"]}
    left = (m for m in mutants if (m.file, m.was.strip(), m.becomes.strip()) not in equivalent)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        benches = Queue[Bench]()
        for number in range(workers):
            benches.put(Bench(Path(folder) / str(number)))

        def judge(mutant: Mutant) -> tuple[Mutant, str]:
            bench = benches.get()
            try:
                return mutant, bench.outcome(mutant)
            finally:
                benches.put(bench)

        while count > 0 and (some := list(islice(left, count))):
            for mutant, outcome in pool.map(judge, some):
                if outcome in ("killed", "survived"):
                    count -= 1
                    yield mutant, outcome


def main() -> None:
    """Prints the mutants that survive and the share of killed mutants; ends with status 1 if the share is too small."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--count", type=int, default=40, help="so many mutants")
    asked.add_argument("--seed", type=int, default=1, help="of the draw")
    asked.add_argument("--least", type=float, default=95, help="per cent that have to be killed")
    asked.add_argument("--file", default="", help="of this file of firmware/ alone")
    options = asked.parse_args()
    mutants = [one for one in all_mutants() if options.file in one.file]
    random.Random(options.seed).shuffle(mutants)
    survivors, tried = [], 0
    for mutant, outcome in drawn(mutants, options.count, os.cpu_count() or 1):
        tried += 1
        if outcome == "survived":
            survivors.append(mutant)
            print(mutant, flush=True)
    share = 100 * (tried - len(survivors)) / max(tried, 1)
    print(f"{tried - len(survivors)} of {tried} mutants killed, {share:.1f} % (seed {options.seed})")
    sys.exit(tried == 0 or share < options.least)


if __name__ == "__main__":
    main()
