"""What the figures of pages draw, thin and describe."""

from __future__ import annotations

import json

import numpy as np
import pytest
from brickpilot.report.plot import Curve, Figure, Panel, fits, gaps, superimposed, to_html
from findings import Page
from pages import figures


def draw(measured, points=300, stretch=None):
    time = np.linspace(0.0, 10.0, len(measured))
    html = superimposed(
        time, "turning", "rad/s", measured, {}, run="r", title="a curve", points=points, noise_sd=0.1, stretch=stretch
    )
    return figures(html)["a curve"]


def test_no_peak_is_lost_by_thinning():
    measured = np.random.default_rng(0).normal(0, 0.01, 33000)
    measured[12340], measured[23450] = 5.0, -4.0
    figure = draw(measured)
    assert 200 < len(figure["x"]["values"]) < 400
    values = np.array(figure["panels"][0]["curves"][0]["values"])
    assert (values.max(), values.min()) == pytest.approx((5.0, -4.0))
    ends = figure["x"]["values"][0], figure["x"]["values"][-1]
    places = [figure["x"]["values"][place] for place in (values.argmax(), values.argmin())]
    assert (*ends, *places) == pytest.approx((0.0, 10.0, 10 * 12340 / 32999, 10 * 23450 / 32999), abs=1e-4)


def test_a_page_says_how_many_samples_it_draws():
    time = np.arange(5000.0)
    figure = Figure("long", time, [Panel("value", "m", [Curve("sine", np.sin(time))])])
    html = to_html(figure, 500)
    count = len(figures(html)["long"]["x"]["values"])
    assert 400 < count < 600
    assert f"{count} of 5000 samples are drawn." in html
    assert "samples are drawn" not in to_html(figure, 5000)


def test_a_dropout_in_the_data_breaks_the_curve():
    measured = np.sin(np.arange(200.0))
    measured[50:80] = np.nan
    (curve,) = draw(measured)["panels"][0]["curves"]
    assert [k for k, value in enumerate(curve["values"]) if value is None] == list(range(50, 80))
    assert 1.4 < curve["gap"] / (10.0 / 199) < 1.6  # shorter than the dropout, longer than a step


def test_a_signal_that_is_slower_than_the_log_is_joined():
    measured = np.where(np.arange(200) % 4, np.nan, 1.0)
    (curve,) = draw(measured)["panels"][0]["curves"]
    assert curve["gap"] > 4 * 10.0 / 199


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("measured", [np.zeros(20), np.full(20, 3.0), np.r_[np.full(19, np.nan), 1.0]])
def test_curves_without_a_spread_are_kept_as_they_are(measured):
    (curve,) = draw(measured, stretch=(2.0, 3.0))["panels"][0]["curves"]
    assert curve["values"] == [None if np.isnan(one) else one for one in measured]


@pytest.mark.parametrize(
    "name", ["</script><script>alert(1)</script>", "<!--<script>", "a & b", '"><img src=x>', "\u2028"]
)
def test_no_name_can_leave_the_description_of_a_figure(name):
    time = np.arange(3.0)
    html = to_html(Figure(name, time, [Panel(name, name, [Curve(name, time)], rows=[name] * 3)], name, name, link=name))
    read = Page(html)
    assert [tag for tag, _ in read.elements] == ["div", "script"]
    (spec,) = map(json.loads, read.scripts)
    assert spec["link"] == spec["panels"][0]["curves"][0]["name"] == spec["x"]["name"] == name
    assert read.all("div")[0]["aria-label"] == name


def test_the_time_of_a_run_counts_from_its_first_sample():
    time = 1.7e9 + np.linspace(0.0, 10.0, 50)
    stretch = (1.7e9 + 2.0, 1.7e9 + 4.0)
    html = superimposed(time, "u", "V", np.sin(time), {}, run="r", title="a", points=300, stretch=stretch)
    figure = figures(html)["a"]
    assert figure["x"]["label"] == "time (s)"
    assert (figure["x"]["values"][0], figure["x"]["values"][-1], *figure["stretch"]) == (0, 10, 2, 4)


def test_fits_near_100_percent_are_drawn_at_their_values():
    rows = [("turning", 99.35, 99.99, 99.995), ("driving", None, -400.0, 99.0)]
    for single, names in ((False, ["before", "after", "attainable"]), (True, ["simulated", "attainable"])):
        (figure,) = figures(str(fits(rows, single=single, title="t"))).values()
        assert figure["x"]["label"] == "fit (%)"
        (panel,) = figure["panels"]
        assert [one["name"] for one in panel["curves"]] == names
        assert panel["rows"] == ["driving", "turning"]
        after = panel["curves"][-2]["values"]
        places = {row: x for x, row in zip(figure["x"]["values"], after, strict=True) if row is not None}
        assert places == pytest.approx({1: 99.99, 0: -20.0}, abs=0.01)  # a value far below 0 is drawn at the edge
        assert panel["spans"][0] == pytest.approx([1, 99.99 if single else 99.35, 99.995])


def test_gaps_are_drawn_on_a_log_scale_with_a_line_at_the_noise():
    (figure,) = figures(str(gaps([("yaw rate", 80.2, 1.07), ("none", None, None)], single=False, title="t"))).values()
    assert figure["x"]["log"]
    assert figure["lines"] == [1.0]
    assert 1.0 in figure["x"]["reach"]
    assert figure["x"]["values"] == pytest.approx([1.07, 80.2], rel=1e-3)
    assert figure["panels"][0]["spans"] == [pytest.approx([1, 1.07, 80.2])]
