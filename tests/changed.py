"""Prints the test files to run after the changes since the merge base with a branch: `sh tests/run changed [BRANCH]`.

A test file belongs to a changed module if it imports the module, or a module of the package that imports the module.
Helpers of the tests count as part of the test files that import them. A test that runs a command counts as if it
imported the command's module. A test file belongs to any other changed file if its text contains the file's name. A
change can also break tests that are not printed: `sh tests/run` runs all tests.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/gates"))

from python_layers import PACKAGE, imports, modules  # noqa: E402

C = {".c", ".h", ".cmake", ".s", ".dbc"}
COMMAND = re.compile(r'(?:brickpilot|run|refused)\(\s*"([a-z_]+)"')
MAIN = ("origin/main", "origin/master", "main", "master")


def changed_files(root: Path, branch: str | None) -> list[str]:
    """Returns the files that differ from the merge base with `branch`, and the new files, as paths from the root.

    Raises:
        SystemExit: there is no such branch.
    """

    def git(*words: str) -> str | None:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=False)
        return done.stdout if done.returncode == 0 else None

    bases = (git("merge-base", "HEAD", one) for one in (MAIN if branch is None else (branch,)))
    base = next(filter(None, bases), None)
    if base is None:
        raise SystemExit(f"tests/run changed: no branch {branch or ' or '.join(MAIN)} to compare with: name one")
    listed = (git("diff", "--name-only", base.strip()), git("ls-files", "--others", "--exclude-standard"))
    return sorted({line for text in listed for line in (text or "").splitlines()})


def changes_c(files: Iterable[str]) -> bool:
    """Returns whether the C tests are built from at least one of these files."""
    return any(Path(one).suffix in C or Path(one).name == "CMakeLists.txt" for one in files)


def files_of_tests(files: Iterable[str], root: Path) -> list[str]:
    """Returns the Python test files that belong to the changed files `files`, as paths from the root, sorted."""
    known = modules(root / "tools" / PACKAGE) | modules(root / "tests/lab") | modules(root / "tests/hidden")
    for folder in ("tests/loop", "tests/gates", "tests/python"):
        known |= {path.stem: path for path in sorted((root / folder).glob("*.py"))}
    uses = {name: {other for _, other in imports(name, path, known)} for name, path in known.items()}
    tests = {name: path for name, path in known.items() if name.startswith("test_")}
    texts = {name: path.read_text(encoding="utf-8") for name, path in tests.items()}
    for name, text in texts.items():
        uses[name] |= {f"{PACKAGE}.cli.{one}" for one in COMMAND.findall(text)}
    names = {path.relative_to(root).as_posix(): name for name, path in known.items()}
    found: set[str] = set()
    for file in files:
        if file in names:
            found |= _users(names[file], uses) & tests.keys()
        else:
            found |= {name for name, text in texts.items() if _is_named(Path(file), text)}
    return sorted(tests[name].relative_to(root).as_posix() for name in found)


def _users(name: str, uses: dict[str, set[str]]) -> set[str]:
    """Returns a module, and the modules that import it directly or through helpers and at most one package module."""
    reached = {name}
    left = [(name, 0)]
    while left:
        one, steps = left.pop()
        for user in (user for user, used in uses.items() if one in used and user not in reached):
            further = steps + user.startswith(f"{PACKAGE}.")
            if further < 2:
                reached.add(user)
                left.append((user, further))
    return reached


def _is_named(file: Path, text: str) -> bool:
    """Returns whether a test's text names a file. For a README.md, it has to name the folder, too."""
    folder = file.parent.name
    return file.name in text and (file.name != "README.md" or f'"{folder}"' in text or f"{folder}/README.md" in text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("branch", nargs="?", help="the branch to compare with")
    differing = changed_files(ROOT, parser.parse_args().branch)
    print("\n".join([*(["C"] if changes_c(differing) else []), *files_of_tests(differing, ROOT)]))
