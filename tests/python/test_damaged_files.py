"""Files of others, damaged at random: each is read, or refused in one line; nothing else happens.

A text file loses, doubles or swaps lines and gets hostile values; a binary one gets turned bits and lengths of all
ones, and is cut off. The seed is fixed. `--full` tries thirty times as many. A .mat file is not among them: damaged, it
can crash scipy's reader, so it is read in a process of its own.
"""

from __future__ import annotations

import random
import re
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import other_logs
import pytest
from bad_datasets import write_good
from brickpilot.campaign import file as campaign_file
from brickpilot.data import reading
from brickpilot.errors import InputError
from brickpilot.importers import dataflash, mcap, parquet, rosbag, ulog, wpilib, wpilog
from brickpilot.importers.table import import_table
from brickpilot.vehicle import compensation, gains, model, scenario
from test_campaign import CAMPAIGN, OTHER, SHORT
from test_compensation import EVERYTHING, compensation_of
from test_gains import saved
from test_import_other_logs import WRITERS

LONGEST_S = 5.0
MOST_BYTES = 1 << 30
HOSTILE = (
    "", "-1", "0", "1e999", "nan", "-inf", "9" * 400, "[]", "{}", "[[1]]", '""', '"\\u0000"', '"../../x"', "true",
    "1979-05-27", "'" + "x" * 5000 + "'", "[" * 2000, "\x00", "\ufeff", "\u202e",
)  # fmt: skip
TOKEN = re.compile(r"[\w.+-]+|\"[^\"\n]*\"|[][{}=,:;]")


@dataclass(frozen=True)
class Reader:
    """A kind of file: what writes a good one into a folder, and what reads it."""

    write: Callable[[Path], Path]
    read: Callable[[Path], Any]
    is_text: bool = True


def of_text(name: str, text: Callable[[], str]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = folder / name
        path.write_text(text(), encoding="utf-8")
        return path

    return write


def of_log(name: str) -> Callable[[Path], Path]:
    return lambda folder: WRITERS[name](folder / name)


def table() -> str:
    rows = [f"{20 * k},{100 + k % 7},{0.1 * k:.3f}" for k in range(60)]
    return "\n".join(["time_ms,pwm,w", *rows]) + "\n"


def as_motor(*mapping: str) -> Callable[[Path], Any]:
    def read(path: Path) -> Any:
        with tempfile.TemporaryDirectory() as folder:
            return import_table([path], Path(folder) / "out", mapping, vehicle="motor")

    return read


def of_campaign(folder: Path) -> Path:
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN)):
        (folder / f"{name}.toml").write_text(text)
    return folder / "trial.toml"


def saved_compensation(folder: Path) -> Path:
    compensation_of(EVERYTHING).save(folder / "compensation.toml")
    return folder / "compensation.toml"


def saved_model(folder: Path) -> Path:
    path = folder / "model.toml"
    model.save(model.rcx(), path)
    return path


READERS = {
    "data set": Reader(lambda folder: write_good(folder) / "dataset.toml", lambda path: reading.read(path.parent)),
    "table": Reader(of_text("log.csv", table), as_motor("time=time_ms:ms", "duty=pwm/255", "speed=w")),
    "model": Reader(saved_model, model.load),
    "scenario": Reader(of_text("s.toml", lambda: scenario.packaged()["mission"].read_text()), scenario.load),
    "campaign": Reader(of_campaign, campaign_file.load),
    "gains": Reader(saved, gains.load),
    "compensation": Reader(saved_compensation, compensation.load),
    "WPILib's JSON": Reader(lambda folder: other_logs.write_json(folder / "a.json", other_logs.old_log()), wpilib.read),
    "WPILOG": Reader(of_log("drive.wpilog"), wpilog.read, is_text=False),
    "ULog": Reader(of_log("drive.ulg"), ulog.read, is_text=False),
    "dataflash": Reader(of_log("drive.bin"), dataflash.read, is_text=False),
    "MCAP": Reader(of_log("drive.mcap"), mcap.read, is_text=False),
    "ROS 1 bag": Reader(of_log("drive.bag"), rosbag.read, is_text=False),
    "Parquet": Reader(of_log("drive.parquet"), parquet.read, is_text=False),
}


def damaged_text(good: bytes, draw: random.Random) -> bytes:
    lines = good.decode().splitlines()
    for _ in range(draw.choice((1, 1, 2, 4))):
        at = draw.randrange(len(lines)) if lines else 0
        tokens = list(TOKEN.finditer(lines[at])) if lines else []
        act = draw.choice(("token", "token", "token", "drop", "double", "swap", "cut"))
        if act == "token" and tokens:
            token = draw.choice(tokens)
            lines[at] = lines[at][: token.start()] + draw.choice(HOSTILE) + lines[at][token.end() :]
        elif act == "drop":
            del lines[at : at + 1]
        elif act == "double":
            lines.insert(at, lines[at] if lines else "")
        elif act == "swap" and lines:
            other = draw.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        elif act == "cut" and lines:
            lines[at:] = [lines[at][: draw.randrange(len(lines[at]) + 1)]]
    return ("\n".join(lines) + "\n").encode()


def damaged_bytes(good: bytes, draw: random.Random) -> bytes:
    data = bytearray(good)
    for _ in range(draw.choice((1, 1, 2, 8))):
        at = draw.randrange(max(len(data), 1))
        act = draw.choice(("bit", "byte", "ones", "cut", "double", "insert"))
        if act == "bit" and data:
            data[at] ^= 1 << draw.randrange(8)
        elif act == "byte" and data:
            data[at] = draw.randrange(256)
        elif act == "ones":
            data[at : at + 4] = b"\xff\xff\xff\xff"
        elif act == "cut":
            del data[at:]
        elif act == "double":
            data[at:at] = data[at : at + draw.randrange(1, 64)]
        elif act == "insert":
            data[at:at] = draw.randbytes(draw.randrange(1, 16))
    return bytes(data)


@pytest.mark.parametrize("kind", READERS)
def test_a_damaged_file_is_read_or_refused_in_one_line(kind: str, tmp_path: Path, full: bool) -> None:
    reader, count = READERS[kind], 1500 if full else 50
    folder = tmp_path / "in"
    folder.mkdir()
    path = reader.write(folder)
    reader.read(path)
    good, draw = path.read_bytes(), random.Random(kind)
    around = {one for one in tmp_path.iterdir() if one != folder}
    read, before = 0, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(count):
        path.write_bytes((damaged_text if reader.is_text else damaged_bytes)(good, draw))
        began = time.perf_counter()
        try:
            reader.read(path)
            read += 1
        except Exception as error:
            if not isinstance(error, InputError) or "\n" in str(error):
                path.replace(tmp_path / f"damaged-{number}")
                raise AssertionError(f"{kind} {number}: {type(error).__name__}: {error}") from error
        assert time.perf_counter() - began < LONGEST_S, f"{kind} {number}"
    assert 0 < read < count  # the faults reach what is read, and are not all refused by the first check
    assert {one for one in tmp_path.iterdir() if one != folder} == around
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown * 1024 < MOST_BYTES
