"""`brickpilot campaign` gives the same runs with any workers, replays each run, and refuses a bad file in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from brickpilot.campaign import runs
from brickpilot.report import campaign_page
from command import brickpilot
from conducted import conducted

SHORT = """name = "short"
kind = "mission"
duration_s = 4
waypoints_m = [[0.3, 0], [0.5, 0.2]]
"""
OTHER = SHORT.replace("short", "other").replace("[0.5, 0.2]", "[0.5, -0.2]")
CAMPAIGN = """[campaign]
name = "trial"
runs = 42
seed = 7
scenario = ["short.toml", "other.toml"]
sensors = "imu+encoders"

[vary]
parameter.mass = { distribution = "normal", mean = 0.9, sd = 0.05 }
effect.coulomb_friction.chance = 0.5
effect.coulomb_friction.torque = { distribution = "uniform", low = 0.001, high = 0.06 }
sensor.gyro_noise_sd = [0.01, 0.02]
gain.heading_kp = { distribution = "uniform", low = 8, high = 16 }
start.heading_deg = { distribution = "normal", mean = 0, sd = 3 }
"""
LINKED = """[campaign]
name = "linked"
runs = 6
seed = 3
scenario = "short.toml"
sensors = "imu+encoders"

[[faults]]
kind = "drop"
from_s = 1.5
to_s = { distribution = "uniform", low = 2, high = 3 }
rate = { distribution = "loguniform", low = 1e-3, high = 3e-2 }
chance = 0.5

[[faults]]
kind = "disconnect"
from_s = 1.8
chance = 0.4
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN), ("linked", LINKED)):
        (tmp_path / f"{name}.toml").write_text(text)
    return tmp_path


def flown(folder: Path, *arguments: str) -> dict[str, Any]:
    done = brickpilot("campaign", *arguments, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def here(folder: Path, name: str, count: int | None = None) -> dict[str, Any]:
    return conducted(folder / name, folder / "found", count)


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in ("runs.parquet", "summary.json", "report.html")}


def test_one_worker_or_two_stopped_or_not_give_the_same_bytes(folder: Path) -> None:
    found = flown(folder, "trial.toml", "--jobs", "1", "--out", "one")
    flown(folder, "trial.toml", "--jobs", "2", "--out", "two")
    assert contents(folder / "one") == contents(folder / "two")
    parts = sorted((folder / "two" / "parts").iterdir())
    assert len(parts) == 14  # parts of 3 runs
    for name in ("runs.parquet", "summary.json", "report.html"):
        (folder / "two" / name).unlink()
    for path in parts[3:9]:
        path.unlink()
    kept = {path: path.stat().st_mtime_ns for path in (folder / "two" / "parts").iterdir()}
    flown(folder, "trial.toml", "--out", "two")
    assert contents(folder / "one") == contents(folder / "two")
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())  # nothing was flown twice
    table = pq.read_table(folder / "one" / "runs.parquet").to_pandas()
    assert table["run"].tolist() == list(range(42))
    assert found["success"] == {**found["success"], "count": int(table["success"].sum()), "of": 42}
    assert sum(found["causes"].values()) == 42 - table["success"].sum() > 0
    assert set(table["scenario"]) == {"short", "other"}
    assert table["effect.coulomb_friction.torque"].isna().equals(~table["effect.coulomb_friction.on"])
    assert table["motor_stream_sha256"].nunique() == table["seed"].nunique() == 42


def test_a_replay_has_the_motor_stream_of_the_table(folder: Path) -> None:
    worst = here(folder, "trial.toml")["worst"][0]
    assert not worst["success"]
    again = brickpilot("campaign", "trial.toml", "--replay", str(worst["run"]), "--out", "again", "--json", cwd=folder)
    assert again.returncode == 1
    assert again.stderr.startswith(f"brickpilot: run {worst['run']} of trial: ")
    figures = json.loads(again.stdout)
    assert figures["motor_stream_sha256"] == worst["motor_stream_sha256"]
    row = pq.read_table(folder / "found" / "runs.parquet").slice(worst["run"], 1).to_pylist()[0]
    assert figures["cross_track_rms_m"] == row["cross_track_rms_m"]
    assert figures["inputs"]["gain.heading_kp"] == row["gain.heading_kp"]
    assert {path.name for path in (folder / "again").iterdir()} == {"log.csv", "summary.json", "report.html"}
    assert f"brickpilot campaign trial.toml --replay {worst['run']}" in (folder / "found" / "report.html").read_text()


def test_a_run_with_faults_of_its_link_is_replayed_too(folder: Path) -> None:
    found = here(folder, "linked.toml")
    assert found["causes"].get("the link was lost", 0) > 0
    assert set(found["by_choice"]) == {"fault.drop.on", "fault.disconnect.on"}
    table = pq.read_table(folder / "found" / "runs.parquet").to_pandas()
    assert table["fault.drop.rate"].isna().equals(~table["fault.drop.on"])
    index = int(table.index[table["fault.drop.on"] & ~table["fault.disconnect.on"]][0])
    again = brickpilot("campaign", "linked.toml", "--replay", str(index), "--out", "again", "--json", cwd=folder)
    figures = json.loads(again.stdout)
    assert figures["motor_stream_sha256"] == table["motor_stream_sha256"][index]
    assert figures["lost_frames"] > 0
    assert (folder / "again" / "ticks.csv").is_file()


def test_a_grid_flies_every_pair_and_shows_the_rate_of_each_value(folder: Path) -> None:
    text = CAMPAIGN.replace("runs = 42", 'design = "grid"\nrepeats = 2').replace(
        '["short.toml", "other.toml"]', '"short.toml"'
    )
    (folder / "grid.toml").write_text(text + "effect.yaw_scrub.moment = [0.0, 0.01, 0.02]\n")
    found = here(folder, "grid.toml")
    table = pq.read_table(folder / "found" / "runs.parquet").to_pandas()
    assert found["runs"] == 12
    assert (table.groupby(["sensor.gyro_noise_sd", "effect.yaw_scrub.moment"]).size() == 2).all()
    assert table["parameter.mass"].nunique() == 12
    assert {value["of"] for value in found["by_choice"]["effect.yaw_scrub.moment"].values()} == {4}
    assert found["sensitivity"] is None


@pytest.mark.parametrize(("design", "seed"), [("saltelli", 0), ("morris", 2**40)])
def test_the_intervals_of_indices_depend_on_the_seed_alone(design: str, seed: int, folder: Path) -> None:
    size = "samples = 8" if design == "saltelli" else "trajectories = 8"
    text = CAMPAIGN.replace("runs = 42", f'design = "{design}"\n{size}').replace("seed = 7", f"seed = {seed}")
    head, _, varied = text.partition("[vary]\n")
    (folder / "own.toml").write_text(head.replace(', "other.toml"', "") + "[vary]\n" + varied.partition("\n")[0] + "\n")
    found = conducted(folder / "own.toml", folder / "one")
    conducted(folder / "own.toml", folder / "two")
    flown(folder, "own.toml", "--out", "three")
    assert all(contents(folder / name) == contents(folder / "one") for name in ("two", "three"))
    [index] = found["sensitivity"]["figures"]["cross_track_rms_m"]
    assert index["ci95"][0] < index["index"] < index["ci95"][1]


def test_routes_are_drawn_in_their_box(folder: Path) -> None:
    box = "[route]\nwaypoints = 3\nx_m = [-1, 1]\ny_m = [0, 0.8]\nleast_leg_m = 0.4\nduration_s = 0.3\n"
    (folder / "routes.toml").write_text('[campaign]\nname = "routes"\nruns = 30\n' + box)
    here(folder, "routes.toml")
    table = pq.read_table(folder / "found" / "runs.parquet").to_pandas()
    assert table["route.waypoints_m"].nunique() == 30
    for text, length in zip(table["route.waypoints_m"], table["route.length_m"], strict=True):
        points = [complex(*map(float, one.split())) for one in text.split("; ")]
        legs = [abs(to - start) for start, to in zip([0j, *points], points, strict=False)]
        assert min(legs) >= 0.4
        assert sum(legs) == pytest.approx(length)
        assert all(-1 <= one.real <= 1 and 0 <= one.imag <= 0.8 for one in points)


def test_the_page_has_words_for_every_figure() -> None:
    numbers = runs.UNITS.keys() - set(runs.WORDS) - {"waypoints_total", "seed"}
    assert campaign_page.WORDS.keys() == numbers


BASE = '[campaign]\nname = "bad"\nruns = 4\nscenario = "short.toml"\n'
BAD = {
    BASE + "speed = 1\n": "bad.toml:5: campaign.speed: unknown key; known: ",
    BASE.replace("runs = 4", 'design = "annealed"'): "bad.toml:3: campaign.design: 'annealed' is not one of",
    BASE + "seed = 1.5\n": "bad.toml:5: campaign.seed: 1.5 is not a whole number",
    BASE + 'model = "motor.toml"\n': "bad.toml:5: campaign.model: is a motor, but a campaign flies a diff_drive",
    BASE + "repeats = 3\n": "bad.toml:5: campaign.repeats: does not belong to monte_carlo, which takes runs",
    BASE + "[vary]\nwheel.mass = 3\n": "bad.toml:6: vary.wheel: unknown key; known: effect, gain, parameter",
    BASE + "[vary]\nparameter.weight = 3\n": "bad.toml:6: vary.parameter.weight: unknown key; known: ",
    BASE + "[vary]\neffect.magic.size = 3\n": "bad.toml:6: vary.effect.magic: unknown key; known: ",
    BASE + "[vary]\neffect.yaw_scrub.size = 3\n": "bad.toml:6: vary.effect.yaw_scrub.size: unknown key; known: ",
    BASE + '[vary]\nparameter.mass = { distribution = "cauchy" }\n': "vary.parameter.mass.distribution: 'cauchy' is",
    BASE + "[vary]\nparameter.mass = { mean = 1 }\n": "vary.parameter.mass.distribution: is missing: uniform",
    BASE + '[vary]\nparameter.mass = { distribution = "normal", mean = 1 }\n': "6: vary.parameter.mass.sd: is missing",
    BASE + '[vary]\nparameter.mass = { distribution = "uniform", low = -1, high = 1 }\n':
        "bad.toml:6: vary.parameter.mass.low: -1 is outside 0.001..100000 kg",
    BASE + '[vary]\nparameter.mass = { distribution = "uniform", low = 2, high = 1 }\n': "low = 2 is not below high",
    BASE + '[vary]\nparameter.mass = { distribution = "normal", mean = -9, sd = 1 }\n':
        "bad.toml:6: vary.parameter.mass: less than 1% of it lies within 0.001..100000 kg",
    BASE + "[vary]\ngain.heading_kp = []\n": "bad.toml:6: vary.gain.heading_kp: needs a list of one value or more",
    BASE + "[vary]\nsensor.bits = 8\n": "bad.toml:6: vary.sensor: ideal sensors have no noise",
    BASE.replace("runs = 4", 'design = "grid"') + "[vary]\nparameter.mass = 1\n": "bad.toml:5: vary: a grid needs a",
    BASE.replace("runs = 4", 'design = "grid"\nrepeats = 600000') + "[vary]\nparameter.mass = [0.8, 0.9]\n":
        "bad.toml:6: vary: would be 1200000 runs, more than 1000000",
    BASE.replace("runs = 4", 'design = "sobol"\nruns = 100') + '[vary]\nparameter.mass = [0.8, 0.9]\n':
        "bad.toml:4: campaign.runs: 100 is not a power of two, as sobol needs; 64 and 128 are",
    BASE.replace("runs = 4", 'design = "morris"\ntrajectories = 8'): "bad.toml: vary: has nothing that varies",
    BASE.replace("short.toml", "fig4"): "bad.toml:4: campaign.scenario: 'fig4' is a manoeuvre",
    BASE.replace("short.toml", "long.toml"): "bad.toml:4: campaign.scenario: 'long.toml' is no file, and no scenario",
    BASE + 'model = "none.toml"\n': "bad.toml:5: campaign.model: no such file: 'none.toml'",
    BASE + '[[faults]]\nkind = "gremlin"\nfrom_s = 1\n': "bad.toml:6: faults[0].kind: 'gremlin' is not one of drop",
    BASE + '[[faults]]\nkind = "drop"\nfrom_s = { distribution = "uniform", low = 1, high = 3 }\nto_s = 2\n':
        "bad.toml:8: faults[0].to_s: 2 is outside 3..4 s",
    BASE + "[route]\nwaypoints = 3\nx_m = [1, 0]\ny_m = [0, 1]\n": "bad.toml:7: route.x_m: needs a box of 0.1 m",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_a_bad_file_gives_one_line_and_nothing_is_written(text: str, folder: Path) -> None:
    (folder / "bad.toml").write_text(text)
    (folder / "motor.toml").write_text('name = "m"\nvehicle = "motor"\nprofile = "coupled"\n')
    before = sorted(folder.rglob("*"))
    done = brickpilot("campaign", "bad.toml", "--out", "found", cwd=folder)
    assert done.returncode == 2
    assert BAD[text] in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(folder.rglob("*")) == before


def test_the_folder_of_another_campaign_and_a_run_that_is_none_are_refused(folder: Path) -> None:
    here(folder, "trial.toml", 2)
    before = contents(folder / "found")
    for change in (["--runs", "3"], ["--runs", "2", "--seed", "8"]):
        done = brickpilot("campaign", "trial.toml", *change, "--out", "found", cwd=folder)
        assert done.returncode == 2
        assert done.stderr == "brickpilot: found: holds another campaign: name another folder, or remove this one\n"
    for index in ("42", "-1"):
        done = brickpilot("campaign", "trial.toml", "--replay", index, "--out", "again", cwd=folder)
        assert (done.returncode, done.stderr) == (
            2,
            f"brickpilot: --replay {index}: the campaign has the runs 0 to 41\n",
        )
    assert contents(folder / "found") == before
    assert not (folder / "again").exists()
