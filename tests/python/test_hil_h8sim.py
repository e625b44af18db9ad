"""Whole missions by the RCX's program on the simulator of its processor: the golden motor streams, bit for bit."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import make_golden
import pytest
from command import brickpilot


def fly(profile: str, sensors: str, folder: Path) -> subprocess.CompletedProcess[str]:
    options = ("--profile", profile, "--sensors", sensors, "--telemetry-every", "100", "--out", str(folder), "--json")
    return brickpilot("hil", "mission", "--target", "h8sim", *options, cwd=make_golden.GOLDEN.parent)


@pytest.fixture(scope="module")
def flights(
    tmp_path_factory: pytest.TempPathFactory,
) -> Mapping[tuple[str, str], Future[subprocess.CompletedProcess[str]]]:
    """All of them, as many at a time as there are processors: half a minute each."""
    folder = tmp_path_factory.mktemp("h8sim")
    pool = ThreadPoolExecutor(os.cpu_count())
    return {
        (profile, sensors): pool.submit(fly, profile, sensors, folder / f"{profile}-{sensors}")
        for profile, sensors in make_golden.FLIGHTS
    }


@pytest.mark.parametrize(("profile", "sensors"), make_golden.FLIGHTS)
def test_a_whole_mission_on_the_h8_gives_the_motor_stream_of_the_host(
    profile: str, sensors: str, flights: Mapping[tuple[str, str], Future[subprocess.CompletedProcess[str]]]
) -> None:
    done = flights[profile, sensors].result()
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert (figures["lost_frames"], figures["broke_off"]) == (0, None)
    assert figures["waypoints_reached"] == figures["waypoints_total"] == 8
    assert figures["steps"] == 20_000
    assert figures["motor_stream_sha256"] == make_golden.golden()[f"{profile}/{sensors}"]
