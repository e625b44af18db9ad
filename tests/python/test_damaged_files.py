"""A randomly damaged file, of this or another program, is read or refused in one line; nothing else happens.

A text file loses, doubles or swaps lines and gets hostile values. A binary file gets flipped bits and length fields of
all ones, and is cut short. The seed is fixed. `--full` tries 10,500 files of each kind, in about an hour. A damaged
.mat file can crash scipy's reader, so a separate process reads it, as in the importer; `--full` tries 1,500 of these.
"""

from __future__ import annotations

import json
import multiprocessing
import random
import re
import struct
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import other_logs
import pytest
from bad_datasets import write_good
from brickpilot.campaign import file as campaign_file
from brickpilot.campaign import robots
from brickpilot.data import reading
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.errors import InputError
from brickpilot.export import run_read
from brickpilot.flash import avr, image_files
from brickpilot.hil import traffic_log
from brickpilot.importers import dataflash, mat_file, mcap, parquet, rosbag, ulog, wpilib, wpilog
from brickpilot.vehicle import compensation, gains, model, scenario
from importing import import_table
from intelhex import IntelHex
from test_campaign import CAMPAIGN, OTHER, SHORT
from test_campaign_robots import LENGTHS
from test_compensation import EVERYTHING, compensation_of
from test_gains import saved
from test_import_matlab import MAT_WRITERS
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
    """A kind of file: a function that writes a good file into a folder, and one that reads it."""

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


def verdict(folder: Path) -> Path:
    """Writes an ambiguous verdict with a rival, and a spread about the packaged robot; returns the path."""
    own = model.rcx().parameters
    spread = LENGTHS.to_json() | {"values": [own[name] for name in LENGTHS.names]}
    rival = {"name": "scrub", "nominal": {"mass": 0.9}, "effects": {"yaw_scrub": {"moment": 0.01}}}
    given = {"verdict": "ambiguous", "spread": spread, "effects": [{"equivalents": [rival]}]}
    (folder / "verdict.json").write_text(json.dumps(given, indent=1))
    return folder / "verdict.json"


def as_allowed(path: Path) -> robots.Allowed:
    return robots.read(model.rcx(), path.with_name("model.toml"), SD_SHARE)


def run_of(folder: Path) -> Path:
    rows = [f"{0.003 * k:.3f},{0.01 * k:.2f},{k % 5}" for k in range(60)]
    (folder / "log.csv").write_text("\n".join(["time_s,true_x_m,mode", *rows]) + "\n")
    (folder / "summary.json").write_text("{}\n")
    return folder / "log.csv"


def recording(suffix: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = folder / f"flight{suffix}"
        with can.Logger(str(path)) as logger:
            for k in range(60):
                data = bytes([k, 2 * k, 255 - k, *range(5)])
                logger(can.Message(timestamp=1e-3 * k, arbitration_id=0x100 + k % 7, is_extended_id=False, data=data))
        return path

    return write


def hex_image(folder: Path) -> Path:
    image = IntelHex()
    image.frombytes(bytes(k * k % 251 for k in range(700)))
    image.write_hex_file(str(folder / "image.hex"))
    return folder / "image.hex"


def program(folder: Path) -> Path:
    body = bytes(k * k % 251 for k in range(120))
    header = struct.pack(">8H", image_files.VERSION, 0xB000, 100, 20, 30, 344, 0, 2)
    (folder / "p.lx").write_bytes(image_files.MAGIC + header + body + struct.pack(">2H", 4, 60))
    return folder / "p.lx"


def records(folder: Path) -> Path:
    """A firmware image of S-records."""
    data = bytes(k * k % 61 | 0x80 for k in range(320)) + image_files.KNOCK

    def line(kind: str, at: int, content: bytes) -> str:
        inside = bytes([len(content) + 3]) + at.to_bytes(2, "big") + content
        return f"S{kind}{(inside + bytes([~sum(inside) & 255])).hex().upper()}"

    lines = [line("1", 0x8000 + k, data[k : k + 16]) for k in range(0, len(data), 16)]
    (folder / "image.srec").write_text("\n".join([*lines, line("9", 0x8000, b"")]) + "\n")
    return folder / "image.srec"


READERS = {
    "data set": Reader(lambda folder: write_good(folder) / "dataset.toml", lambda path: reading.read(path.parent)),
    "table": Reader(of_text("log.csv", table), as_motor("time=time_ms:ms", "duty=pwm/255", "speed=w")),
    "model": Reader(saved_model, model.load),
    "scenario": Reader(of_text("s.toml", lambda: scenario.packaged()["mission"].read_text()), scenario.load),
    "campaign": Reader(of_campaign, campaign_file.load),
    "gains": Reader(saved, gains.load),
    "compensation": Reader(saved_compensation, compensation.load),
    "verdict": Reader(verdict, as_allowed),
    "run folder": Reader(run_of, lambda path: run_read.read(path.parent)),
    "recording .asc": Reader(recording(".asc"), traffic_log.read),
    "recording .log": Reader(recording(".log"), traffic_log.read),
    "recording .blf": Reader(recording(".blf"), traffic_log.read, is_text=False),
    "image .hex": Reader(hex_image, lambda path: avr.read(path, avr.PARTS["328p"])),
    "image .srec": Reader(records, image_files.read_firmware),
    "program .lx": Reader(program, image_files.read_program, is_text=False),
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
    reader, count = READERS[kind], 10_500 if full else 50
    folder = tmp_path / "in"
    folder.mkdir()
    path = reader.write(folder)
    reader.read(path)
    good, draw = path.read_bytes(), random.Random(kind)
    around = {one for one in tmp_path.iterdir() if one != folder}
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak of memory (proc_pid_clear_refs(5))
    read, before = 0, peak_bytes()
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
    assert 0 < read < count  # some damaged files are read, and some are refused
    assert {one for one in tmp_path.iterdir() if one != folder} == around
    assert peak_bytes() - before < MOST_BYTES


def peak_bytes() -> int:
    """Returns the peak memory of this process in bytes; the ru_maxrss of a child also counts its parent's memory."""
    line = next(one for one in Path("/proc/self/status").read_text().splitlines() if one.startswith("VmHWM:"))
    return 1024 * int(line.split()[1])


def as_importer(path: Path) -> tuple[bool, int]:
    """Reads a .mat file as the importer's process does; returns whether that succeeded, and the peak bytes."""
    found = mat_file.parse(path)
    return found is not None, peak_bytes()


@pytest.mark.parametrize("version", MAT_WRITERS)
def test_a_damaged_mat_file_is_read_or_refused_in_time_and_memory(version: str, tmp_path: Path, full: bool) -> None:
    """A crash of the reader counts as a refusal: `mat_file.load` reports it in one line."""
    path, count = tmp_path / "log.mat", 1500 if full else 50
    MAT_WRITERS[version](path)
    good, draw = path.read_bytes(), random.Random(version)
    assert set(mat_file.load(path)) >= {"t", "u", "log"}
    pool, read, crashed = None, 0, 0
    for number in range(count):
        path.write_bytes(damaged_bytes(good, draw))
        pool = pool or ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
        pool.submit(peak_bytes).result()  # the process has started and imported all that it needs
        try:
            could, bytes_used = pool.submit(as_importer, path).result(LONGEST_S)
        except BrokenProcessPool:
            pool, crashed = None, crashed + 1
            continue
        except TimeoutError:
            for process in pool._processes.values():
                process.kill()
            path.replace(tmp_path / f"damaged-{number}")
            raise
        read += could
        assert bytes_used < MOST_BYTES, number
    if pool is not None:
        pool.shutdown()
    print(f"{version}: {read} read, {crashed} crashed, of {count}")
    assert 0 < read < count
