"""The package as users get it: an sdist, a wheel built from this sdist, and the wheel installed outside a checkout."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
import tarfile
import venv
from email.parser import Parser
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]


def build(what: str, source: Path, out: Path) -> Path:
    """Builds a wheel or an sdist with this environment's tools, and returns the only file made."""
    command = [sys.executable, "-m", "build", f"--{what}", "--no-isolation", "--outdir", out, source]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (made,) = out.iterdir()
    return made


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder of the unpacked sdist, outside any checkout."""
    folder = tmp_path_factory.mktemp("package")
    with tarfile.open(build("sdist", ROOT / "tools", folder / "sdist")) as archive:
        archive.extractall(folder / "there", filter="data")
    (found,) = (folder / "there").iterdir()
    return found


@pytest.fixture(scope="module")
def wheel(unpacked: Path) -> Path:
    return build("wheel", unpacked, unpacked.parents[1] / "wheel")


def test_the_sdist_holds_the_licence_and_what_the_compiler_needs(unpacked: Path) -> None:
    assert (unpacked / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    for folder in ("firmware", "hal", "sim_host"):
        for path in (ROOT / folder).rglob("*.[ch]"):
            assert (unpacked / "source" / path.relative_to(ROOT)).read_bytes() == path.read_bytes()
    assert not [path for path in unpacked.rglob("*") if path.is_symlink()]


def test_the_wheel_has_its_licence_and_asks_for_no_library_of_a_link(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        info = wheel.name.partition("-")[0] + "-" + wheel.name.split("-")[1] + ".dist-info"
        assert archive.read(f"{info}/licenses/LICENSE") == (ROOT / "LICENSE").read_bytes()
        library = "brickpilot/report/uplot/LICENSE"  # licence of the plot library, which each page contains
        assert archive.read(f"{info}/licenses/{library}") == (ROOT / "tools" / library).read_bytes()
        assert "brickpilot/py.typed" in archive.namelist()  # without it a user's type checker ignores the types
        metadata = Parser().parsestr(archive.read(f"{info}/METADATA").decode())
    assert metadata["License-Expression"] == "MIT"
    asked = metadata.get_all("Requires-Dist") or []
    always = [one for one in asked if "extra ==" not in one]
    assert len(always) > 5
    assert not [
        one
        for one in always
        if one.startswith(("matplotlib", "cantools", "python-can", "pyserial", "cobs")) or "==" in one
    ]
    assert {"cantools", "python-can", "pyserial"} <= {
        one.partition(">")[0] for one in asked if one.endswith(("extra == 'hil'", 'extra == "hil"'))
    }


def test_the_wheel_runs_where_it_is_installed(wheel: Path, tmp_path: Path) -> None:
    """The new environment holds only the wheel, and takes the required libraries from this environment."""
    home = tmp_path / "environment"
    venv.create(home, with_pip=False, symlinks=True)
    python = home / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index", wheel]
    subprocess.run(install, check=True, timeout=300)
    (packages,) = (home / "lib").glob("python*/site-packages")
    (packages / "libraries.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")

    def run(*command: str | Path, shows_progress: bool = False) -> str:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        assert shows_progress or done.stderr == ""
        return done.stdout

    place = run(python, "-c", "import brickpilot; print(brickpilot.__file__)")
    assert Path(place.strip()).parent == packages / "brickpilot"
    figures = json.loads(run(home / "bin" / "brickpilot", "run", "--json", "--out", "flown"))
    assert (figures["waypoints_reached"], figures["failure"]) == (8, None)
    assert (tmp_path / "flown" / "report.html").is_file()
    assert "coulomb_friction" in run(home / "bin" / "brickpilot", "effects", "friction")
    (tmp_path / "own.toml").write_text(
        'name = "own"\nvehicle = "diff_drive"\nprofile = "coupled"\n[parameters]\nmass = 1.0\n'
    )
    for board in ("avr", "rcx", "template"):
        words = ("firmware", "--board", board, "--model", "own.toml", "--json")
        assert json.loads(run(home / "bin" / "brickpilot", *words))["flight"]["waypoints_reached"] == 8
    few = ("--budget", "1", "--robots", "4", "--judges", "20")
    run(home / "bin" / "brickpilot", "tune", "--model", "own.toml", *few, "--out", "tuned", shows_progress=True)
    assert (tmp_path / "tuned" / "gains.toml").is_file()
    assert not list(packages.glob("brickpilot/sources/build"))
