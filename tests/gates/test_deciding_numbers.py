"""discover/numbers.py alone holds the numbers that decide a verdict, each with its reason.

A number decides if a comparison contains the number, or a module constant whose value contains the number. 0, 1, -1, 2
and 0.5 do not decide: they count as arithmetic.
"""

from __future__ import annotations

import ast
from collections.abc import Collection
from pathlib import Path

import pytest
from python_layers import imports, modules

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "tools/brickpilot"
DISCOVER = PACKAGE / "discover"

MOST_NUMBERS = 15
MOST_FILES, MOST_LINES, MOST_REACHED = 40, 7500, 60

PLAIN = {0, 1, -1, 2, 0.5}

DECIDES = ("verdict.py", "evidence.py", "adequacy.py", "seal.py", "pipeline.py", "conclude.py")

WORK = {
    ("conclude.py", "_LAGS"): "how far the page's autocorrelation reaches",
    ("conclude.py", "_BEYOND"): "what the page calls white; no verdict asks",
    ("evidence.py", "_SETTLED"): "the iterated scale has come to rest: a smaller number gives the same scale",
}
"""Constants in comparisons that limit work or decide how something is shown."""

SEALED = {"prepare", "pipeline"}
"""The only modules up to the verdict that may import the seal: `prepare` closes it, `pipeline` lets it be opened."""

BEHIND_THE_SEAL = {"conclude", "yardstick", "seal"}
"""Modules that work with the opened data, after the last choice."""


def literals(path: Path) -> dict[str, list[ast.Constant]]:
    """Returns name -> the numeric literals in the value that the top level of a module gives this name."""
    found: dict[str, list[ast.Constant]] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            pairs = [(target, node.value) for target in targets]
            if isinstance(targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(targets[0].elts, node.value.elts, strict=True))
            for target, value in pairs:
                assert isinstance(target, ast.Name)
                found[target.id] = [one for one in ast.walk(value) if is_number(one)]
    return found


def is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def bound_numbers(path: Path) -> dict[str, str]:
    """Returns name -> the docstring below the name, for each name of numbers.py whose value uses no other constant."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    found: dict[str, str] = {}
    for node, after in zip(body, [*body[1:], ast.Pass()], strict=True):
        if not isinstance(node, ast.Assign):
            continue
        reason = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
        (target,) = node.targets
        pairs = (
            list(zip(target.elts, node.value.elts, strict=True))
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            else [(target, node.value)]
        )
        for name, value in pairs:
            assert isinstance(name, ast.Name)
            derived = any(isinstance(one, ast.Name) and one.id.isupper() for one in ast.walk(value))
            if not derived:
                assert isinstance(reason, str)
                found[name.id] = reason
    return found


def deciding_literals(path: Path) -> list[str]:
    """Returns "FILE:LINE: NUMBER" of each literal that decides in a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants = literals(path)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            said = [one for one in ast.walk(node) if is_number(one)]
            for name in (one.id for one in ast.walk(node) if isinstance(one, ast.Name)):
                if (path.name, name) not in WORK:
                    said += constants.get(name, [])
            for one in said:
                assert isinstance(one, ast.Constant)
                if one.value not in PLAIN:
                    found.append(f"{path.name}:{one.lineno}: {one.value}")
    return sorted(set(found))


def test_few_numbers_decide_and_each_has_its_reason() -> None:
    found = bound_numbers(DISCOVER / "numbers.py")
    assert {"KNEE", "SURE", "RARE", "LAW_ERROR"} <= found.keys()
    assert not {"USUAL", "CHANCE_NATS"} & found.keys()  # these follow from other numbers
    assert len(found) <= MOST_NUMBERS
    for name, reason in found.items():
        assert len(reason.split()) > 8, name


@pytest.mark.parametrize("name", DECIDES)
def test_no_number_decides_outside_of_them(name: str) -> None:
    assert deciding_literals(DISCOVER / name) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (">= numbers.SURE", ">= 0.9", "0.9"),
        ("_ONE = ", "_MOST = 7\n_ONE = ", ""),
        ("len(least) == 1", "len(least) <= _MOST", "7"),
        ("share >= numbers.SURE", "share > (1 - 0.07) * 1", "0.07"),
    ],
)
def test_a_number_that_is_planted_is_found(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = (DISCOVER / "verdict.py").read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1)
    if "_MOST" in new and "least" in new:
        text = text.replace("_ONE = ", "_MOST = 7\n_ONE = ", 1)
    planted = tmp_path / "verdict.py"
    planted.write_text(text, encoding="utf-8")
    assert [one.split()[-1] for one in deciding_literals(planted)] == ([said] if said else [])


def test_what_is_listed_as_work_is_there() -> None:
    assert all(name in literals(DISCOVER / file) for file, name in WORK)


def test_no_stage_before_the_verdict_names_the_seal() -> None:
    known = modules(PACKAGE)
    seal = "brickpilot.discover.seal"
    named = {
        name.rpartition(".")[2]
        for name, path in known.items()
        if name.startswith(("brickpilot.discover.", "brickpilot.fit."))
        for _, other in imports(name, path, known)
        if other == seal
    }
    assert named <= SEALED | BEHIND_THE_SEAL
    assert named >= SEALED


def reached(name: str, known: dict[str, Path], seen: set[str], without: Collection[str] = SEALED) -> set[str]:
    """Returns a module and all modules that it needs when it runs; those in `without` are left out and not followed."""
    if name not in seen:
        seen.add(name)
        for _, other in imports(name, known[name], known, run=True):
            if other.rpartition(".")[2] not in without:
                reached(other, known, seen, without)
    return seen


@pytest.mark.parametrize("name", ["search", "verdict", "adequacy", "compose", "settle", "evidence"])
def test_no_stage_before_the_verdict_reaches_the_seal_by_another_module(name: str) -> None:
    known = modules(PACKAGE)
    found = {one.rpartition(".")[2] for one in reached(f"brickpilot.discover.{name}", known, set())}
    assert not found & BEHIND_THE_SEAL


def test_the_rooms_that_decide_stay_small() -> None:
    files = [path for room in ("fit", "discover") for path in (PACKAGE / room).rglob("*.py")]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
    assert len(files) <= MOST_FILES
    assert lines <= MOST_LINES


def test_a_verdict_is_reached_through_few_modules() -> None:
    known = modules(PACKAGE)
    names = reached("brickpilot.discover.pipeline", known, set(), without=set())
    assert "brickpilot.discover.seal" in names  # modules behind the seal count too
    assert (
        len([name for name in names if len(known[name].read_text(encoding="utf-8").splitlines()) > 1]) <= MOST_REACHED
    )
