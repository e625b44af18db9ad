"""The names that `import brickpilot` gives: the example in its docstring runs, and the import itself loads nothing."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import textwrap
from pathlib import Path

import brickpilot
import pytest
import synthetic


def example() -> str:
    """The indented lines of the package's docstring."""
    lines = str(brickpilot.__doc__).splitlines()
    return textwrap.dedent("\n".join(line for line in lines if line.startswith("    ") or not line))


def test_the_docstrings_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = synthetic.motor(wheel_inertia=1e-3)
    dry = dataclasses.replace(truth, effects={"coulomb_friction": {"torque": 0.02}})
    known = "\n".join(f"{name} = {truth.parameters[name]}" for name in ("resistance", "torque_constant"))
    manoeuvres = {"low": (3.0, 0.0), "middle": (-5.0, 0.0), "high": (7.0, 0.0)}
    roles = ["fit", "fit", "held_out"]
    synthetic.write(tmp_path / "bench", dry, {"speed": 0.02}, known, manoeuvres=manoeuvres, roles=roles)
    monkeypatch.chdir(tmp_path)
    code = example()
    assert len([line for line in code.splitlines() if line.strip()]) <= 20
    exec(compile(code, "example", "exec"), {})
    said = capsys.readouterr().out
    assert "emf_constant" in said
    assert "named ['coulomb_friction']" in said
    assert (tmp_path / "model.toml").is_file()


def test_each_public_name_is_there() -> None:
    assert set(brickpilot.__all__) <= set(dir(brickpilot))
    assert all(getattr(brickpilot, name) is not None for name in brickpilot.__all__)
    with pytest.raises(AttributeError, match="no attribute 'replay'"):
        _ = brickpilot.replay


def test_the_import_loads_nothing_else() -> None:
    program = "import sys, brickpilot; print('numpy' in sys.modules, [m for m in sys.modules if 'brickpilot.' in m])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "False []\n"
