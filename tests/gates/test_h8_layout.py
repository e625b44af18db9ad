"""layout.h states the offset of each struct field that the RCX's assembly reads; a wrong offset stops the build."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "firmware/core/h8/layout.h"
HEADERS = [
    *(ROOT / "firmware/core").glob("*.h"),
    *(ROOT / "firmware/model").glob("*.h"),
]
ROW = re.compile(r"^    X\((\w+), (\w+)(?:\[1\])?, (\w+)\)", re.MULTILINE)


def listed() -> dict[str, list[str]]:
    """Returns struct -> the names of its fields in layout.h, without repeats."""
    fields: dict[str, list[str]] = {}
    for struct, field, _ in ROW.findall(LIST.read_text()):
        if field not in fields.setdefault(struct, []):
            fields[struct].append(field)
    return fields


def definition(struct: str) -> tuple[Path, str]:
    """Returns the header that defines a struct, and the text between the struct's braces."""
    for header in HEADERS:
        found = re.search(r"typedef struct \{\n([^{}]*)\} " + struct + ";", header.read_text())
        if found is not None:
            return header, found[1]
    raise AssertionError(f"{struct}: no definition")


def declarations(body: str) -> list[tuple[str, str]]:
    """Returns (field, line) of each declaration between a struct's braces."""
    lines = [line for line in body.split("\n") if re.match(r"    \w", line)]
    return [(re.findall(r"(\w+)(?:\[\d+\])?;", line)[0], line) for line in lines]


def swaps() -> list[tuple[str, str, str]]:
    """Returns (struct, field, next field) for each two neighbouring fields of every listed struct."""
    return [
        (struct, first, second)
        for struct in listed()
        for (first, _), (second, _) in zip(
            declarations(definition(struct)[1]), declarations(definition(struct)[1])[1:], strict=False
        )
    ]


def named(struct: str, field: str) -> str:
    """Returns the compiler's message about a field that has moved."""
    names = [name for its, one, name in ROW.findall(LIST.read_text()) if (its, one) == (struct, field)]
    return f"correct_in_core_h8_layout_h_{names[0]}' is negative"


def compile_check(root: Path) -> subprocess.CompletedProcess[str]:
    command = (root / "hal/h8/compile", root / "firmware/model/h8/layout.c", root / "object")
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("layout")
    for folder in ("firmware", "hal"):
        shutil.copytree(ROOT / folder, root / folder)
    return root


def test_the_list_is_right(copy: Path) -> None:
    done = compile_check(copy)
    assert done.returncode == 0, done.stderr


def test_every_field_of_a_listed_struct_is_listed_in_its_order() -> None:
    for struct, fields in listed().items():
        assert fields == [field for field, _ in declarations(definition(struct)[1])], struct


def test_the_assembly_reads_no_struct_by_a_number_of_its_own() -> None:
    """Exceptions: offsets from the stack pointer, and 2, for the second word of a number at a moving pointer."""
    for source in (ROOT / "firmware").rglob("*.S"):
        found = re.findall(r"@\((\d+),r([0-6])\)", source.read_text())
        assert {offset for offset, _ in found} <= {"2"}, source.name


def test_swaps_are_tried() -> None:
    assert len(swaps()) > 20
    assert {struct for struct, _, _ in swaps()} == set(listed())


@pytest.mark.parametrize(("struct", "first", "second"), swaps())
def test_two_fields_that_change_places_do_not_compile(struct: str, first: str, second: str, copy: Path) -> None:
    original, body = definition(struct)
    header = copy / original.relative_to(ROOT)
    lines = dict(declarations(body))
    swapped = body.replace(lines[first], "\0").replace(lines[second], lines[first]).replace("\0", lines[second])
    text = header.read_text()
    try:
        header.write_text(text.replace(body, swapped))
        done = compile_check(copy)
    finally:
        header.write_text(text)
    assert done.returncode != 0, f"{struct}: {first} and {second}"
    assert named(struct, first) in done.stderr
    assert named(struct, second) in done.stderr


def test_a_wrong_offset_does_not_compile(copy: Path) -> None:
    header = copy / LIST.relative_to(ROOT)
    text = header.read_text()
    offsets = re.findall(r"^#define ([A-Z0-9_]+) (\d+)$", text, re.MULTILINE)
    assert len(offsets) > 20
    try:
        for name, offset in offsets:
            header.write_text(text.replace(f"#define {name} {offset}\n", f"#define {name} {offset}1\n"))
            assert f"correct_in_core_h8_layout_h_{name}' is negative" in compile_check(copy).stderr
    finally:
        header.write_text(text)
