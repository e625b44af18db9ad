"""Each tick of a flight over a link is recorded, and the flight's page plots these records."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from brickpilot.hil.linked_flight import TROUBLES, TickRecorder
from brickpilot.report import run_page
from command import brickpilot
from pages import FAULTY, assert_self_contained, curves, figures


def columns(steps: int = 1000, **changes: np.ndarray) -> dict[str, np.ndarray]:
    """Returns the columns of ticks exactly 3 ms apart, with a round trip of 0.5 ms and no trouble."""
    time = 0.003 * np.arange(steps)
    found = {"time_s": time, "begun_s": time, "round_trip_ms": np.full(steps, 0.5)}
    return found | {name: np.zeros(steps) for name in TROUBLES} | changes


def test_each_tick_has_its_own_round_trip_and_troubles() -> None:
    recorder = TickRecorder(10)
    for step in range(4):
        recorder.begin(step)
        recorder.sent(step, 7 + step)
        if step != 2:
            recorder.replied(7 + step)
        recorder.count(step, 0, int(step >= 2), 3, 0)
    recorder.replied(99)  # a reply to a set that was never sent
    ticks = recorder.columns(5)
    assert ticks["begun_s"][0] == 0.0
    assert np.all(np.diff(ticks["begun_s"][:4]) > 0)
    assert np.isnan(ticks["begun_s"][4])
    assert np.isnan(ticks["round_trip_ms"]).tolist() == [False, False, True, False, True]
    assert ticks["lost_frames"].tolist() == [0, 0, 1, 0, 0]
    assert ticks["refused_frames"].tolist() == [3, 0, 0, 0, 0]


def test_a_reply_to_a_set_of_an_earlier_tick_counts_for_that_tick() -> None:
    recorder = TickRecorder(3)
    recorder.sent(0, 1)
    recorder.sent(1, 2)
    recorder.replied(1)
    assert np.isfinite(recorder.columns(2)["round_trip_ms"]).tolist() == [True, False]


@pytest.mark.realtime  # frames get lost, and the link stops the motors if a reply takes too long
def test_the_command_writes_every_tick_and_draws_them(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(f'name = "s"\n{FAULTY}', encoding="utf-8")
    done = brickpilot("hil", "s.toml", "--link", "serial:pty", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    ticks = np.genfromtxt(tmp_path / "out" / "ticks.csv", delimiter=",", names=True)
    assert len(ticks) == found["steps"]
    assert (ticks["round_trip_ms"] > 0).all()  # in lockstep a set is sent until its reply comes
    assert ticks["late_ticks"].sum() == found["late_ticks"]
    assert ticks["safe_stops"].sum() == found["safe_stops"] == 0
    lost, refused = ticks["lost_frames"], ticks["refused_frames"]
    assert lost.sum() > 0 and refused.sum() > 0  # noqa: PT018
    wrong = ticks["time_s"][(lost > 0) | (refused > 0)]
    assert wrong.min() >= 1.0
    assert wrong.max() < 1.9  # the brick reports its counts about once a second
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert_self_contained(page)
    drawn = figures(page)
    assert sum(name.startswith(("time line of the link", "round trip")) for name in drawn) == 2
    assert not any(name.startswith("jitter") for name in drawn)  # lockstep follows no clock


def test_the_time_line_marks_each_kind_where_it_was_counted() -> None:
    stops, late = np.zeros(1000), np.zeros(1000)
    stops[200], late[[100, 300]] = 1, 2
    said, html = run_page.trouble(columns(safe_stops=stops, late_ticks=late))
    assert said == "4 late ticks, 0 lost frames, 0 refused frames, 1 safe stop."
    (figure,) = figures(str(html)).values()
    assert figure["x"]["values"] == pytest.approx([0.3, 0.6, 0.9])
    assert figure["x"]["reach"] == pytest.approx([0, 2.997])
    assert figure["link"] == "run"
    rows = figure["panels"][0]["rows"]
    marked = {name.removeprefix(": "): values for name, values in curves(figure).items()}
    assert marked["late tick"] == [rows.index("late tick"), None, rows.index("late tick")]
    assert marked["safe stop"] == [None, rows.index("safe stop"), None]


def test_a_flight_without_trouble_says_so_without_a_figure() -> None:
    assert run_page.trouble(columns()) == ("0 late ticks, 0 lost frames, 0 refused frames, 0 safe stops.", None)


def test_the_histograms_hold_every_tick() -> None:
    random = np.random.default_rng(0)
    begun = 0.003 * np.arange(1000) + random.normal(0, 1e-4, 1000)
    begun[500:] += 0.05  # one period of 53 ms
    trips = random.lognormal(-0.7, 0.3, 1000)
    trips[10] = np.nan
    ticks = columns(begun_s=begun, round_trip_ms=trips)
    said, html = run_page.round_trip(ticks)
    assert said.startswith("Half of 999 replies took up to 0.")
    (figure,) = figures(str(html)).values()
    assert sum(filter(None, figure["panels"][0]["curves"][0]["values"])) == 999
    said, html = run_page.jitter(ticks)
    assert "by up to 50" in said
    (figure,) = figures(str(html)).values()
    counts = figure["panels"][0]["curves"][0]["values"]
    assert sum(filter(None, counts)) == 999
    assert counts[-1] >= 1  # the long period, in the outermost bar


def test_no_bar_of_a_logarithmic_axis_is_at_zero() -> None:
    """A bar at zero would give a logarithmic axis endless tick marks. The round trips range from 0.1 us to 20 s."""
    trips = np.append(np.full(999, 0.5), 2e4)
    trips[0] = 1e-4
    (figure,) = figures(str(run_page.round_trip(columns(round_trip_ms=trips))[1])).values()
    bars = np.array(figure["x"]["values"])
    assert 0 < bars[0] < 2e-3
    assert np.all(np.diff(np.log(bars)) > 0)


def test_one_tick_and_no_reply_have_no_histogram() -> None:
    ticks = columns(1, round_trip_ms=np.array([np.nan]))
    assert run_page.round_trip(ticks) == ("No reply came.", None)
    assert run_page.jitter(ticks)[1] is None
