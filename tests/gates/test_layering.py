"""C and assembly keep to the layers, and each kind of fault is named: file, line, and what its room may include."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from layers import c_cycles, c_faults, cycles, sources

ROOT = Path(__file__).resolve().parents[2]

# A small tree in which every include is allowed.
TREE = {
    "firmware/core/fix.h": "#include <stdint.h>\n",
    "firmware/core/h8/fix.S": '.include "core/h8/ends.inc"\n',
    "firmware/core/h8/ends.inc": "\n",
    "firmware/model/motor.h": '#include "core/fix.h"\n',
    "firmware/estimator/speed.h": '#include "core/fix.h"\n',
    "firmware/autopilot/los.h": '#include "core/fix.h"\n',
    "firmware/control/pid.h": '#include "core/fix.h"\n',
    "firmware/mixer/mixer.h": '#include "core/fix.h"\n',
    "firmware/app/loop.h": '#include "control/pid.h"\n#include "hal.h"\n#include "wire/message.h"\n',
    "firmware/targets/rcx/main.c": '#include <unistd.h>\n#include "app/loop.h"\n#include "rcx/board.h"\n',
    "hal/include/hal.h": '#include "wire/message.h"\n',
    "hal/wire/message.h": "#include <stdint.h>\n",
    "hal/rcx/board.h": '#include <dsensor.h>\n#include "hal.h"\n',
    "hal/sil/sil.h": '#include "hal.h"\n',
    "hal/template/template.c": '#include "hal.h"\n',
    "sim_host/include/brickpilot_sim.h": "\n",
    "sim_host/models/rcx_gen.h": "\n",
    "sim_host/effects/effect.h": '#include "brickpilot_sim.h"\n',
    "sim_host/plant/plant.h": '#include <math.h>\n#include "effects/effect.h"\n#include "models/rcx_gen.h"\n',
    "sim_host/sensors/imu.h": '#include "models/rcx_gen.h"\n',
    "sim_host/run/flight.c": '#include "app/loop.h"\n#include "sil/sil.h"\n#include "plant/plant.h"\n',
    "tests/unit/helper.h": "\n",
}

CORE_ALONE = "may include firmware/core, firmware/"
PORT = "may include hal/include, hal/"

# File, planted include, and the gate's text after "FILE:LINE: includes INCLUDE; ".
FAULTS = [
    ("firmware/core/fix.h", "model/motor.h", "firmware/core may include firmware/core"),
    ("firmware/core/h8/fix.S", "model/motor.h", "firmware/core may include firmware/core"),
    ("firmware/model/motor.h", "estimator/speed.h", f"firmware/model {CORE_ALONE}model"),
    ("firmware/estimator/speed.h", "model/motor.h", f"firmware/estimator {CORE_ALONE}estimator"),
    ("firmware/autopilot/los.h", "hal.h", "firmware/autopilot may include firmware/autopilot, firmware/core"),
    ("firmware/control/pid.h", "autopilot/los.h", "firmware/control may include firmware/control, firmware/core"),
    ("firmware/mixer/mixer.h", "app/loop.h", f"firmware/mixer {CORE_ALONE}mixer"),
    ("firmware/app/loop.h", "rcx/board.h", "firmware/app may include firmware/app, firmware/autopilot, firmware/c"),
    (
        "firmware/targets/rcx/main.c",
        "control/pid.h",
        "firmware/targets/rcx may include firmware/app, firmware/targets/rcx, hal/include, hal/rcx, hal/wire",
    ),
    ("firmware/targets/rcx/main.c", "sil/sil.h", "firmware/targets/rcx may include firmware/app, firmware/targets"),
    ("hal/include/hal.h", "app/loop.h", "hal/include may include hal/include, hal/wire"),
    ("hal/wire/message.h", "hal.h", "hal/wire may include hal/wire"),
    ("hal/rcx/board.h", "app/loop.h", f"hal/rcx {PORT}rcx, hal/wire"),
    ("hal/sil/sil.h", "plant/plant.h", f"hal/sil {PORT}sil, hal/wire"),
    ("hal/template/template.c", "rcx/board.h", f"hal/template {PORT}template, hal/wire"),
    ("sim_host/effects/effect.h", "plant/plant.h", "sim_host/effects may include sim_host/effects, sim_host/include"),
    ("sim_host/plant/plant.h", "hal.h", "sim_host/plant may include sim_host/effects, sim_host/include"),
    ("sim_host/sensors/imu.h", "effects/effect.h", "sim_host/sensors may include sim_host/include, sim_host/models"),
    ("sim_host/run/flight.c", "control/pid.h", "sim_host/run may include firmware/app, hal/include, hal/sil"),
    ("firmware/app/loop.h", "tests/unit/helper.h", "firmware/app may include firmware/app, firmware/autopilot"),
]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in TREE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_every_include_keeps_to_the_layers() -> None:
    assert len(list(sources(ROOT))) > 150
    assert [str(fault) for fault in c_faults(ROOT)] == []


def test_no_headers_include_one_another_in_a_circle() -> None:
    assert c_cycles(ROOT) == []


def test_what_is_allowed_is_not_named(tree: Path) -> None:
    assert c_faults(tree) == []
    assert c_cycles(tree) == []


@pytest.mark.parametrize(("name", "include", "says"), FAULTS)
def test_a_forbidden_include_is_named(tree: Path, name: str, include: str, says: str) -> None:
    directive = ".include" if name.endswith(".S") else "#include"
    (tree / name).write_text(f'{TREE[name]}{directive} "{include}"\n')
    (fault,) = c_faults(tree)
    line = TREE[name].rstrip("\n").count("\n") + 2 if TREE[name] != "\n" else 2
    assert str(fault).startswith(f"{name}:{line}: includes {include}; {says}")


@pytest.mark.parametrize("directive", ['#include "{}"', "#include <{}>", '  #  include "{}"', '\t.include "{}"'])
def test_no_way_to_write_an_include_gets_past(tree: Path, directive: str) -> None:
    (tree / "firmware/core/h8/fix.S").write_text(directive.format("model/motor.h") + "\n")
    assert len(c_faults(tree)) == 1


def test_an_include_by_a_way_round_is_named(tree: Path) -> None:
    (tree / "firmware/core/fix.h").write_text('#include "../hal/include/hal.h"\n')
    (fault,) = c_faults(tree)
    assert str(fault).startswith("firmware/core/fix.h:1: includes ../hal/include/hal.h; ")


@pytest.mark.parametrize("name", ["firmware/core/fix.h", "firmware/app/loop.h", "hal/wire/message.h"])
def test_a_library_in_the_firmware_is_named(tree: Path, name: str) -> None:
    (tree / name).write_text("#include <string.h>\n")
    (fault,) = c_faults(tree)
    assert str(fault).startswith(f"{name}:1: includes <string.h>; ")


def test_a_room_without_a_rule_is_named(tree: Path) -> None:
    (tree / "firmware/utils").mkdir()
    (tree / "firmware/utils/more.h").write_text("\n")
    assert [str(fault) for fault in c_faults(tree)] == [
        "firmware/utils/more.h:1: no rule says what firmware/utils may include"
    ]


@pytest.mark.parametrize("name", ["firmware/control/pid_h8.S", "firmware/core/fix.S", "firmware/mixer/h8/mixer.inc"])
def test_assembly_outside_its_rooms_is_named(tree: Path, name: str) -> None:
    (tree / name).parent.mkdir(parents=True, exist_ok=True)
    (tree / name).write_text("\trts\n")
    faults = [str(fault) for fault in c_faults(tree)]
    assert faults == [f"{name}:1: is assembly; only firmware/core/h8 and firmware/model/h8 may hold it"]


def test_a_circle_of_headers_is_named(tree: Path) -> None:
    (tree / "firmware/core/fix.h").write_text('#include "core/trig.h"\n')
    (tree / "firmware/core/trig.h").write_text('#include "core/fix.h"\n')
    assert c_cycles(tree) == ["firmware/core/fix.h -> firmware/core/trig.h -> firmware/core/fix.h"]
    assert cycles({"b": {"c"}, "c": {"a"}, "a": {"b"}, "d": {"a"}}) == ["a -> b -> c -> a"]


def code_of(path: Path) -> str:
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", path.read_text(), flags=re.DOTALL)


def test_firmware_holds_no_floating_point_and_no_library() -> None:
    forbidden = re.compile(r"\b(float|double|malloc|free|printf|memcpy|memset|abs|labs)\b")
    parsers = [*(ROOT / "hal/wire").glob("*.[ch]"), *(ROOT / "hal/link").glob("set.[ch]")]
    assert all("<string.h>" not in path.read_text() for path in parsers)
    bad = [
        f"{path.name}: {match.group()}"
        for path in (*(ROOT / "firmware").rglob("*.[ch]"), *parsers)
        for match in forbidden.finditer(code_of(path))
    ]
    assert bad == []
