"""The headline of discovery states the fit in percent before, after and attainable, in sentences and on the page."""

from __future__ import annotations

import dataclasses

import pytest
from brickpilot.data.agreement import Agreement
from brickpilot.discover.yardstick import Predictable, Yardstick
from brickpilot.report import discover_fit
from brickpilot.report.discover_page import page
from brickpilot.report.discover_text import verdict
from findings import COMMAND, DASH, MINUS, VERDICTS, Page, all_verdicts, yardstick


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    made = all_verdicts(tmp_path_factory.mktemp("fit") / "set")
    return {kind: dataclasses.replace(one, yardstick=yardstick(kind == "none")) for kind, one in made.items()}


def plain(text):
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_the_headline_is_the_mean_over_the_signals_of_the_held_out_runs(found):
    one = discover_fit.headline(found["named"])
    assert (one.role, one.before, one.after, one.attainable) == ("held_out", 74.9, 96.25, 98.0)
    fit = discover_fit.headline(found["named"], "fit")
    assert fit.before == pytest.approx((81.2 - 1234.5) / 2)
    assert fit.attainable == pytest.approx((97.0 + 99.614) / 2)


def test_without_held_out_runs_the_headline_is_of_the_fit_runs_and_says_that_nothing_confirms_it(found):
    signals = {
        name: {
            horizon: dataclasses.replace(fit, held_out=fit.held_out.__class__(None, None, None))
            for horizon, fit in fits.items()
        }
        for name, fits in found["named"].yardstick.signals.items()
    }
    made = dataclasses.replace(found["named"], yardstick=dataclasses.replace(found["named"].yardstick, signals=signals))
    assert "the fit on the fit runs rises" in plain(verdict(made))
    assert verdict(made).endswith("and no held-out run confirms it.")


def test_the_verdict_quotes_the_fit_and_not_multiples_of_noise(found):
    sentence = plain(verdict(found["named"]))
    assert sentence.endswith(
        "With it, the fit on the held-out runs rises from 74.9 % to 96.2 %, and at least 98.0 % is attainable."
    )
    for kind in VERDICTS:
        assert "times the noise" not in verdict(found[kind])
    assert "the fit on the held-out runs is 74.9 %, and at least 98.0 % is attainable" in plain(verdict(found["none"]))


def test_without_a_yardstick_the_verdict_quotes_the_gap(found):
    assert "times the noise" in verdict(dataclasses.replace(found["named"], yardstick=Yardstick()))


@pytest.mark.parametrize("kind", VERDICTS)
def test_the_page_begins_with_the_fit(found, kind):
    read = Page(page(found[kind], COMMAND))
    assert "attainable" in read.sections["verdict"]
    assert "times the noise" not in read.sections["verdict"]
    text = " ".join(read.sections["fit"].split())
    assert "a black box predicts 88 % on fit runs and 90 % on held-out runs that it has not seen" in text
    assert "a perfect model would reach: yaw rate 98.4 %" in text
    rows = [row for row in (Page._clean(row) for row in read.rows) if row[:1] == ["yaw rate"] and len(row) == 4]
    expected = "74.9 (98.0)" if kind == "none" else "74.9 → 96.2 (98.0)"
    assert rows[0][1:] == [expected] * 3
    still = [
        row for row in (Page._clean(row) for row in read.rows) if row[:1] == ["wheel speed left"] and len(row) == 4
    ]
    assert still[0][1:] == [DASH] * 3
    if kind != "none":
        assert f"< {MINUS}999 → 96.2 (99.61)" in still[1]
        assert still[1][3] == DASH


def test_what_is_predictable_and_taken_away_is_said(found):
    text = plain(discover_fit.sentences(found["named"].yardstick.predictable["free_run"]))
    assert "takes away 97 % on fit runs and 97 % on held-out runs of what is predictable" in text
    assert discover_fit.sentences(Predictable(None, None, None, None)) == ""


def test_a_model_that_makes_the_error_larger_is_said_to(found):
    worse = dataclasses.replace(found["named"].yardstick.predictable["free_run"], removed_held_out=-0.5)
    assert f"{MINUS}50 % (it makes the error larger) on held-out runs" in plain(discover_fit.sentences(worse))


def test_the_terminal_shows_a_line_for_each_signal(found):
    head, rate, still = discover_fit.lines(found["named"])
    assert head.split()[-7:] == ["run", "1", "s", "0.2", "s", "rms", "error"]
    assert rate.split() == ["yaw_rate", *["74.9", "96.2", "98.0"] * 3]
    assert still.split() == ["wheel_speed_left", *["-"] * 9]
    assert DASH not in still
    assert discover_fit.lines(dataclasses.replace(found["named"], yardstick=Yardstick())) == []


def test_the_error_stands_beside_the_fit_in_its_unit(found):
    one = found["named"]
    fit = one.yardstick.signals["yaw_rate"]["free_run"]
    before, after = (Agreement(100, 100 * rms**2, 100.0, 0.0, 100.0) for rms in (0.2, 0.02))
    sized = dataclasses.replace(fit.held_out, numbers_before=before, numbers_after=after)
    signals = {"yaw_rate": {"free_run": dataclasses.replace(fit, held_out=sized)}}
    made = dataclasses.replace(one, yardstick=dataclasses.replace(one.yardstick, signals=signals))
    assert discover_fit.lines(made)[1].endswith("0.200 rad/s to 20.0 mrad/s")
    assert "20.0 mrad/s" in plain(page(made, COMMAND))


def test_runs_that_are_held_out_in_part_are_named(found):
    roles = dict.fromkeys(found["named"].roles, "fit")
    made = dataclasses.replace(found["named"], roles=roles, held_out_stretches={"spin": (1.0, 1.9)})
    read = Page(page(made, COMMAND))
    assert "1 held out in part" in " ".join(read.sections["verdict"].split())
    assert "Of these runs a part was held out: spin." in read.sections["proof"]
    assert "No run was held out" not in read.sections["proof"]
