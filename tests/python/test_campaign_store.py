"""The folder of a campaign holds a part as a whole or not at all; the bytes of the table depend on the rows alone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import campaign_parts
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from brickpilot.campaign import store
from brickpilot.campaign.store import Parts
from brickpilot.errors import InputError, WorkFailedError

KEYS = [f"p{seed:02}" for seed in range(6)]


def filled(folder: Path, order: list[int]) -> Parts:
    """Returns an open folder with the parts of these seeds, written in this order."""
    parts = Parts(folder, {"seed": 1}).__enter__()
    for seed in order:
        parts.write(KEYS[seed], campaign_parts.table(seed))
    return parts


def merged(folder: Path, order: list[int]) -> bytes:
    parts = filled(folder, order)
    parts.merge(KEYS, folder / "results.parquet")
    parts.__exit__(None, None, None)
    return (folder / "results.parquet").read_bytes()


def one_line(refused: pytest.ExceptionInfo[Exception]) -> str:
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_the_merged_bytes_do_not_depend_on_the_order_of_arrival(tmp_path: Path) -> None:
    first = merged(tmp_path / "one", [0, 1, 2, 3, 4, 5])
    assert first == merged(tmp_path / "two", [3, 5, 0, 4, 1, 2])
    assert pq.read_table(tmp_path / "one/results.parquet") == pa.concat_tables(map(campaign_parts.table, range(6)))


def test_row_groups_are_bounded_and_do_not_depend_on_the_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "ROWS", 30)
    assert merged(tmp_path / "one", [0, 1, 2, 3, 4, 5]) == merged(tmp_path / "two", [5, 4, 3, 2, 1, 0])
    groups = pq.read_metadata(tmp_path / "one/results.parquet")
    assert [groups.row_group(one).num_rows for one in range(groups.num_row_groups)] == [40, 40, 40]


def test_parts_are_there_when_the_folder_is_opened_again(tmp_path: Path) -> None:
    filled(tmp_path, [0, 2]).__exit__(None, None, None)
    with Parts(tmp_path, {"seed": 1}) as parts:
        assert parts.done() == {"p00", "p02"}


@pytest.mark.parametrize("damage", ["cut", "zeros", "one_bit", "empty"])
def test_a_damaged_part_is_found_and_can_be_made_again(tmp_path: Path, damage: str) -> None:
    filled(tmp_path, [0, 1]).__exit__(None, None, None)
    (path,) = (tmp_path / "parts").glob("p01.*")
    data = path.read_bytes()
    middle = len(data) // 2
    path.write_bytes(
        {
            "cut": data[:-1],
            "zeros": data[:middle] + bytes(len(data) - middle),
            "one_bit": data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :],
            "empty": b"",
        }[damage]
    )
    with Parts(tmp_path, {"seed": 1}) as parts:
        assert parts.done() == {"p00"}
        assert not path.exists()
        parts.write("p01", campaign_parts.table(1))
    assert path.read_bytes() == data


def test_what_a_killed_process_was_writing_is_removed(tmp_path: Path) -> None:
    filled(tmp_path, [0]).__exit__(None, None, None)
    for unfinished in ("parts/.p01.00000000.parquet.unfinished", ".results.parquet.unfinished"):
        (tmp_path / unfinished).write_bytes(b"PAR1")
    with Parts(tmp_path, {"seed": 1}) as parts:
        assert parts.done() == {"p00"}
    assert list(tmp_path.rglob("*.unfinished")) == []


def test_a_part_that_is_damaged_before_the_merge_or_missing_leaves_the_old_table(tmp_path: Path) -> None:
    old = merged(tmp_path, [0, 1, 2, 3, 4, 5])
    with Parts(tmp_path, {"seed": 1}) as parts:
        with pytest.raises(WorkFailedError) as refused:
            parts.merge([*KEYS, "p99"], tmp_path / "results.parquet")
        assert one_line(refused).endswith("part p99 is missing")
        (path,) = (tmp_path / "parts").glob("p03.*")
        path.write_bytes(b"")
        with pytest.raises(WorkFailedError) as refused:
            parts.merge(KEYS, tmp_path / "results.parquet")
        assert "was damaged after it was written" in one_line(refused)
    assert (tmp_path / "results.parquet").read_bytes() == old
    assert list(tmp_path.rglob("*.unfinished")) == []


def test_parts_of_other_columns_are_refused(tmp_path: Path) -> None:
    with Parts(tmp_path, {}) as parts:
        parts.write("a", pa.table({"x": [1]}))
        parts.write("b", pa.table({"x": [1.0]}))
        with pytest.raises(WorkFailedError) as refused:
            parts.merge(["a", "b"], tmp_path / "results.parquet")
    assert "part b has other columns" in one_line(refused)


def test_two_campaigns_do_not_write_in_one_folder(tmp_path: Path) -> None:
    with Parts(tmp_path, {"seed": 1}):
        with pytest.raises(InputError) as refused, Parts(tmp_path, {"seed": 1}):
            pass
        assert one_line(refused) == f"{tmp_path}: another campaign is writing here: wait for it, or name another folder"
    with Parts(tmp_path, {"seed": 1}):
        pass


def test_another_campaign_is_refused(tmp_path: Path) -> None:
    filled(tmp_path, [0]).__exit__(None, None, None)
    with pytest.raises(InputError) as refused, Parts(tmp_path, {"seed": 2}):
        pass
    assert one_line(refused) == f"{tmp_path}: holds another campaign: name another folder, or remove this one"


def test_another_version_of_the_program_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    filled(tmp_path, [0]).__exit__(None, None, None)
    file = tmp_path / "campaign.json"
    file.write_text(file.read_text().replace(store.versions_here().plant, "0123456789ab"))
    with pytest.raises(InputError) as refused, Parts(tmp_path, {"seed": 1}):
        pass
    assert f"was begun with plant 0123456789ab, not {store.versions_here().plant}" in one_line(refused)
    file.write_text("{}")
    with pytest.raises(InputError) as refused, Parts(tmp_path, {"seed": 1}):
        pass
    assert "is not a file that a campaign wrote" in one_line(refused)


@pytest.mark.parametrize("key", ["", "a/b", "a.b", "..", "ä", "x" * 101])
def test_a_key_is_a_files_name(tmp_path: Path, key: str) -> None:
    with Parts(tmp_path, {}) as parts, pytest.raises(ValueError, match="is no key"):
        parts.write(key, campaign_parts.table(0))


FULL = """
import resource, signal, sys
from pathlib import Path
import campaign_parts
from brickpilot.campaign.store import Parts
from brickpilot.errors import WorkFailedError
folder, limit = Path(sys.argv[1]), int(sys.argv[2])
with Parts(folder, {}) as parts:
    parts.write("a", campaign_parts.table(0))
    if limit:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    else:
        with open(folder / "filler", "wb", buffering=0) as filler:
            try:
                while True:
                    filler.write(bytes(1024))
            except OSError:
                pass
    for work in (lambda: parts.write("b", campaign_parts.table(1)), lambda: parts.merge(["a"], folder / "all")):
        try:
            work()
        except WorkFailedError as error:
            print(error)
    print(sorted(parts.done()))
"""


def filling(folder: Path, limit: int) -> list[str]:
    """Returns the lines of a process that writes a part, runs out of space, and then tries to write and to merge."""
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(folder), str(limit)],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
    )  # fmt: skip
    assert {path.name.split(".")[0] for path in (folder / "parts").iterdir()} == {"a"}
    assert not (folder / "all").exists()
    assert list(folder.rglob("*.unfinished")) == []
    return done.stdout.splitlines()


def test_a_file_that_may_not_grow_gives_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    part, merging, there = filling(tmp_path, 600)
    assert part.startswith(f"{tmp_path}/parts/b.")
    assert part.endswith(".parquet: File too large; what is done stays")
    assert merging == f"{tmp_path}/all: File too large; what is done stays"
    assert there == "['a']"


def test_a_full_disk_gives_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "brickpilot-test", str(tmp_path)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here: needs root")
    try:
        part, merging, there = filling(tmp_path, 0)
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)
    assert part.endswith(".parquet: No space left on device; what is done stays")
    assert merging == f"{tmp_path}/all: No space left on device; what is done stays"
    assert there == "['a']"
