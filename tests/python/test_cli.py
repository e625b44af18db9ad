"""The command line as scripts use it: files, keys, exit statuses, and one line for each error of a user."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from bad_datasets import BAD
from brickpilot import catalogue
from brickpilot.bench import speed
from brickpilot.cli import main
from brickpilot.errors import SimulationError
from brickpilot.report import run_folder
from command import brickpilot
from lab import control_peers
from pages import assert_self_contained, figures
from test_dataset import measured

RUN_KEYS = {
    "waypoints_total", "waypoints_reached", "closest_approach_m", "reached_at_s", "position_estimate_error_m",
    "cross_track_rms_m", "heading_rms_rad", "times_real_time", "motor_stream_sha256", "steps", "profile",
    "sensors", "seed",
}  # fmt: skip


def test_run_writes_a_folder_and_prints_nothing_but_json(tmp_path: Path) -> None:
    options = ("--sensors", "imu+encoders", "--seed", "5", "--out", "out")
    done = brickpilot("run", "--json", *options, cwd=tmp_path, fresh=True)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert figures.keys() >= RUN_KEYS
    assert (figures["waypoints_reached"], figures["steps"], figures["seed"]) == (8, 20000, 5)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["log.csv", "report.html", "summary.json"]
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == figures
    log = np.genfromtxt(tmp_path / "out" / "log.csv", delimiter=",", names=True)
    assert len(log) == figures["steps"]
    assert log["time_s"][-1] == pytest.approx(59.997)


def test_the_page_of_a_run_is_self_contained(tmp_path: Path) -> None:
    brickpilot("run", "--out", "out", cwd=tmp_path)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "8 of 8 waypoints reached in order" in page
    assert len(figures(page)) == 4
    assert_self_contained(page)


def test_the_track_of_a_page_ends_when_the_robot_has_come_to_rest(tmp_path: Path) -> None:
    brickpilot("run", "--sensors", "imu+encoders", "--out", "out", cwd=tmp_path)
    track, motion, *_ = figures((tmp_path / "out" / "report.html").read_text()).values()
    assert 36.3 < track["time"][-1] < 39.0 < 60.0  # s; the last waypoint is reached at 36.3, the scenario ends at 60
    assert [one["name"] for one in track["lines"]] == ["true track", "estimated track", "legs"]
    assert len(track["time"]) == len(track["heading"]) == len(track["lines"][0]["x"]) == len(track["lines"][1]["y"])
    assert [one["reached"] for one in track["circles"]] == [True] * 8
    end = [track["lines"][0][axis][-1] for axis in "yx"]
    assert np.hypot(*(np.array(end) - [track["circles"][7][axis] for axis in "yx"])) < 0.1
    assert motion["x"]["values"][-1] == track["time"][-1]
    assert motion["link"] == track["link"] == "run"


def test_the_same_run_gives_the_same_page(tmp_path: Path) -> None:
    pages = []
    for out in ("one", "two"):
        brickpilot("run", "fig5", "--sensors", "imu", "--out", out, cwd=tmp_path)
        pages.append((tmp_path / out / "report.html").read_bytes())
    assert pages[0] == pages[1]


def test_the_same_command_gives_the_same_bytes_and_replaces_its_own_folder(tmp_path: Path) -> None:
    logs = []
    for _ in range(2):
        assert brickpilot("run", "fig5", "--sensors", "imu", cwd=tmp_path, fresh=True).returncode == 0
        logs.append((tmp_path / "runs" / "fig5-coupled-imu" / "log.csv").read_bytes())
    assert logs[0] == logs[1]
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["fig5-coupled-imu"]


@pytest.mark.parametrize("name", ["mission", "fig4", "fig5", "forward_1m", "spin_one_motor"])
@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_every_packaged_scenario_runs_in_both_profiles(name: str, profile: str, tmp_path: Path) -> None:
    assert main.main(["run", name, "--profile", profile, "--out", str(tmp_path / "out")]) is None
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000


def test_a_folder_with_other_files_is_refused_and_unchanged(tmp_path: Path) -> None:
    assert brickpilot("run", "fig4", "--out", "out", cwd=tmp_path).returncode == 0
    (tmp_path / "out" / "thesis.txt").write_text("all of it\n")
    done = brickpilot("run", "fig4", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "thesis.txt" in done.stderr
    assert (tmp_path / "out" / "thesis.txt").read_text() == "all of it\n"


@pytest.mark.parametrize("trouble", [SimulationError("m: the state diverged"), OSError(28, "No space left on device")])
def test_a_failure_during_the_run_is_one_line_and_status_1(
    trouble: Exception, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise trouble

    monkeypatch.setattr(run_folder, "write_log", fail)
    with pytest.raises(SystemExit) as ended:
        main.main(["run", "fig4", "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    assert (ended.value.code, said.out, said.err.count("\n")) == (1, "", 1)
    assert list(tmp_path.iterdir()) == []


def test_a_mission_of_one_step_has_a_page_too(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('name = "s"\nkind = "mission"\nduration_s = 0.003\nwaypoints_m = [[0, 0]]\n')
    done = brickpilot("run", "s.toml", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["cruise_m_s"] == 0.4  # the firmware's preset, as the scenario gives none
    page = (tmp_path / "out" / "report.html").read_text()
    assert "brickpilot run s.toml --profile coupled --sensors ideal --seed 0" in page


def test_the_motor_stream_is_hashed_little_endian_left_before_right(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "manoeuvre"\nduration_s = 0.006\nsegments = [{ from_s = 0, left_V = 9, right_V = -4.5 }]\n'
    )
    done = brickpilot("run", "s.toml", "--json", cwd=tmp_path)
    pair = (32767).to_bytes(2, "little", signed=True) + (-16384).to_bytes(2, "little", signed=True)
    assert json.loads(done.stdout)["motor_stream_sha256"] == hashlib.sha256(2 * pair).hexdigest()


def test_without_a_command_the_help_is_shown(tmp_path: Path) -> None:
    done = brickpilot(cwd=tmp_path)
    assert done.returncode == 2
    assert "calibrate" in done.stdout
    assert done.stderr == ""


def test_a_scenario_file_may_change_plant_and_effects(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "heavy"\nkind = "manoeuvre"\nduration_s = 3\nsegments = [{ from_s = 0, left_V = 0.5, right_V = 0.5 }]\n'
        "[parameters]\nmass = 1.2\n[effects.coulomb_friction]\ntorque = 0.006\n"
    )
    done = brickpilot("run", "--scenario", "s.toml", "--json", cwd=tmp_path)
    assert json.loads(done.stdout)["final_speed_m_s"] == 0.0  # 0.5 V gives 4.4 mN m: less than the friction holds


def test_effects_lists_the_table_of_the_plant(capsys: pytest.CaptureFixture[str]) -> None:
    main.main(["effects"])
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == [effect.name for effect in catalogue.effects()]
    assert all(effect.summary in line for effect, line in zip(catalogue.effects(), listed, strict=True))
    main.main(["effects", "--long"])
    listed = capsys.readouterr().out
    assert all(effect.name in listed and effect.equation in listed for effect in catalogue.effects())
    assert all(f"prior: {effect.prior}. {effect.prior_reason}" in listed for effect in catalogue.effects())
    main.main(["effects", "stiction_stribeck"])
    assert "\n  contains: coulomb_friction\n" in capsys.readouterr().out
    main.main(["effects", "actuator_deadband", "--json"])
    assert list(json.loads(capsys.readouterr().out)) == ["actuator_deadband"]


def test_bench_reports_values_beside_a_peer(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The control law's costs are made up here; tests/gates/test_control_peers.py measures the costs on a brick."""

    def costs(brick: str) -> dict[str, control_peers.LawCost]:
        cycles = {"ours": 100, "q16": 300, "float": 200}
        return {name: control_peers.LawCost(np.array([one]), one, np.zeros((1, 2))) for name, one in cycles.items()}

    figures_of = {**control_peers.figures("h8", costs("h8")), **control_peers.figures("avr", costs("avr"))}
    monkeypatch.setattr(speed, "control_law", lambda: (figures_of, []))
    main.main(["bench", "--json"])
    figures = json.loads(capsys.readouterr().out)
    host = {"full_loop", "plant", "plant_lanes", "plant_lanes_dry", "lockstep_pty", "full_loop_scipy", "plant_scipy"}
    laws = {f"control_{brick}_{peer}" for brick in ("h8", "avr") for peer in ("q16", "float")}
    assert figures.keys() == host | laws
    assert figures["lockstep_pty"]["value"] > 2000  # steps/s, the least that the design states
    for name, figure in figures.items():
        assert {"value", "unit", "peer", "ratio", "machine"} <= figure.keys()
        assert figure["value"] > 0
        assert figure["ratio"] > 1, name
    assert [figures[f"control_avr_{peer}"]["ratio"] for peer in ("q16", "float")] == [3.0, 2.0]


def test_compare_calibrate_and_import_work_together(tmp_path: Path) -> None:
    rows = ["t;u;w"]
    speed = 0.0
    for k in range(600):
        volts = 6.0 if k % 200 < 120 else 0.0
        rows.append(f"{k * 5};{volts};{speed:.6f}")
        speed += 0.005 * (20.0 * volts - 4.0 * speed)
    (tmp_path / "log.txt").write_text("\n".join(rows) + "\n")
    arguments = [
        "--header",
        "--delimiter",
        ";",
        "--map",
        "time=t:ms",
        "--map",
        "voltage=u",
        "--map",
        "speed=w",
        "--vehicle",
        "motor",
    ]
    arguments += ["--nominal", "wheel_inertia=1e-4", "--out", "bench"]
    done = brickpilot("import", "table", "log.txt", *arguments, cwd=tmp_path, fresh=True)
    assert (done.returncode, done.stderr) == (0, "")
    done = brickpilot("calibrate", "bench", "--json", "--out", "fit", cwd=tmp_path, fresh=True)
    assert done.returncode == 0, done.stderr
    assert all(
        entry.keys() >= {"value", "unit", "ci95", "identifiable"}
        for entry in json.loads(done.stdout)["parameters"].values()
    )
    options = ("--model", "fit/model.toml", "--json", "--out", "compared")
    done = brickpilot("compare", "bench", *options, cwd=tmp_path, fresh=True)
    (run,) = json.loads(done.stdout)["runs"]
    assert run["signals"]["speed"].keys() == {"ils", "ils_normalised", "rms_error", "rms_signal"}
    assert run["signals"]["speed"]["rms_error"] < 0.02 * run["signals"]["speed"]["rms_signal"]
    assert sorted(path.name for path in (tmp_path / "compared").iterdir()) == ["compare.json", "report.html"]
    assert sorted(path.name for path in (tmp_path / "fit").iterdir()) == ["calibrate.json", "model.toml", "report.html"]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.name)
def test_a_bad_data_set_is_refused_in_one_line_that_names_the_place(
    bad, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bad.write(tmp_path / "set")
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(SystemExit) as ended:
        main.main(["compare", str(tmp_path / "set")])
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith(f"brickpilot: {bad.place(tmp_path / 'set')}")
    assert sorted(tmp_path.rglob("*")) == before


def test_the_importer_reads_both_logs_of_a_real_drivetrain(tmp_path: Path) -> None:
    logs = measured("frc_drivetrain")
    done = brickpilot(
        "import", "wpilib", *map(str, sorted(logs.glob("*.json"))), "--out", "frc", "--json", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["runs"]) == 10
