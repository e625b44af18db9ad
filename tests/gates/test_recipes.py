"""The recipes of CONTRIBUTING.md lead to something that works, and name every file that has to be touched."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import brickpilot
import pytest
from recipes import ROOT, Copy, recipes

UNITY = ROOT / "build/release/tests/unity/pytest_unity-0.1.0/vendor/unity/src"

LAW = """\
#include "effects/effect.h"

static void body(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->drag_surge += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "coefficient",
     .role = BP_ROLE_SIZE,
     .unit = "N s/m",
     .meaning = "force per speed",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.4},
};

const effect_t effect_linear_drag = {
    .info = {.name = "linear_drag",
             .words = "a drag that grows with the speed",
             .summary = "A force against the motion grows in proportion to the speed.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "X = -coefficient u",
             .source = "Stokes drag",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body},
};
"""

LAW_TEST = """\
#include "drive.h"

void setUp(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static void test_the_speed_decays_exponentially(void)
{
    on("linear_drag", 0.5, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.5, 0, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, sign * 0.5 * exp(-0.5 * 0.6 / surge_mass()), state()->surge);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_speed_decays_exponentially);
    return UNITY_END();
}
"""


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300, check=False
    )


def listed(title: str, name: str) -> set[str]:
    """The files of a recipe for something called `name`."""
    return {path.replace("NAME", name) for path in recipes()[title].files}


def test_there_is_a_recipe_for_each_common_change() -> None:
    assert [*recipes()] == ["An effect", "A port", "An importer", "A gain", "A setting", "A message"]


@pytest.mark.parametrize("title", [*recipes()])
def test_a_recipe_names_files_that_exist_and_has_a_proof(title: str) -> None:
    recipe = recipes()[title]
    assert len(recipe.files) >= 2
    for path in recipe.files:
        pattern = path.replace("NAME", "*").replace("STAGE", "*").rstrip("/")
        assert any(ROOT.glob(pattern)), f"CONTRIBUTING.md, {title}: there is no {path}"
    assert recipe.proofs
    for path in recipe.proofs:
        assert (ROOT / path).is_file(), f"CONTRIBUTING.md, {title}: there is no {path}"


def test_the_recipe_for_an_effect_makes_one(tmp_path: Path) -> None:
    copy = Copy(tmp_path)
    copy.write("sim_host/effects/linear_drag.c", LAW)
    copy.insert("sim_host/effects/effects.c", "    EFFECT(quadratic_drag) \\\n", "    EFFECT(linear_drag) \\\n")
    copy.write("tests/unit/effects/test_linear_drag.c", LAW_TEST)
    copy.insert("tests/hidden/effects.py", '    "curve_scrub": ', '    "linear_drag": _one("coefficient", 0.3),\n')
    engine = "tests/hidden/mujoco_effects.py"
    copy.insert(
        engine,
        "def _curve_scrub(",
        'def _linear_drag(s: Step, p: Parameters) -> None:\n    s.force -= p["coefficient"] * s.surge\n\n\n',
    )
    copy.insert(engine, "_curve_scrub, ", "_linear_drag, ")
    assert copy.touched == listed("An effect", "linear_drag")

    plant = [
        str(path) for room in ("plant", "effects", "sensors") for path in (copy.root / "sim_host" / room).glob("*.c")
    ]
    compiler = ("gcc", "-std=c99", "-O0", "-fPIC", "-I", "sim_host", "-I", "sim_host/include")
    library = tmp_path / "libbrickpilot_sim.so"
    built = run(*compiler, "-shared", "-o", library, *plant, "-lm", "-lpthread", cwd=copy.root)
    assert built.returncode == 0, built.stderr
    test = copy.root / "tests/unit/effects/test_linear_drag.c"
    unity = ("-DUNITY_INCLUDE_DOUBLE", "-DUNITY_SUPPORT_64", f"-I{UNITY}", UNITY / "unity.c")
    built = run(
        *compiler, "-o", tmp_path / "test", test, *unity, library, "-lm", f"-Wl,-rpath,{tmp_path}", cwd=copy.root
    )
    assert built.returncode == 0, built.stderr
    passed = run(tmp_path / "test", cwd=tmp_path)
    assert passed.returncode == 0, passed.stdout

    package = tmp_path / "package/brickpilot"
    shutil.copytree(Path(brickpilot.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(library, package)
    shutil.copy(copy.root / "sim_host/include/brickpilot_sim.h", package)
    command = (sys.executable, "-c", "from brickpilot.cli.main import main; main()", "effects", "linear_drag", "--json")
    shown = run(*command, cwd=tmp_path, PYTHONPATH=str(package.parent))
    assert shown.returncode == 0, shown.stderr
    assert json.loads(shown.stdout)["linear_drag"]["parameters"][0]["role"] == "size"

    made = run(
        sys.executable,
        "-m",
        "hidden",
        "single",
        tmp_path / "sets",
        "--only",
        "linear_drag-x1-enc",
        cwd=copy.root / "tests",
    )
    assert made.returncode == 0, made.stderr
    truth = json.loads((tmp_path / "sets/linear_drag-x1-enc.truth.json").read_text())
    assert truth["recipe"]["hidden"].keys() == {"linear_drag"}
    assert truth["visibility"]["wheel_speed_left"] > 1, "the law of the other engine changes nothing"
