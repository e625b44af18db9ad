"""Every module of the firmware gives the same results on the RCX's processor as on the host, for random inputs.

The inputs are the vectors of tests/vectors. A module gets 50,000 vectors, or 5,000 if 50,000 take more than a second.
With --full every module gets 50,000.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PARTS = 16
FEW = "-DVECTORS_OF_PART=313"
"""Compiler flag for 5,000 vectors instead of 50,000. 5,000 vectors suffice to find the faults planted below."""
QUICK = {"autopilot/route", "core/trig", "estimator/bias", "mixer/drive", "model/motor", "model/scale", "wire/message"}
"""Modules whose 50,000 vectors take a second or less."""

PROFILES = ("-DBODY_WITHOUT_PAPER", "-DBODY_WITHOUT_COUPLED")
OF_EACH_PROFILE = ("app/step", "model/body", "model/motor")

# Compiler flags of each RCX program. The host's build supports all sensors, but its vectors use only the RCX's sensors.
PROGRAMS = re.findall(r"-D[^']+", (ROOT / "firmware/targets/rcx/flags").read_text())
OF_EACH_PROGRAM = ("app/step", "estimator/heading", "estimator/pose", "estimator/speed", "model/body")

# These modules call the HAL: tests/python/test_hil_h8sim.py tests them by missions on the simulator.
WITHOUT_VECTORS = {"app/loop", "app/serve"}
NOT_ON_THE_RCX = {"wire/slcan"}
# The vectors of model/body, of control/pid and of modules that clear or copy a state also test these modules. h8/layout
# gives no code.
OF_OTHERS = {"model/body_pose", "control/pid_start", "core/bytes", "h8/layout"}

VECTORS = ROOT / "tests/vectors"
MODULES = sorted(path.relative_to(VECTORS).with_suffix("").as_posix() for path in VECTORS.glob("*/*.c"))
CASES = [(module, flag) for module in MODULES for flag in (PROFILES if module in OF_EACH_PROFILE else ("",))]
CASES += [(module, flags) for flags in PROGRAMS for module in OF_EACH_PROGRAM]


Case = tuple[str, str]
"""A module, and the compiler flags of its firmware."""

Told = tuple[list[str], list[str], list[str]]
"""The output, in lines, of three programs of a module: on the host, on the host with UndefinedBehaviorSanitizer, and on
the simulator of the RCX's processor."""


def build(folder: Path, flags: str, modules: list[str], full: bool) -> None:
    """Builds the programs of `modules` in FOLDER/host, FOLDER/checked and FOLDER/h8, with one firmware in each folder.

    Args:
        flags: compiler flags of the firmware.
        full: whether each module gets 50,000 vectors.
    """
    many = [f"tests/vectors/{module}.c" for module in modules if full or module in QUICK]
    few = [f"tests/vectors/{module}.c" for module in modules if not (full or module in QUICK)]
    for kind in ("host", "checked", "h8"):
        its = flags if kind == "h8" else flags.replace("SENSORS_POSSIBLE", "DRAWN_SENSORS")
        # tests/vectors/build applies a flag behind a source only to later vectors, so the firmware is compiled once.
        subprocess.run([VECTORS / "build", kind, folder / kind, *its.split(), *many, FEW, *few], check=True)


def run(*command: str | Path) -> list[str]:
    done = subprocess.run([*command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.splitlines()


def simulator() -> str:
    return run(ROOT / "hal/h8sim/simulator")[0]


def tell(folder: Path, module: str) -> Told:
    name = module.replace("/", "_")
    return run(folder / "host" / name), run(folder / "checked" / name), run(simulator(), folder / "h8" / name)


@pytest.fixture(scope="module")
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, full: bool) -> Mapping[str, Path]:
    """Returns flags -> folder with the programs, built with these flags, of all modules that the chosen tests need."""
    items = [item for item in request.session.items if item.path == Path(__file__) and hasattr(item, "callspec")]
    parameters = [item.callspec.params for item in items]
    asked = {(its["module"], its.get("flag", "")) for its in parameters if "module" in its}
    folders = {}
    for flag in dict.fromkeys(flag for _, flag in CASES):
        modules = sorted(module for module, its in asked if its == flag)
        if modules:
            folders[flag] = tmp_path_factory.mktemp("vectors")
            build(folders[flag], flag, modules, full)
    return folders


@pytest.fixture(scope="module")
def told(request: pytest.FixtureRequest, built: Mapping[str, Path]) -> Iterator[Mapping[Case, Future[Told]]]:
    """Yields case -> future of its output. All chosen cases run, one per processor at a time, the longest first."""
    parameters = [item.callspec.params for item in request.session.items if hasattr(item, "callspec")]
    cases = [case for case in CASES if {"module": case[0], "flag": case[1]} in parameters]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cases.sort(key=lambda case: case[0] not in OF_EACH_PROFILE)
        yield {(module, flag): pool.submit(tell, built[flag], module) for module, flag in cases}


def first_difference(wanted: list[str], found: list[str]) -> str:
    """Returns a text on the first part of the vectors whose hashes differ between two programs; "": all are equal."""
    assert len(wanted) == PARTS
    pairs = (f"part {a[:2]}: {b[3:]} for {a[3:]}" for a, b in zip(wanted, found, strict=True) if a != b)
    return next(pairs, "")


@pytest.mark.parametrize(("module", "flag"), CASES)
def test_a_module_gives_the_same_on_the_h8(
    module: str, flag: str, told: Mapping[tuple[str, str], Future[Told]]
) -> None:
    host, checked, h8 = told[module, flag].result()
    assert len(set(host)) == PARTS, f"{module}: the vectors tell nothing new"
    assert first_difference(host, checked) == "", f"{module}: undefined behaviour"
    assert first_difference(host, h8) == "", f"{module} {flag}"


def test_vectors_are_of_both_sets_of_sensors() -> None:
    assert [re.search("SENSOR_ROTATION", flags) is not None for flags in PROGRAMS] == [False, True]
    assert all("-DSENSORS_POSSIBLE=" in flags and "-DBODY_WITHOUT_PAPER" in flags for flags in PROGRAMS)


def test_every_module_has_vectors() -> None:
    sources = [*(ROOT / "firmware").glob("*/*.c"), *(ROOT / "hal/wire").glob("*.c")]
    named = {f"{path.parent.name}/{path.stem.removesuffix('_gen')}" for path in sources}
    assert named - WITHOUT_VECTORS - NOT_ON_THE_RCX - OF_OTHERS <= set(MODULES)


def assembled_again(root: Path, built: Path, module: str, full: bool) -> Path:
    """Links a module's program again, with the assembly files of the checkout at `root`; returns the program's file.

    Args:
        built: the folder with the objects of `build`, of which all C code is taken.
    """
    compile_h8 = root / "hal/h8/compile"
    feed = [*([] if full or module in QUICK else [FEW]), VECTORS / "vectors.c", root / "vectors.o"]
    subprocess.run([compile_h8, *feed], check=True)
    objects = []
    for source in (root / "firmware").rglob("h8/*.S"):
        objects.append(root / f"{'_'.join(source.relative_to(root).with_suffix('').parts)}.o")
        subprocess.run([compile_h8, source, objects[-1]], check=True)
    library = shutil.copy(built / "firmware.a", root)
    subprocess.run(["h8300-hms-ar", "rs", library, *objects], check=True)
    linked = [built / "start", built / f"tests_vectors_{module.replace('/', '_')}.o", root / "vectors.o", library]
    script = "/usr/h8300-hitachi-coff/lib/ldscripts/h8300.x"
    subprocess.run(["h8300-hms-ld", "-T", script, "-relax", "-o", root / "coff", *linked], check=True)
    subprocess.run(["h8300-hms-objcopy", "-I", "coff-h8300", "-O", "srec", "coff", "srec"], cwd=root, check=True)
    return root / "srec"


@pytest.mark.parametrize(
    ("file", "of", "to", "module"),
    [
        ("core/h8/macros.inc", "addx	#0,\\hl", "add.b	#0,\\hl", "core/fix"),
        ("core/h8/fix.S", "add.w	r5,r0\n	addx	#0,r1h", "add.w	r5,r0", "core/fix"),
        ("core/h8/fix.S", "addx	r2h,r2l", "add.b	r2h,r2l", "core/fix"),
        ("core/h8/fix.S", "bmi	.Lmost16\n	bra	.Lleast16", "bra	.Lleast16", "core/fix"),
        ("core/h8/divide.S", "mov.w	r1,r0\n	mov.b	#8,r6l", "mov.w	r1,r0\n	mov.b	#7,r6l", "core/fix"),
        ("core/h8/divide.S", "sub.b	r2l,r3l\n	mov.b	r3l,r3h", "mov.b	r3l,r3h", "core/fix"),
        ("core/h8/trig.S", "and	#7,r0l", "and	#15,r0l", "core/trig"),
        (
            "core/h8/frames.S",
            "mov.w	@r7+,r5\n	mov.w	@r7+,r4\n	rts",
            "mov.w	@r7+,r4\n	mov.w	@r7+,r5\n	rts",
            "core/trig",
        ),
        ("model/h8/scale.S", "mov.w	#0x100,r4", "mov.w	#0x200,r4", "model/scale"),
        ("model/h8/motor.S", "addx	r1h,r3h", "add.b	r1h,r3h", "model/motor"),
        ("model/h8/body.S", "add.w	r0,r6", "mov.w	r0,r6", "model/body"),
    ],
)
def test_a_slip_in_what_the_h8_alone_does_is_caught(
    file: str, of: str, to: str, module: str, built: Mapping[str, Path], full: bool, tmp_path: Path
) -> None:
    """A fault planted in one assembly file changes the output. The compiled C code is not built again."""
    assert file.endswith((".S", ".inc")), "the host compiles it too"
    for folder in ("firmware", "hal/h8"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    path, name = tmp_path / "firmware" / file, module.replace("/", "_")
    text = path.read_text()
    assert of in text
    as_built = (built[""] / "h8" / name).read_text().splitlines()
    assert assembled_again(tmp_path, built[""] / "h8", module, full).read_text().splitlines()[1:] == as_built[1:]
    path.write_text(text.replace(of, to))
    command = ["stdbuf", "-o0", simulator(), assembled_again(tmp_path, built[""] / "h8", module, full)]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as h8:
        assert h8.stdout is not None
        pairs = zip(run(built[""] / "host" / name), h8.stdout, strict=False)
        assert any(wanted != found.rstrip("\n") for wanted, found in pairs)
        h8.kill()
