"""Random data sets are read back with the written values; a damaged data set is read, or refused in one line."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
from bad_datasets import write_good
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from brickpilot.data.signals import SIGNALS
from brickpilot.errors import InputError
from hypothesis import given, settings
from hypothesis import strategies as st

FACTORS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "V": {"V": 1.0, "mV": 1e-3},
    "m/s^2": {"m/s^2": 1.0, "g0": 9.80665, "mm/s^2": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30},
    "m": {"m": 1.0, "mm": 1e-3, "in": 0.0254},
}
OUTPUTS = ["accel_surge", "accel_sway", "yaw_rate", "wheel_speed_left", "wheel_travel_right"]
number = st.floats(-1e4, 1e4, allow_nan=False).map(lambda value: round(value, 9))
cell = st.one_of(st.none(), number)


@st.composite
def layouts(draw: st.DrawFn) -> dict[str, object]:
    """Draws everything that the writer of a data set may choose freely."""
    outputs = draw(st.lists(st.sampled_from(OUTPUTS), min_size=1, unique=True))
    signals = draw(st.permutations(["time", "voltage_left", "voltage_right", *outputs]))
    samples = draw(st.integers(2, 12))
    steps = draw(st.lists(st.floats(1e-3, 10.0), min_size=samples, max_size=samples))
    columns = {name: draw(st.lists(cell, min_size=samples, max_size=samples)) for name in signals}
    columns[outputs[0]][0] = draw(number)
    units = {name: draw(st.sampled_from(sorted(FACTORS[SIGNALS[name].unit]))) for name in signals}
    scales = {
        name: draw(st.sampled_from([1.0, 0.25, 3.0] if name == "time" else [1.0, -2.0, 1e-3])) for name in signals
    }
    # Steps of 1 ms to 10 s: the reader would merge faster rows, see test_decimation.py.
    columns["time"] = (np.cumsum(steps) / (FACTORS["s"][units["time"]] * scales["time"])).tolist()
    return {
        "frame": draw(st.sampled_from(["FLU", "FRD"])),
        "header": draw(st.booleans()),
        "delimiter": draw(st.sampled_from([",", ";", "\t", "|"])),
        "columns": columns,
        "units": units,
        "scales": scales,
        "offsets": {name: draw(st.sampled_from([0.0, 5.0, -0.125])) for name in signals},
    }


def write_layout(folder: Path, layout: dict) -> None:  # type: ignore[type-arg]
    names = list(layout["columns"])
    toml = f'name = "p"\nvehicle = "diff_drive"\nframe = "{layout["frame"]}"\n'
    toml += f"csv = {{ delimiter = {json.dumps(layout['delimiter'])}, header = {json.dumps(layout['header'])} }}\n"
    toml += "[signals]\n"
    for position, name in enumerate(names):
        column = json.dumps(f"c {name}") if layout["header"] else position
        toml += f"{name} = {{ column = {column}, unit = {json.dumps(layout['units'][name])}, "
        toml += f"scale = {layout['scales'][name]!r}, offset = {layout['offsets'][name]!r} }}\n"
    toml += '[[runs]]\nname = "r"\nfile = "r.csv"\n'
    rows = zip(*layout["columns"].values(), strict=True)
    lines = [layout["delimiter"].join("" if value is None else repr(value) for value in row) for row in rows]
    if layout["header"]:
        lines.insert(0, layout["delimiter"].join(f"c {name}" for name in names))
    (folder / "dataset.toml").write_text(toml, encoding="utf-8")
    (folder / "r.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


@given(layouts())
@settings(max_examples=150, deadline=None)
def test_a_data_set_reads_back_as_the_values_it_was_written_from(layout: dict) -> None:  # type: ignore[type-arg]
    with tempfile.TemporaryDirectory() as folder:
        write_layout(Path(folder), layout)
        run = read(folder).runs[0]
    for name, raw in layout["columns"].items():
        got = run.time if name == "time" else {**run.inputs, **run.outputs}[name]
        factor = FACTORS[SIGNALS[name].unit][layout["units"][name]]
        turned = layout["frame"] == "FLU" and name in {"accel_sway", "yaw_rate"}
        written = np.array([np.nan if value is None else value for value in raw])
        meant = factor * (written * layout["scales"][name] + layout["offsets"][name]) * (-1.0 if turned else 1.0)
        np.testing.assert_allclose(got, meant, rtol=1e-12, atol=1e-15)


def read_or_refusal(folder: Path) -> tuple[Dataset | None, str]:
    """Returns (data set, "") or, if the data set is refused, (None, the line that says why)."""
    try:
        return read(folder), ""
    except InputError as error:
        message = str(error)
    assert len(message.splitlines()) == 1
    return None, message


changes = st.lists(
    st.tuples(st.integers(0, 10**6), st.sampled_from(["drop", "put", "double", "cut"]), st.binary(max_size=4)),
    min_size=1,
    max_size=6,
)
FILES = ["dataset.toml", "straight.csv"]


def damage(content: bytes, edits: list[tuple[int, str, bytes]]) -> bytes:
    """Returns `content` with bytes dropped, replaced or repeated, or with its end cut off."""
    for where, what, new in edits:
        at = where % (len(content) + 1)
        if what == "drop":
            content = content[:at] + content[at + 1 + len(new) :]
        elif what == "put":
            content = content[:at] + new + content[at + len(new) :]
        elif what == "double":
            content = content[: at + 20] + content[at:]
        else:
            content = content[: max(at, len(content) // 2)]
    return content


@given(st.sampled_from(FILES), changes)
@settings(max_examples=400, deadline=None)
def test_a_damaged_file_is_read_or_refused_in_one_line(file: str, edits: list[tuple[int, str, bytes]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_good(Path(folder)) / file
        path.write_bytes(damage(path.read_bytes(), edits))
        dataset, message = read_or_refusal(Path(folder))
    assert message.startswith(folder) if dataset is None else message == ""
    for run in dataset.runs if dataset else ():
        assert np.isfinite(run.time).all()
        assert (np.diff(run.time) > 0).all()
        assert not any(np.isinf(values).any() for values in {**run.inputs, **run.outputs}.values())


TOKENS = (
    """name vehicle = "motor" [ ] [[ ]] { } runs signals . , # 1e999 0xFF nan true 1979-05-27 " ' nominal time column"""
)
tokens = st.lists(st.sampled_from([*TOKENS.split(" "), "\n", "'''"]), max_size=60).map(" ".join)


@given(tokens)
@settings(max_examples=300, deadline=None)
def test_any_heap_of_toml_tokens_is_refused_in_one_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "dataset.toml").write_text(text, encoding="utf-8")
        dataset, message = read_or_refusal(Path(folder))
    assert dataset is None, f"read as a data set: {text!r}"
    assert message.startswith(folder)
