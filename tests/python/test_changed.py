"""`sh tests/run changed` runs the tests of the files that have changed."""

from __future__ import annotations

import subprocess
from pathlib import Path

import changed
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Returns a checkout of a package with three modules, a helper of tests, and tests.

    `top` imports `middle`, and `middle` imports `deep`. The helper also imports `deep`.
    """
    files = {
        "tools/brickpilot/fit/deep.py": "",
        "tools/brickpilot/fit/middle.py": "from brickpilot.fit import deep\n",
        "tools/brickpilot/cli/top.py": "def run():\n    from brickpilot.fit import middle\n",
        "tests/python/helper.py": "from brickpilot.fit.deep import one\n",
        "tests/python/test_helped.py": "from helper import one\n",
        "tests/python/test_deep.py": "from brickpilot.fit import deep\n",
        "tests/python/test_middle.py": "import brickpilot.fit.middle\n",
        "tests/gates/test_command.py": 'brickpilot("top", cwd=here)\n',
        "tests/gates/test_table.py": 'TABLE = ROOT / "hal/wire/rows.toml"\nREADME = "hal/README.md"\n',
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("file", "tests"),
    [
        ("tools/brickpilot/fit/deep.py", ["python/test_deep", "python/test_helped", "python/test_middle"]),
        ("tools/brickpilot/fit/middle.py", ["gates/test_command", "python/test_middle"]),
        ("tools/brickpilot/cli/top.py", ["gates/test_command"]),
        ("tests/python/helper.py", ["python/test_helped"]),
        ("tests/python/test_deep.py", ["python/test_deep"]),
        ("hal/wire/rows.toml", ["gates/test_table"]),
        ("hal/README.md", ["gates/test_table"]),
        ("sim_host/README.md", []),
    ],
)
def test_a_change_has_its_tests(file: str, tests: list[str], checkout: Path) -> None:
    assert changed.files_of_tests([file], checkout) == [f"tests/{one}.py" for one in tests]


def test_c_asks_for_the_c_tests() -> None:
    assert changed.changes_c(["README.md", "firmware/control/pid.c"])
    assert changed.changes_c(["sim_host/CMakeLists.txt"])
    assert not changed.changes_c(["tools/README.md", "tests/run"])


def test_all_differences_from_the_merge_base_count(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        own = ("-c", "user.name=t", "-c", "user.email=t@localhost", "-c", "init.defaultBranch=main")
        subprocess.run(["git", *own, *words], cwd=tmp_path, check=True, capture_output=True)

    def commit(name: str) -> None:
        (tmp_path / name).write_text(name)
        git("add", name)
        git("commit", "-m", name)

    git("init")
    for name in ("kept", "edited"):
        commit(name)
    git("checkout", "-b", "own")
    commit("added")
    git("checkout", "main")
    commit("of_others")
    git("checkout", "own")
    (tmp_path / "edited").write_text("otherwise")
    (tmp_path / "new").write_text("")
    assert (
        changed.changed_files(tmp_path, None) == changed.changed_files(tmp_path, "main") == ["added", "edited", "new"]
    )
    with pytest.raises(SystemExit, match="no branch nowhere to compare with"):
        changed.changed_files(tmp_path, "nowhere")
