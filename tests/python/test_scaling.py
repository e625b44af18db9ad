"""`brickpilot bench --scaling` measures how time grows with the amount of work."""

from __future__ import annotations

import json
import re
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from brickpilot.bench import speed
from brickpilot.cli import bench, main
from brickpilot.cli.main import run_to_exit
from lab import scaling, scaling_page
from lab_results import scaling_results


def quiet(*_: object) -> None:
    pass


def busy(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


@pytest.mark.parametrize(
    ("exponent", "verdict"), [(1.0, "linear"), (2.0, "more than linear"), (0.5, "less than linear")]
)
def test_a_power_law_is_found_again(exponent: float, verdict: str) -> None:
    sizes = np.array([10, 20, 40, 80, 160])
    noise = np.random.default_rng(3).normal(1.0, 0.02, (5, 3))
    found = scaling.fit(sizes.tolist(), (1e-3 * sizes[:, np.newaxis] ** exponent * noise).tolist())
    assert found.low <= exponent <= found.high
    assert found.high - found.low < 0.2
    assert found.verdict == verdict


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.92, 0.98, "linear"),
        (0.72, 1.28, "linear"),
        (0.45, 1.02, "not determined"),
        (0.98, 1.55, "not determined"),
        (0.45, 0.98, "less than linear"),
    ],
)
def test_an_interval_that_holds_a_root_or_nearly_a_square_is_not_linear(low: float, high: float, verdict: str) -> None:
    assert scaling.PowerLaw((low + high) / 2, low, high, 1.0).verdict == verdict


def test_scattered_times_determine_no_growth() -> None:
    assert scaling.fit((1, 2, 4, 8), [[1.0], [5.0], [2.0], [9.0]]).verdict == "not determined"


def test_an_interval_holds_the_exponent_as_often_as_it_says() -> None:
    random, sizes = np.random.default_rng(5), np.array([1, 2, 4, 8, 16])
    fits = [scaling.fit(sizes.tolist(), (sizes * random.lognormal(0, 0.1, 5))[:, np.newaxis]) for _ in range(400)]
    assert np.mean([one.low <= 1.0 <= one.high for one in fits]) == pytest.approx(0.95, abs=0.035)


def test_work_that_grows_with_the_square_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scaling, "_campaign", lambda *_: scaling_results().sweeps[0])
    monkeypatch.setattr(scaling, "_crowd", lambda *_: scaling_results().crowd)
    sizes = (5, 10, 20)
    planted = [
        scaling.Sweep("line", "", "runs", sizes, lambda size: lambda: busy(2e-3 * size + 0.01), repeats=2),
        scaling.Sweep("square", "", "runs", sizes, lambda size: lambda: busy(2e-4 * size**2 + 0.01), repeats=2),
    ]
    found = {one.name: one.law for one in scaling.measure(quiet, planted).sweeps}
    assert found["line"].exponent == pytest.approx(1.0, abs=0.1)
    assert found["square"].exponent > 1.8
    assert found["square"].verdict == "more than linear"


def test_every_kind_of_work_runs_and_has_its_row_on_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "cores", lambda: 1)  # so at most two workers are measured: they start slowly
    monkeypatch.setattr(scaling, "_campaign", lambda *_: scaling_results().sweeps[0])
    small = {"simulate_runs": (8, 16, 32), "discover_candidates": (2, 4, 8)}
    chosen = [
        scaling.Sweep(one.name, one.what, one.unit, small.get(one.name, (200, 400, 600)), one.work, 0, 1)
        for one in scaling.sweeps()
        if one.name != "discover_whole_samples"
    ]
    found = scaling.measure(quiet, chosen, crowd_flights=4, repeats=1)
    assert {one.name for one in found.sweeps} == {one.name for one in chosen} | {"linear"}
    assert all(min(min(row) for row in one.seconds) > 0 for one in found.sweeps)
    assert found.crowd.workers == (1, 2)
    assert min(min(rates) for rates in found.crowd.flights_per_s) > 0
    html = scaling_page.page(scaling.as_dict(found), "brickpilot bench --scaling")
    assert all(one.what.partition(":")[0] in html for one in chosen)
    assert html.count('class="plot') == len(found.sweeps) + 1


def in_this_process(module: str, *arguments: str, field: str) -> subprocess.CompletedProcess[bytes]:
    """Runs `scaling_page` in this process. It replaces `checkout.in_lab`, which starts a process."""
    assert (module, field) == ("scaling_page", "--scaling")
    run_to_exit(scaling_page.measure_scaling, list(arguments), "brickpilot")
    return subprocess.CompletedProcess(module, 0)


def command(*arguments: str) -> None:
    """Runs `brickpilot ARGUMENTS` in this process, and checks that it ends with status 0."""
    with pytest.raises(SystemExit) as ended:
        main.main(list(arguments))
    assert ended.value.code == 0


def test_the_command_writes_page_and_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(scaling, "measure", lambda progress: scaling_results())
    monkeypatch.setattr(bench, "in_lab", in_this_process)
    command("bench", "--scaling", "--out", str(tmp_path / "out"))
    printed = capsys.readouterr().out
    assert re.search(r"8.0 times as long for  8.0 times the runs: linear, exponent 1.00", printed)
    assert re.search(r"64.0 times as long for  8.0 times the runs: more than linear, exponent 2.00", printed)
    kept = json.loads((tmp_path / "out/scaling.json").read_text())
    assert kept["sweeps"]["linear"]["exponent"]["value"] == pytest.approx(1.0)
    assert kept["workers"]["gain"] == pytest.approx([1.0, 20 / 11, 18 / 11])
    assert "1 of 2 kinds of work grow linearly" in (tmp_path / "out/report.html").read_text()
    command("bench", "--scaling", "--out", str(tmp_path / "out"), "--json")
    assert json.loads(capsys.readouterr().out) == kept


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--out", "x"], "--out: works only with --scaling"),
        (["--scaling", "--target", "h8"], "--scaling: works only without --target"),
        (["--scaling", "--seconds", "3"], "--seconds: works only with --target h8 or avr"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main.main(["bench", *arguments])
    assert ended.value.code == 2
    assert told in capsys.readouterr().err
