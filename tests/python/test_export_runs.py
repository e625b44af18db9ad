"""Runs and link recordings exported as MCAP and Parquet: the libraries of these formats read every sample."""

from __future__ import annotations

import io
import json
import math
import shutil
from collections import defaultdict
from pathlib import Path
from typing import Any

import can
import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest
from brickpilot.export import mcap_file, run_read
from brickpilot.link.messages import book
from command import brickpilot
from mcap.reader import make_reader

SCENARIO = 'name = "s"\nkind = "mission"\nduration_s = 2.4\nwaypoints_m = [[0.3, 0.1]]\n'


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a folder with a simulated run, a flight over a link, and the recording of the link's traffic."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "s.toml").write_text(SCENARIO, encoding="utf-8")
    for words in (
        ("run", "s.toml", "--sensors", "imu+encoders", "--out", "plain"),
        (
            "hil",
            "s.toml",
            "--link",
            "can:virtual",
            "--record",
            "link.log",
            "--telemetry-every",
            "10",
            "--out",
            "linked",
        ),
    ):
        done = brickpilot(*words, cwd=folder)
        assert (done.returncode, done.stderr) == (0, "")
    return folder


def exported(folder: Path, *words: str) -> None:
    done = brickpilot("export", *words, cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")


def opened(path: Path) -> tuple[dict[str, list[tuple[int, dict[str, Any]]]], dict[str, Any], Any]:
    """Returns topic -> [(time in ns, message)], topic -> schema, and the reader of the MCAP file `path`."""
    reader = make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True)
    found: dict[str, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
    schemas: dict[str, Any] = {}
    times = []
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert schema is not None
        assert (channel.message_encoding, schema.encoding) == ("json", "jsonschema")
        times.append(message.log_time)
        found[channel.topic].append((message.log_time, json.loads(message.data)))
        schemas[channel.topic] = json.loads(schema.data)
    assert times == sorted(times)
    return found, schemas, reader


def rows_of(path: Path) -> tuple[list[str], np.ndarray[Any, np.dtype[np.float64]]]:
    lines = path.read_text().splitlines()
    return lines[0].split(","), np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


@pytest.mark.parametrize("name", ["plain", "linked"])
def test_every_cell_of_a_run_is_in_its_mcap(flown: Path, name: str) -> None:
    exported(flown, "mcap", name)
    found, _, reader = opened(flown / f"{name}.mcap")
    seen: dict[str, list[Any]] = {}
    tables = [("log.csv", mcap_file._place)] + ([("ticks.csv", lambda column: ("/ticks", column))] * (name == "linked"))
    for table, place in tables:
        columns, cells = rows_of(flown / name / table)
        for column, values in zip(columns[1:], cells.T[1:], strict=True):
            topic, field = place(column)
            times, messages = zip(*found[topic], strict=True)
            assert list(times) == [round(time * 1e9) for time in cells[:, 0]]
            told = [message[field] for message in messages]
            assert told == [value if math.isfinite(value) else None for value in values], column
            seen[f"{topic}.{field}"] = told
    assert sum(
        len(messages[0][1]) for topic, messages in found.items() if not topic.startswith(("/pose", "/tf"))
    ) == len(seen)
    (attached,) = reader.iter_attachments()
    assert attached.data == (flown / name / "summary.json").read_bytes()


def test_the_poses_are_those_of_the_run_in_a_frame_with_z_up(flown: Path) -> None:
    exported(flown, "mcap", "plain", "--out", "poses.mcap")
    found, schemas, _ = opened(flown / "poses.mcap")
    columns, cells = rows_of(flown / "plain/log.csv")
    x, y, turned = (cells[::10, columns.index(f"true_{name}")] for name in ("x_m", "y_m", "heading_rad"))
    poses = [message["pose"] for _, message in found["/pose"]]
    assert [pose["position"]["x"] for pose in poses] == list(x)
    assert [pose["position"]["y"] for pose in poses] == list(-y)
    angles = [2 * math.atan2(pose["orientation"]["z"], pose["orientation"]["w"]) for pose in poses]
    assert angles == pytest.approx(list(-turned))
    assert np.ptp(turned) > 0.1
    assert [message["translation"] for _, message in found["/tf"]] == [pose["position"] for pose in poses]
    ((_, path),) = found["/pose_path"]
    assert path["poses"] == poses
    titles = {"/pose": "PoseInFrame", "/pose_path": "PosesInFrame", "/tf": "FrameTransform"}
    assert {topic: schemas[topic]["title"] for topic in titles} == {k: f"foxglove.{v}" for k, v in titles.items()}


@pytest.mark.parametrize("source", ["plain", "linked", "link.log"])
def test_messages_keep_to_their_schemas_and_the_layout_shows_what_is_there(flown: Path, source: str) -> None:
    exported(flown, "mcap", source, "--out", "checked.mcap")
    found, schemas, _ = opened(flown / "checked.mcap")
    for topic, messages in found.items():
        validate = jsonschema.Draft202012Validator(schemas[topic]).validate
        for _, message in messages[:: max(1, len(messages) // 20)]:
            validate(message)
    layout = json.loads((flown / "checked.foxglove.json").read_text())
    paths = [one["value"] for panel in layout["configById"].values() for one in panel.get("paths", [])]
    assert len(paths) > 5
    for path in paths:
        topic, _, field = path.partition(".")
        assert field in found[topic][0][1]
    scene = [topic for panel in layout["configById"].values() for topic in panel.get("topics", {})]
    assert set(scene) <= set(found)
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def leaves(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else leaves(tree["first"]) + leaves(tree["second"])


def test_every_frame_of_a_recording_is_in_its_mcap(flown: Path) -> None:
    with can.LogReader(str(flown / "link.log")) as reader:
        frames = list(reader)
    text = (flown / "link.log").read_text()
    (flown / "more.log").write_text(text + text.splitlines()[-1].split(" ")[0] + " can0 7FF#0102 R\n")
    exported(flown, "mcap", "more.log")
    found, _, _ = opened(flown / "more.mcap")
    expected: dict[str, list[Any]] = defaultdict(list)
    for frame in frames:
        name = book().by_id[frame.arbitration_id].name
        values = book().database.decode_message(frame.arbitration_id, frame.data, decode_choices=False)
        time = round((frame.timestamp - frames[0].timestamp) * 1e9)
        expected[f"/link/{name}"].append((time, {**values, "received": int(frame.is_rx)}))
    ((_, unknown),) = found.pop("/link/unknown")
    assert (unknown["id"], unknown["data"]) == (0x7FF, "0102")
    assert found == expected
    assert len(found["/link/MOTORS"]) == 800


@pytest.mark.parametrize("name", ["plain", "linked"])
def test_parquet_holds_every_cell_and_every_unit(flown: Path, name: str) -> None:
    exported(flown, "parquet", name)
    for table, ending in [("log.csv", "")] + [("ticks.csv", "-ticks")] * (name == "linked"):
        read = pq.read_table(flown / f"{name}{ending}.parquet")
        columns, cells = rows_of(flown / name / table)
        assert read.column_names == columns
        for column, values in zip(columns, cells.T, strict=True):
            assert np.array_equal(read[column].to_numpy(), values, equal_nan=True)
            assert read.schema.field(column).metadata[b"unit"].decode() == run_read.unit(column)
    log = pq.read_table(flown / f"{name}.parquet").schema
    assert log.metadata[b"summary.json"] == (flown / name / "summary.json").read_bytes()
    units = {"true_x_m": "m", "true_accel_surge_m_s2": "m/s^2", "true_yaw_rate_rad_s": "rad/s", "left_duty": "1"}
    assert {column: log.field(column).metadata[b"unit"].decode() for column in units} == units


def test_the_same_run_gives_the_same_bytes(flown: Path) -> None:
    for kind, source in (("mcap", "plain"), ("mcap", "link.log"), ("parquet", "plain")):
        for name in ("first", "second"):
            exported(flown, kind, source, "--out", f"{name}.{kind}")
        assert (flown / f"first.{kind}").read_bytes() == (flown / f"second.{kind}").read_bytes()


def damaged(flown: Path, folder: Path, change: Any) -> None:
    shutil.copytree(flown / "plain", folder / "run")
    path = folder / "run/log.csv"
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: lines.__setitem__(40, lines[40].replace(",", ",x", 1)), "run/log.csv: is no table of numbers"),
        (lambda lines: lines.__setitem__(40, lines[40] + ",7"), "run/log.csv:41: is no table of numbers"),
        (lambda lines: lines.__setitem__(40, lines[50]), "run/log.csv: time_s: has times that fall"),
        (lambda lines: lines.__delitem__(slice(1, None)), "run/log.csv: has no rows"),
        (lambda lines: lines.clear(), "run/log.csv: is no table of numbers"),
        (lambda lines: lines.__setitem__(40, lines[40].rpartition(",")[0]), "run/log.csv:41: is no table of numbers"),
        (lambda lines: lines.__setitem__(0, lines[0].rpartition(",")[0]), "run/log.csv:2: is no table of numbers"),
    ],
)
@pytest.mark.parametrize("kind", ["mcap", "parquet"])
def test_a_damaged_log_is_refused_in_one_line(flown: Path, tmp_path: Path, kind: str, change: Any, says: str) -> None:
    damaged(flown, tmp_path, change)
    done = brickpilot("export", kind, "run", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert says in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_log_that_is_cut_off_is_refused(flown: Path, tmp_path: Path) -> None:
    shutil.copytree(flown / "plain", tmp_path / "run")
    path = tmp_path / "run/log.csv"
    content = path.read_bytes()
    path.write_bytes(content[:-1])  # the last number may be cut short
    done = brickpilot("export", "parquet", "run", cwd=tmp_path)
    line = content.count(b"\n")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"brickpilot: run/log.csv:{line}: ends inside a line")


@pytest.mark.parametrize("source", ["none", "folder", "link.txt", "empty.log", "where/run.mcap"])
def test_what_is_no_run_is_refused_in_one_line(flown: Path, tmp_path: Path, source: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.txt").write_text("")
    (tmp_path / "empty.log").write_text("")
    (tmp_path / "where").write_text("")
    shutil.copytree(flown / "plain", tmp_path / "plain")
    words = ["plain", "--out", source] if "/" in source else [source]
    done = brickpilot("export", "mcap", *words, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert source in done.stderr


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(Exception, match=r"needs the library mcap.writer: pip install 'brickpilot\[export\]'"):
        mcap_file.write([], [], {})
