"""Only the C table lists effects.

An effect's name in `tools` is a fault. An effect file without a row, or a row without an effect file, stops the build.
"""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
from pathlib import Path
from typing import get_args

import pytest
from brickpilot import catalogue
from contained_laws import is_contained, is_made_of
from effect_names import MAY_NAME, TABLE, faults, names, sources

ROOT = Path(__file__).resolve().parents[2]
EFFECT = "motor_heating"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Returns the folder of a checkout with the real table and one tool."""
    (tmp_path / TABLE).parent.mkdir(parents=True)
    shutil.copy(ROOT / TABLE, tmp_path / TABLE)
    (tmp_path / "tools/brickpilot").mkdir(parents=True)
    (tmp_path / "tools/brickpilot/tool.py").write_text('"""A tool."""\n')
    return tmp_path


def test_no_tool_names_an_effect() -> None:
    assert len(list(sources(ROOT))) > 100
    assert faults(ROOT) == []


def test_the_gate_knows_every_effect_of_the_plant() -> None:
    assert names(ROOT) == [effect.name for effect in catalogue.effects()]


def test_the_gate_would_find_names_in_what_it_leaves_out() -> None:
    for path in MAY_NAME:
        assert any(re.search(rf"\b{name}\b", (ROOT / path).read_text()) for name in names(ROOT))


@pytest.mark.parametrize(
    "line", [f'SLOW = {{"{EFFECT}": 0.003}}', f"# as {EFFECT} does", f'"{EFFECT}.time_constant"', f"'{EFFECT}'"]
)
def test_a_tool_that_names_an_effect_is_reported_in_one_line(tree: Path, line: str) -> None:
    tool = tree / "tools/brickpilot/tool.py"
    tool.write_text(f"{tool.read_text()}\n{line}\n")
    (fault,) = faults(tree)
    assert fault.startswith(f"tools/brickpilot/tool.py:3 names the effect {EFFECT}; ")


@pytest.mark.parametrize("line", [f"{EFFECT}s = 3", f"my_{EFFECT} = 3", "motor heating"])
def test_a_longer_word_is_no_name(tree: Path, line: str) -> None:
    (tree / "tools/brickpilot/tool.py").write_text(f"{line}\n")
    assert faults(tree) == []


def configured(root: Path) -> str:
    """Returns CMake's error output for the sources in `root`."""
    command = ["cmake", "-S", str(root), "-B", str(root / "build")]
    return subprocess.run(command, capture_output=True, text=True).stderr


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a folder with a CMake project that has only the plant and its effects."""
    root = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "sim_host", root / "sim_host", ignore=shutil.ignore_patterns("*.svg"))
    (root / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(plant LANGUAGES C)\n"
        "add_library(firmware INTERFACE)\nadd_library(hal_sil INTERFACE)\nadd_library(hal_link INTERFACE)\n"
        "add_subdirectory(sim_host)\n"
    )
    assert configured(root) == ""
    return root


def test_an_effect_file_without_a_row_stops_the_build(checkout: Path) -> None:
    new = checkout / "sim_host/effects/new_law.c"
    new.write_text((checkout / f"sim_host/effects/{EFFECT}.c").read_text().replace(EFFECT, "new_law"))
    errors = configured(checkout)
    new.unlink()
    says = "sim_host/effects/new_law.c has no row: add EFFECT(new_law) to the table in sim_host/effects/effects.c"
    assert says in [line.strip() for line in errors.splitlines()]


def test_a_row_without_an_effect_file_stops_the_build(checkout: Path) -> None:
    table = checkout / TABLE
    text = table.read_text()
    table.write_text(text.replace(f"    EFFECT({EFFECT})", f"    EFFECT(new_law) \\\n    EFFECT({EFFECT})"))
    errors = configured(checkout)
    table.write_text(text)
    says = "sim_host/effects/effects.c has a row without a file that defines it: new_law"
    assert says in [line.strip() for line in errors.splitlines()]


def test_every_effect_has_a_unit_test() -> None:
    files = [Path(f"tests/unit/effects/test_{effect.name}.c") for effect in catalogue.effects()]
    assert [f"{path} is missing" for path in files if not (ROOT / path).exists()] == []


def test_every_effect_has_a_law_of_another_engine() -> None:
    laws = Path("tests/hidden/effects.py")
    text = (ROOT / laws).read_text()
    named = [effect.name for effect in catalogue.effects() if effect.is_searched]
    assert [f"{laws} has no row for {name}" for name in named if f'"{name}":' not in text] == []


def test_every_effect_has_a_prior_and_a_reason_of_its_own() -> None:
    known = catalogue.effects()
    assert {effect.prior for effect in known} == set(get_args(catalogue.Prior))
    assert [effect.name for effect in known if not re.fullmatch(r"[A-Z][^.]* [^.]*\.", effect.prior_reason)] == []
    assert [
        f"{one.name} has the reason of {other.name}"
        for one, other in itertools.combinations(known, 2)
        if one.prior_reason == other.prior_reason
    ] == []
    assert [effect.prior for effect in known if effect.composed] == ["rare"]


def test_every_effect_says_what_to_do_and_for_which_side() -> None:
    assert [
        one.name for one in catalogue.effects() if not one.composed and not re.fullmatch(r"[A-Z].*\.", one.advice)
    ] == []
    assert catalogue.says("motor_asymmetry", "difference", 0.1) == "the right motor is {} weaker than the left"
    assert catalogue.says("motor_asymmetry", "difference", -0.1) == "the left motor is {} weaker than the right"
    assert catalogue.says("gyro_scale", "error", -0.1) == "the gyro reads {} too little"
    assert "if the left side stays weak" in catalogue.advice("motor_asymmetry", {"difference": -0.1})
    assert catalogue.advice("com_lateral_offset", {"right": -0.02}).endswith("to the right.")


def test_a_row_contains_other_effects_alone() -> None:
    known = {effect.name for effect in catalogue.effects()}
    for effect in catalogue.effects():
        assert known - {effect.name} >= set(effect.contains), effect.name
        assert len(set(effect.contains)) == len(effect.contains), effect.name


def test_a_row_contains_just_the_laws_that_give_the_same_simulation() -> None:
    laws = [effect for effect in catalogue.effects() if not effect.composed]
    said = {(effect.name, name) for effect in catalogue.effects() for name in effect.contains}
    shown = {(law.name, other.name) for law in laws for other in laws if is_contained(other, law)}
    assert {("stiction_stribeck", "coulomb_friction"), ("cogging", "gravity_load")} <= shown
    assert said == shown, "`contains` of these rows is not what the simulations show (containing, contained)"


@pytest.mark.parametrize(
    ("law", "other"), [("payload_mass", "surge_drag"), ("direction_asymmetry", "coulomb_friction")]
)
def test_a_law_that_is_only_alike_is_not_contained(law: str, other: str) -> None:
    assert not is_contained(catalogue.effect(other), catalogue.effect(law))


def test_a_law_that_is_made_of_others_gives_their_simulation() -> None:
    made = [effect for effect in catalogue.effects() if effect.made_of]
    assert "direction_asymmetry" in [effect.name for effect in made]
    assert [one.name for one in made if not is_made_of(one, [catalogue.effect(name) for name in one.made_of])] == []
    others = [catalogue.effect(name) for name in ("coulomb_friction", "constant_offset")]
    assert not is_made_of(catalogue.effect("rolling_sqrt"), others)
