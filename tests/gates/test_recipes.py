"""Following a recipe of CONTRIBUTING.md gives a working result, and the recipe names every file that has to change."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import brickpilot
import pytest
from brickpilot.vehicle.settings import load
from recipes import ROOT, Copy, recipes

UNITY = ROOT / "build/unity/pytest_unity-0.1.0/vendor/unity/src"

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
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Stokes drag needs a flow that is slower than that round a robot.",
             .advice = "Drive in thinner air.",
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


PLANAR_LAW = """\
def _linear_drag(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[0] -= p["coefficient"] * plant.surge

    plant.loads.append(hook)


"""

PID_TEST = """\
static void test_pid_trial_goes_with_the_error(void)
{
    const pid_config_t config = {.trial_mv = 300, .limit_mv = 20000};
    TEST_ASSERT_EQUAL_INT16(300, step(&config, (pid_input_t){.error = 1, .period_ms = 3}).output_mv);
    TEST_ASSERT_EQUAL_INT16(-300, step(&config, (pid_input_t){.error = -1, .period_ms = 3}).output_mv);
    TEST_ASSERT_EQUAL_INT16(0, step(&config, (pid_input_t){.error = 0, .period_ms = 3}).output_mv);
}

"""

REQUEST = """\
BO_ 262 CLOCK_REQUEST: 8 HOST
 SG_ sequence : 0|8@1+ (1,0) [0|255] "" BRICK
 SG_ check : 48|16@1+ (1,0) [0|65535] "" BRICK

BO_ 263 CLOCK: 8 BRICK
 SG_ sequence : 0|8@1+ (1,0) [0|255] "" HOST
 SG_ status : 8|8@1+ (1,0) [0|255] "" HOST
 SG_ now : 16|16@1+ (1,0) [0|65535] "ms" HOST
 SG_ check : 48|16@1+ (1,0) [0|65535] "" HOST

"""

OBEY = """\
static uint8_t clock_of_the_loop(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    (void)commands;
    message_put(&data[WIRE_CLOCK_NOW_AT], (uint16_t)loop->clock_ms);
    return PARAMETERS_OK;
}

"""

COMMANDS_TEST = """\
static void test_the_clock_is_that_of_the_loop(void)
{
    struct wire_clock_t answer;
    loop.clock_ms = 1234;
    TEST_ASSERT_TRUE(send(WIRE_CLOCK_REQUEST_FRAME_ID));
    wire_clock_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT16(1234, answer.now);
}

"""

ASK = """\
    def clock(self) -> int:
        \"\"\"Returns the low 16 bits of the brick's clock, ms.\"\"\"
        return self._request("CLOCK_REQUEST", ())["now"]

"""


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300, check=False
    )


def listed(title: str, name: str) -> set[str]:
    """Returns the files of the recipe `title`, with `name` in place of NAME."""
    return {path.replace("NAME", name) for path in recipes()[title].files}


def test_there_is_a_recipe_for_each_common_change() -> None:
    assert [*recipes()] == ["An effect", "A port", "An importer", "A gain", "A setting", "A message"]


@pytest.mark.parametrize("title", [*recipes()])
def test_a_recipe_names_files_that_exist_and_has_a_proof(title: str) -> None:
    recipe = recipes()[title]
    assert len(recipe.files) >= 2
    for path in recipe.files:
        pattern = re.sub("NAME|STAGE|FOLDER", "*", path).rstrip("/")
        assert any(ROOT.glob(pattern)), f"CONTRIBUTING.md, {title}: there is no {path}"
    assert recipe.proofs
    for path in recipe.proofs:
        assert (ROOT / path).is_file(), f"CONTRIBUTING.md, {title}: there is no {path}"


def test_the_recipe_for_an_effect_makes_one(tmp_path: Path) -> None:
    copy = Copy(tmp_path)
    copy.write("sim_host/effects/linear_drag.c", LAW)
    copy.insert("sim_host/effects/effects.c", "    EFFECT(quadratic_drag) \\\n", "    EFFECT(linear_drag) \\\n")
    copy.write("tests/unit/effects/test_linear_drag.c", LAW_TEST)
    copy.insert("tests/hidden/effects.py", "}  # fmt: skip\n", '    "linear_drag": _one("coefficient", 0.3),\n')
    engine = "tests/hidden/mujoco_effects.py"
    copy.insert(
        engine,
        "def _curve_scrub(",
        'def _linear_drag(s: Step, p: Parameters) -> None:\n    s.force -= p["coefficient"] * s.surge\n\n\n',
    )
    copy.insert(engine, "_odd_periodic_force, ", "_linear_drag, ")
    planar = "tests/hidden/planar_effects.py"
    copy.insert(planar, "def _curve_scrub(", PLANAR_LAW)
    copy.insert(planar, '    "curve_scrub": ', '    "linear_drag": _linear_drag,\n')
    copy.insert("tests/hidden/other_laws.py", "surge_drag quadratic_drag", "linear_drag ")
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

    for maker in ("mujoco", "planar"):
        sets = tmp_path / maker
        command = ("hidden", "single", sets, "--engine", maker, "--only", "linear_drag-x1-enc")
        made = run(sys.executable, "-m", *command, cwd=copy.root / "tests")
        assert made.returncode == 0, made.stderr
        truth = json.loads((sets / "linear_drag-x1-enc.truth.json").read_text())
        assert truth["recipe"]["hidden"].keys() == {"linear_drag"}
        assert truth["visibility"]["wheel_speed_left"] > 1, f"the law of the engine {maker} changes nothing"


def generate(copy: Copy) -> None:
    """Writes the generated files of the copy."""
    made = run(sys.executable, "-m", "brickpilot.gen", cwd=copy.root)
    assert made.returncode == 0, made.stdout + made.stderr


def unit_test(copy: Copy, test: str, *sources: str) -> subprocess.CompletedProcess[str]:
    """Compiles one Unity test with the firmware sources that it needs, and runs it."""
    program = copy.root.parent / "unit_test"
    folders = [f"-I{copy.root / folder}" for folder in ("firmware", "hal/include", "hal", "sim_host")]
    found = [path for pattern in sources for path in sorted(copy.root.glob(pattern))]
    unity = (f"-I{UNITY}", "-DUNITY_INCLUDE_DOUBLE", UNITY / "unity.c")
    built = run("gcc", "-std=c99", *folders, "-o", program, copy.root / test, *found, *unity, "-lm", cwd=copy.root)
    assert built.returncode == 0, built.stderr
    return run(program, cwd=copy.root)


def test_the_recipe_for_a_gain_makes_one(tmp_path: Path) -> None:
    copy = Copy(tmp_path)
    value = 'heading_trial = { value = 0.25, unit = "V", basis = "tuned" }\n'
    model = "sim_host/models/rcx.toml"
    copy.insert(model, "[controller.paper]", value)
    text = (copy.root / model).read_text()
    (copy.root / model).write_text(text + value)
    number = len(load(copy.root / "hal/wire/settings.toml"))
    row = (
        f'heading_trial = {{ number = {number}, field = "config.step.heading_pid.trial_mv", format = "voltage", '
        'low = 0, high = 20000, meaning = "voltage in the direction of the error of the heading" }\n'
    )
    table = copy.root / "hal/wire/settings.toml"
    table.write_text(table.read_text() + row)
    copy.touched.add("hal/wire/settings.toml")
    copy.insert("firmware/control/pid.h", "} pid_config_t;", "    int16_t trial_mv; /* with the error, 0..20000 */\n")
    copy.insert(
        "firmware/control/pid.c",
        "    output->output_mv = fix_clamp16(",
        "    if (input->error != 0)\n"
        "        asked_mv = fix_add16(asked_mv, input->error < 0 ? (int16_t)-config->trial_mv : config->trial_mv);\n",
    )
    test = "tests/unit/control/test_pid.c"
    copy.insert(test, "int main(void)", PID_TEST)
    copy.replace(
        test, "    UNITY_BEGIN();\n", "    UNITY_BEGIN();\n    RUN_TEST(test_pid_trial_goes_with_the_error);\n"
    )
    generate(copy)
    folders = ("sim_host", "sim_host/include", "firmware", "hal", "hal/include", "tests/numeric", UNITY)
    reference = ("gcc", "-std=c99", "-fsyntax-only", *(f"-I{folder}" for folder in folders))
    missing = run(*reference, "tests/numeric/test_mission_against_double.c", cwd=copy.root)
    assert "heading_trial" in missing.stderr, "nothing names the reference controller that was forgotten"

    copy.insert("tests/numeric/double_controller.h", "} double_constants_t;", "    double heading_trial;\n")
    reference_c = "tests/numeric/double_controller.c"
    copy.insert(reference_c, "} gains_t;", "    double trial;\n")
    copy.insert(reference_c, "};\n    const double feedforward", ", .trial = c->heading_trial")
    copy.replace(reference_c, "double wanted = ", "double wanted = gains->trial * ((error > 0) - (error < 0)) + ")
    copy.insert(
        "tests/vectors/control/pid.c",
        "    state->integral_mv_q16 = 0;",
        "    config->trial_mv = draw_between(0, 20000);\n",
    )
    assert copy.touched == {
        path.replace("FOLDER", "control").replace("STAGE", "pid") for path in recipes()["A gain"].files
    }
    passed = unit_test(copy, test, "firmware/control/*.c", "firmware/core/*.c")
    assert passed.returncode == 0, passed.stdout
    built = run(*reference, "-Werror", "-Wall", reference_c, cwd=copy.root)
    assert built.returncode == 0, built.stderr
    assert ".trial_mv = 250" in (copy.root / "firmware/app/params_gen.h").read_text()


def test_the_recipe_for_a_message_makes_one(tmp_path: Path) -> None:
    copy = Copy(tmp_path)
    copy.insert("hal/wire/brickpilot.dbc", "BO_ 384 HEARTBEAT", REQUEST)
    commands = "firmware/app/commands.c"
    copy.insert(commands, "static const struct row {", OBEY)
    copy.insert(
        commands,
        "};\nenum { REQUESTS_COUNT",
        "    {WIRE_CLOCK_REQUEST_FRAME_ID, clock_of_the_loop, WIRE_CLOCK_STATUS_AT, false},\n",
    )
    copy.insert("tools/brickpilot/link/session.py", "    def command(self", ASK)
    test = "tests/unit/app/test_commands.c"
    copy.insert(test, "int main(void)", COMMANDS_TEST)
    copy.replace(
        test, "    UNITY_BEGIN();\n", "    UNITY_BEGIN();\n    RUN_TEST(test_the_clock_is_that_of_the_loop);\n"
    )
    assert copy.touched == listed("A message", "clock")
    generate(copy)
    rooms = ("core", "model", "estimator", "autopilot", "control", "mixer", "monitor", "app")
    sources = [f"firmware/{room}/*.c" for room in rooms] + ["hal/wire/*.c", "hal/sil/*.c", "tests/unit/link/*_gen.c"]
    passed = unit_test(copy, test, *sources)
    assert passed.returncode == 0, passed.stdout

    options = ("-DBRICKPILOT_TESTS=OFF", "-DCMAKE_BUILD_TYPE=Debug")
    built = run("cmake", "-S", ".", "-B", "build", *options, cwd=copy.root)
    assert built.returncode == 0, built.stderr
    built = run("cmake", "--build", "build", "--target", "brick", cwd=copy.root)
    assert built.returncode == 0, built.stdout + built.stderr
    package = tmp_path / "package/brickpilot"
    shutil.copytree(Path(brickpilot.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(copy.root / "hal/wire/brickpilot.dbc", package)
    shutil.copy(copy.root / "tools/brickpilot/link/session.py", package / "link")
    shutil.copy(copy.root / "build/sim_host/brick", package)
    program = (
        "from brickpilot.hil import ends; from brickpilot.link.session import LOCKSTEP, Session\n"
        "with ends.both_ends('serial:pty') as both:\n"
        "    session = Session(both.link, 'serial:pty'); session.open('coupled', LOCKSTEP); print(session.clock())"
    )
    told = run(sys.executable, "-c", program, cwd=tmp_path, PYTHONPATH=str(package.parent))
    assert (told.returncode, told.stdout) == (0, "0\n"), told.stderr
