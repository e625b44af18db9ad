"""The example files for clusters make the jobs that the guide to campaigns shows."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

TOOLS = Path(__file__).parents[2] / "tools"
PAGE = TOOLS / "docs/guides/campaign.md"
EXAMPLES = TOOLS / "examples/cluster"


def loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_job_of_slurm_is_the_one_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slurm = loaded(EXAMPLES / "slurm.py")
    monkeypatch.chdir(tmp_path)  # dask-jobqueue makes the folder of the logs
    with slurm.SLURMCluster(**slurm.JOB) as cluster:
        script = cluster.job_script().strip()
        script = script.replace(sys.executable, "PYTHON").replace(cluster.scheduler_address, "SCHEDULER")
    (shown,) = re.findall(r"```text\n(#!/usr/bin/env bash\n.*?)\n```", PAGE.read_text(), re.DOTALL)
    assert re.sub(r" +$", "", script, flags=re.MULTILINE) == shown


def test_the_command_gets_the_schedulers_address_and_its_status_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slurm = loaded(EXAMPLES / "slurm.py")
    asked: list[Any] = []

    class Cluster:
        scheduler_address = "tcp://node:1"

        def __init__(self, **job: Any) -> None:
            asked.append(job)

        def __enter__(self) -> Cluster:
            return self

        def __exit__(self, *_: object) -> None:
            asked.append("closed")

        def scale(self, *, jobs: int) -> None:
            asked.append(jobs)

    monkeypatch.setattr(slurm, "SLURMCluster", Cluster)
    command = [
        sys.executable,
        "-c",
        "import sys; exit(3 if sys.argv[1:] == ['--scheduler', 'tcp://node:1'] else 4)",
    ]
    assert slurm.main(7, command) == 3
    assert asked == [slurm.JOB, 7, "closed"]


def test_the_job_of_kubernetes_uses_one_image_and_names_that_agree() -> None:
    job = yaml.safe_load((EXAMPLES / "kubernetes.yaml").read_text())
    assert job["kind"] == "DaskJob"
    runner, cluster = job["spec"]["job"]["spec"], job["spec"]["cluster"]["spec"]
    pods = [runner, cluster["worker"]["spec"], cluster["scheduler"]["spec"]]
    assert {one["image"] for pod in pods for one in pod["containers"]} == {"REGISTRY/brickpilot"}
    assert cluster["scheduler"]["service"]["selector"]["dask.org/cluster-name"] == job["metadata"]["name"]
    opened = {port["name"]: port["containerPort"] for port in cluster["scheduler"]["spec"]["containers"][0]["ports"]}
    served = {port["targetPort"]: port["port"] for port in cluster["scheduler"]["service"]["ports"]}
    assert opened == served == {"tcp-comm": 8786, "http-dashboard": 8787}
    mounts = {mount["name"] for mount in runner["containers"][0]["volumeMounts"]}
    assert mounts == {volume["name"] for volume in runner["volumes"]}
    assert f"{job['metadata']['name']}-runner" in PAGE.read_text()
