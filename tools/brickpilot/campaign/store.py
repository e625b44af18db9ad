"""The folder of a campaign. Each part, which holds some runs, is a file, until all parts are merged into one table.

A part is written beside its final place and then renamed, so that a part is never incomplete. The part's name,
KEY.CRC32.parquet, holds the checksum of its bytes. So a part that a power cut has damaged is found, and its runs are
flown again. The bytes depend only on the table, not on time or host. The folder also holds the versions of this program
and of its libraries, because a result may depend on them.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import platform
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import filelock
import pyarrow as pa
import pyarrow.parquet as pq

import brickpilot
from brickpilot.errors import InputError, WorkFailedError


@dataclass(frozen=True)
class Versions:
    """The versions of one process. Two processes with equal versions give the same bytes for the same part.

    Attributes:
        brickpilot: the version of the program.
        code: hash of the program's Python files and tables.
        plant: hash of the program's compiled libraries.
        python: the version of Python, without its last number.
        numpy, scipy, pyarrow: the versions of the libraries.
    """

    brickpilot: str
    code: str
    plant: str
    python: str
    numpy: str
    scipy: str
    pyarrow: str

    def differences(self, other: Versions) -> str:
        """Returns the differences in words, this version first: "brickpilot 0.1.0, not 0.2.0"; empty: no difference."""
        mine, theirs = dataclasses.asdict(self), dataclasses.asdict(other)
        return "; ".join(f"{name} {mine[name]}, not {theirs[name]}" for name in mine if mine[name] != theirs[name])


@cache
def versions_here() -> Versions:
    """Returns the versions of this process."""
    files = sorted(path for path in Path(brickpilot.__file__).parent.rglob("*") if path.is_file())
    libraries = {name: version(name) for name in ("numpy", "scipy", "pyarrow")}
    return Versions(
        brickpilot=brickpilot.__version__,
        code=_hash([path for path in files if path.suffix in (".py", ".toml")]),
        plant=_hash([path for path in files if path.suffix in (".so", ".dylib", ".dll")]),
        python=".".join(platform.python_version_tuple()[:2]),
        **libraries,
    )


def _hash(files: list[Path]) -> str:
    """Returns the hash of files, with their names."""
    total = hashlib.sha256()
    for path in files:
        total.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()[:12]


ROWS = 16_384
"""Least number of rows in a row group of the merged table. A group of 50 columns needs 7 MB."""

_CAMPAIGN = "campaign.json"
_PARTS = "parts"
_BESIDE = ".unfinished"
_KEY = re.compile(r"[A-Za-z0-9_-]{1,100}")
_NAME = re.compile(r"([A-Za-z0-9_-]{1,100})\.([0-9a-f]{8})\.parquet")

# Every option that affects the bytes is given here, so the bytes do not depend on the defaults of a version.
_WRITER: dict[str, Any] = {
    "version": "2.6",
    "data_page_version": "1.0",
    "compression": "zstd",
    "compression_level": 3,
    "use_dictionary": False,
    "write_statistics": True,
    "write_page_index": False,
    "store_schema": True,
}


class Parts:
    """The parts in a folder, as a context manager: within its block, no other process can open the folder."""

    def __init__(self, folder: Path, campaign: Mapping[str, Any]) -> None:
        """Prepares the use of a folder, which need not exist.

        Args:
            campaign: everything on which the rows depend, as a JSON object. A folder of another campaign, or of another
                version of this program, is refused.
        """
        self.folder = folder
        self._campaign = campaign
        self._files: dict[str, Path] = {}
        self._open = ExitStack()

    def __enter__(self) -> Parts:
        """Locks the folder and reads its parts.

        Raises:
            InputError: another process has the folder open, or the folder holds another campaign.
        """
        with self._open as opened, _one_line(self.folder):
            (self.folder / _PARTS).mkdir(parents=True, exist_ok=True)
            try:
                opened.enter_context(filelock.FileLock(self.folder / ".lock", blocking=False))
            except filelock.Timeout:
                raise InputError(
                    "another campaign is writing here: wait for it, or name another folder", file=self.folder
                ) from None
            self._claim()
            self._look_through()
            self._open = opened.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._open.close()

    def done(self) -> set[str]:
        """Returns the keys of the finished parts."""
        return set(self._files)

    def write(self, key: str, table: pa.Table) -> None:
        """Writes the table of a part into the folder.

        Raises:
            ValueError: the key cannot be a file's name.
            WorkFailedError: the disk is full or cannot be written. The part is not written.
        """
        if not _KEY.fullmatch(key):
            raise ValueError(f"{key!r} is no key: letters, digits, - and _ alone, at most 100")
        content = BytesIO()
        pq.write_table(table, content, **_WRITER)
        data = content.getvalue()
        path = self.folder / _PARTS / f"{key}.{zlib.crc32(data):08x}.parquet"
        with _written_beside(path) as file:
            file.write(data)
        self._files[key] = path

    def merge(self, keys: Iterable[str], path: Path) -> None:
        """Writes the rows of these parts into one table, in the order of `keys`, with memory for one row group only.

        Raises:
            WorkFailedError: a part is missing or was damaged meanwhile, or the disk is full. No table is written.
        """
        with _written_beside(path, durable=True) as file:
            groups = _groups(self._tables(keys))
            first = next(groups, None)
            if first is None:
                raise WorkFailedError(f"{self.folder}: no part to merge")
            with pq.ParquetWriter(file, first.schema, **_WRITER) as writer:
                writer.write_table(first, row_group_size=first.num_rows)
                for group in groups:
                    writer.write_table(group, row_group_size=group.num_rows)

    def _tables(self, keys: Iterable[str]) -> Iterator[pa.Table]:
        """Yields the tables of parts; each table must have the columns of the first one."""
        schema = None
        for key in keys:
            table = self._read(key)
            schema = schema or table.schema
            if table.schema != schema:
                raise WorkFailedError(f"{self.folder}: part {key} has other columns than the first")
            yield table

    def _read(self, key: str) -> pa.Table:
        path = self._files.get(key)
        if path is None:
            raise WorkFailedError(f"{self.folder}: part {key} is missing")
        with _one_line(path):
            data = _whole(path)
        if data is None:
            raise WorkFailedError(f"{path}: was damaged after it was written: run the campaign again")
        return pq.ParquetFile(pa.BufferReader(data)).read(use_threads=False)  # small, so threads gain nothing

    def _claim(self) -> None:
        """Writes the campaign's identity into the folder; refuses the folder of another campaign."""
        path = self.folder / _CAMPAIGN
        here = dataclasses.asdict(versions_here())
        text = json.dumps(self._campaign, sort_keys=True, allow_nan=False)
        mine = {"campaign": hashlib.sha256(text.encode()).hexdigest(), "versions": here}
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            theirs, made_by = content["campaign"], Versions(**content["versions"])
        except FileNotFoundError:
            with _written_beside(path) as file:
                file.write((json.dumps(mine, indent=1) + "\n").encode())
            return
        except (ValueError, TypeError, KeyError) as error:
            raise InputError(
                "is not a file that a campaign wrote: remove the folder, or name another", file=path
            ) from error
        if theirs != mine["campaign"]:
            raise InputError("holds another campaign: name another folder, or remove this one", file=self.folder)
        if differences := made_by.differences(versions_here()):
            raise InputError(f"was begun with {differences}: name another folder, or remove this one", file=self.folder)

    def _look_through(self) -> None:
        """Finds the complete parts, and removes damaged and unfinished parts."""
        for path in sorted((self.folder / _PARTS).iterdir()):
            name = _NAME.fullmatch(path.name)
            if name and _whole(path) is not None:
                self._files[name[1]] = path
            elif name:
                path.unlink()
        for path in (*self.folder.glob(f".*{_BESIDE}"), *(self.folder / _PARTS).glob(f".*{_BESIDE}")):
            path.unlink()


def _whole(path: Path) -> bytes | None:
    """Returns the bytes of a part; None: the checksum of the bytes is wrong."""
    data = path.read_bytes()
    return data if path.name.split(".")[-2] == f"{zlib.crc32(data):08x}" else None


def _groups(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Yields the rows of tables in larger tables of at least `ROWS` rows; the last table may have fewer rows."""
    waiting: list[pa.Table] = []
    for table in tables:
        waiting.append(table)
        if sum(table.num_rows for table in waiting) >= ROWS:
            yield pa.concat_tables(waiting).combine_chunks()
            waiting = []
    if waiting:
        yield pa.concat_tables(waiting).combine_chunks()


@contextmanager
def _written_beside(path: Path, *, durable: bool = False) -> Iterator[IO[bytes]]:
    """Yields a file that becomes `path` at the end if no error was raised. `durable`: the file survives a power cut.

    A part need not be durable, because it has a checksum.
    """
    beside = path.with_name(f".{path.name}{_BESIDE}")
    try:
        with _one_line(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with beside.open("wb") as file:
                yield file
                if durable:
                    file.flush()
                    os.fsync(file.fileno())
            beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """Turns an error of the operating system into a WorkFailedError that names the file and the cause."""
    try:
        yield
    except OSError as error:
        raise WorkFailedError(f"{error.filename or path}: {error.strerror or error}; what is done stays") from error
