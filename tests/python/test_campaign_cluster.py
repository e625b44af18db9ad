"""Campaigns on a real Dask scheduler with two workers; each fault of scheduler or workers gives one line."""

from __future__ import annotations

import itertools
import shutil
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import brickpilot
import campaign_parts
import campaign_program
import pytest
from brickpilot.campaign import dask_workers, workers
from brickpilot.campaign.run_parts import Part, PartProgress, run_parts
from brickpilot.errors import InputError, WorkFailedError
from dask_cluster import Cluster, Worker
from lab import real_results, real_run
from lab.peers import PEERS
from test_benchmark_real import motor_set


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with Cluster(tmp_path_factory.mktemp("dask")) as found:
        yield found


@pytest.fixture(scope="module")
def cluster(scheduler: Cluster) -> Cluster:
    scheduler.workers = [scheduler.add_worker("one"), scheduler.add_worker("two")]
    return scheduler


def results(
    address: str, function: Callable[[Any], Any], arguments: Iterable[Any], then: Callable[[], Any] = lambda: None
) -> dict[str, Any]:
    """Returns key of a part -> the cluster's result; `then` is called after the first result."""
    kept: dict[str, Any] = {}

    def keep(part: Part, result: Any) -> None:
        assert part.key not in kept
        kept[part.key] = result
        if len(kept) == 1:
            then()

    parts = (Part(str(number), argument) for number, argument in enumerate(arguments))
    progress = PartProgress(lambda *_: None, 1)
    run_parts(function, parts, keep=keep, workers=workers.Cluster(address), progress=progress)
    return kept


def refused(address: str, **more: Any) -> str:
    """Returns the one line of the error that ends a campaign."""
    with pytest.raises((InputError, WorkFailedError)) as raised:
        results(address, more.pop("function", campaign_parts.squared), more.pop("arguments", [1]), **more)
    assert "\n" not in str(raised.value)
    return str(raised.value)


@pytest.mark.parametrize("address", ["", "here", "localhost:8786", "http://localhost:8786", "tcp://:8786", "tcp://a"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    assert refused(address) == f"--scheduler {address}: needs the address of a Dask scheduler, tcp://HOST:PORT"


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert refused("tcp://localhost:1").endswith("needs the library distributed: pip install 'brickpilot[cluster]'")


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    assert dask_workers.CONNECT_S <= 5
    monkeypatch.setattr(dask_workers, "CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as other:  # accepts connections and sends nothing
        began = time.monotonic()
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        assert refused(address) == f"--scheduler {address}: no Dask scheduler answers there within 0.5 s"
    assert refused(address).endswith("no Dask scheduler answers there within 0.5 s")
    assert time.monotonic() - began < 5


def test_a_scheduler_without_workers_is_one_line(scheduler: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "WORKERS_S", 0.5)
    assert refused(scheduler.address) == (
        f"--scheduler {scheduler.address}: has no worker after 0.5 s: start one with `dask worker {scheduler.address}`"
    )


def test_a_cluster_gives_the_bytes_of_a_local_worker(cluster: Cluster, tmp_path: Path) -> None:
    campaign_program.main(tmp_path / "local", "1")
    campaign_program.main(tmp_path / "cluster", cluster.address)
    tables = [(tmp_path / place / campaign_program.TABLE).read_bytes() for place in ("local", "cluster")]
    assert tables[0] == tables[1]


def test_the_benchmark_with_measured_data_runs_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    motor_set(tmp_path / "sets")
    found = []
    for where in (workers.Here(), workers.Cluster(cluster.address)):
        kept: dict[str, Any] = {}
        work = real_run.Work(discover=False, peers=PEERS[1:2])
        path = tmp_path / "results.json"
        real_run.run([tmp_path / "sets"], {}, work, kept, path, workers=where, progress=lambda *_: None)
        assert real_results.load(path) == kept
        assert kept["bench"]["peers"][PEERS[1].name].pop("seconds") >= 0
        found.append(kept)
    assert found[0] == found[1]


def test_both_workers_work_with_one_thread_of_blas(cluster: Cluster) -> None:
    assert len(set(results(cluster.address, campaign_parts.process, range(10)).values())) == 2
    (found,) = results(cluster.address, campaign_parts.threads, [0]).values()
    assert set(found) == {1}


def test_few_parts_are_in_flight_at_a_time(cluster: Cluster) -> None:
    drawn = itertools.count()
    kept = results(cluster.address, campaign_parts.process, (next(drawn) for _ in range(3)))
    assert len(kept) == 3
    with pytest.raises(ZeroDivisionError):
        results(cluster.address, campaign_parts.process, iter(drawn.__next__, None), then=lambda: 1 // 0)
    assert next(drawn) <= 3 + 2 * 2 * 2


def test_an_error_of_the_function_comes_as_it_is(cluster: Cluster) -> None:
    with pytest.raises(ValueError, match="no such thing as 7"):
        results(cluster.address, campaign_parts.fails, [7])
    with pytest.raises(TimeoutError, match="of the function"):
        results(cluster.address, campaign_parts.too_late, [7])


def test_a_worker_that_is_killed_in_mid_run_loses_nothing(cluster: Cluster) -> None:
    kept = results(cluster.address, campaign_parts.slowly_squared, range(30), then=cluster.workers[0].kill)
    assert kept == {str(number): number * number for number in range(30)}
    cluster.workers[0] = cluster.add_worker("three")


def altered(folder: Path) -> Path:
    """Returns a folder with a copy of the package that has another version and another compiled plant."""
    package = Path(brickpilot.__file__).parent
    shutil.copytree(package, folder / "brickpilot", ignore=shutil.ignore_patterns("__pycache__"))
    init = folder / "brickpilot/__init__.py"
    init.write_text(init.read_text().replace(f'__version__ = "{brickpilot.__version__}"', '__version__ = "0.0.9"'))
    (plant,) = (folder / "brickpilot").glob("libbrickpilot_sim.*")
    plant.write_bytes(plant.read_bytes() + b"\0")
    return folder


def test_a_worker_of_another_version_is_named_before_anything_runs(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other: list[Worker] = []

    def join() -> None:
        other.append(cluster.add_worker("other", path=altered(tmp_path)))

    try:
        late = refused(cluster.address, function=campaign_parts.process, arguments=itertools.count(), then=join)
        monkeypatch.setattr(dask_workers.DaskWorkers, "submit", None)  # fails if a worker is given a part
        at_start = refused(cluster.address)
    finally:
        other[0].send_signal(signal.SIGKILL)
        other[0].wait()
    for said in (late, at_start):
        assert said.startswith(f"--scheduler {cluster.address}: worker tcp://127.0.0.1:")
        assert f"has brickpilot 0.0.9, not {brickpilot.__version__}; code " in said
        assert "; plant " in said
        assert said.endswith(": install the same package on each worker")


def test_a_part_that_ends_each_worker_is_named(cluster: Cluster) -> None:
    said = refused(cluster.address, function=campaign_parts.dies, arguments=[3])
    assert said.startswith("part 0 ended its worker 2 times, last tcp://127.0.0.1:")


def test_workers_that_are_all_gone_end_the_campaign(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "ALONE_S", 0.5)
    last = cluster.add_worker("last")
    said = refused(cluster.address, function=campaign_parts.process, arguments=range(1000), then=last.kill)
    assert said == f"{cluster.address} has had no worker for 0.5 s; the parts that are done stay"


def test_a_scheduler_that_dies_ends_the_campaign(cluster: Cluster) -> None:
    cluster.add_worker("lonely")
    said = refused(cluster.address, function=campaign_parts.process, arguments=range(1000), then=cluster.scheduler.kill)
    assert said == f"the Dask scheduler {cluster.address} is gone; the parts that are done stay"
