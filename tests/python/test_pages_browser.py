"""The pages that the commands write, in headless Chromium."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickpilot.campaign import file, workers
from brickpilot.campaign.run_campaign import run_campaign
from brickpilot.data import reading
from brickpilot.discover.finding import Finding
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.comparison import compare
from brickpilot.report import run_page, why_page, why_text
from brickpilot.report.discover_page import page
from brickpilot.report.fit_pages import calibrate_page, compare_page
from brickpilot.tune import page as tune_page
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from command import brickpilot
from findings import COMMAND, VERDICTS, all_verdicts
from lab import page as lab_page
from lab import real_logs, real_results, scaling, scaling_page, table
from lab_results import quick_results, scaling_results
from matplotlib.image import imread
from pages import FAULTY, HOSTILE, assert_self_contained
from synthetic import robot, write
from tuned import poor

STATED = "".join(
    f"{name} = {robot().parameters[name]}\n"
    for name in ("rolling_friction", "half_track", "wheel_radius", "wheel_inertia", "resistance", "viscous_friction")
)
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PROBE = """<script>
document.querySelectorAll("details").forEach(one => { one.open = true; });
holders.forEach(draw);
const stops = [...document.querySelectorAll("a, summary, button, input, select, [tabindex]")];
const reached = stops.filter(one => {
  one.focus();
  return document.activeElement === one && getComputedStyle(one).outlineStyle !== "none";
});
const found = {
  inner: innerWidth, scrolled: root.scrollWidth, focused: document.hasFocus(),
  stops: stops.length, reached: reached.length,
  figures: holders.length, empty: [...holders].filter(one => !one.querySelector("canvas")).length,
  loaded: performance.getEntriesByType("resource").length,
};
document.title = JSON.stringify(found);
parent.postMessage(JSON.stringify(found), "*");
</script>"""
USE = """<script>
holders.forEach(draw);
setTimeout(() => {
  const plots = drawn.filter(one => one.chart.mode === 1).map(one => one.chart);
  const ranges = () => plots.map(u => [u.scales.x.min, u.scales.x.max].map(one => +one.toFixed(2)));
  const found = { before: ranges() };
  const over = plots[0].over, box = over.getBoundingClientRect();
  const mouse = (kind, share) => over.dispatchEvent(new MouseEvent(kind, {
    clientX: box.left + share * box.width, clientY: box.top + 40, movementX: 1, bubbles: true, button: 0,
  }));
  mouse("mouseenter", 0.25); mouse("mousemove", 0.25); mouse("mousedown", 0.25); mouse("mousemove", 0.5);
  document.dispatchEvent(new MouseEvent("mouseup", { clientX: box.left + 0.5 * box.width, clientY: box.top + 40 }));
  setTimeout(() => {
    found.zoomed = ranges();
    const name = plots[1].root.querySelector(".u-series:has(.u-marker[style]) th");
    name.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
    found.shown = plots[1].series.slice(1).map(one => one.show);
    const slider = document.querySelector(".player input");
    slider.value = found.zoomed[0][0] + 1.5;
    slider.dispatchEvent(new Event("input"));
    found.cursors = plots.map(u => +u.data[0][u.cursor.idx].toFixed(2));
    found.clock = document.querySelector(".player output").textContent;
    let moment = 0; // without a screen no frame comes by itself
    window.requestAnimationFrame = paint => setTimeout(() => paint(moment += 20), 20);
    document.querySelector(".player button").click();
    setTimeout(() => {
      found.later = document.querySelector(".player output").textContent;
      found.button = document.querySelector(".player button").textContent;
      dispatchEvent(new Event("beforeprint"));
      found.paper = [root.className, palette.page, ...drawn.map(one => one.chart.width)];
      dispatchEvent(new Event("afterprint"));
      document.title = JSON.stringify(found);
    }, 300);
  }, 100);
}, 100);
</script>"""
WIDE_PAPER = """<script>
dispatchEvent(new Event("beforeprint"));
root.querySelector("main").style.width = "1000px"; // a wide table makes the browser lay the paper out so, and shrink it
document.title = JSON.stringify(drawn.map(one => one.chart.width - one.holder.clientWidth));
</script>"""
NARROW = """<!doctype html><title>nothing</title><script>onmessage = event => { document.title = event.data; };</script>
<iframe src="inner.html" style="border: 0; width: 400px; height: 900px"></iframe>"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Returns kind of page -> HTML; names of data sets, runs and missions contain a script's tag."""
    folder = tmp_path_factory.mktemp("pages")
    verdicts = all_verdicts(folder / "set")
    found = {kind: page(one, COMMAND) for kind, one in verdicts.items()}
    found["why"] = why(verdicts["named"])
    manoeuvres = {HOSTILE: (6.0, 6.0), "spin": (5.0, -5.0), "curve": (6.0, 2.0)}
    data = reading.read(write(folder / "hostile", robot(), {"yaw_rate": 0.02}, STATED, manoeuvres=manoeuvres))
    data = dataclasses.replace(data, name=f"</script>{HOSTILE}")
    found["compare"] = compare_page(compare(data, robot()))
    found["calibrate"] = calibrate_page(calibrate(data))
    mission = scenario.load(scenario.packaged()["mission"])
    flown = flight.fly(flight.plan(dataclasses.replace(mission, title=HOSTILE), rcx(), sensors="imu+encoders"))
    found["run"] = run_page.page(flown, flight_figures.summary(flown), COMMAND)
    found["hil"] = hil(folder)
    found["tune"] = tune_page.page(poor(folder), COMMAND)
    found["campaign"] = campaign(folder)
    results = quick_results()
    found["lab discover"] = lab_page.hidden_page(lab_page.hidden(results, table.table(results)))
    kept = real_results.load(real_results.KEPT)
    found["lab real"] = lab_page.real_page(lab_page.real(kept, real_logs.by_name()))
    found["bench scaling"] = scaling_page.page(scaling.as_dict(scaling_results()), HOSTILE)
    return found


def why(finding: Finding) -> str:
    """Returns the page of `brickpilot why` for a finding, with a hostile name of the log."""
    named = dataclasses.replace(finding, dataset=dataclasses.replace(finding.dataset, name=HOSTILE))
    answer = why_text.answer(named, None)
    constants = why_page.constants_of(named)
    made = why_page.Why(named, answer, constants, (HOSTILE,))
    return why_page.page(made, source=HOSTILE, files=["report.html"], command=HOSTILE)


def hil(folder: Path) -> str:
    """Returns the page of a short flight over a pseudo-terminal, with damaged messages and a hostile title."""
    faulty = f"name = {HOSTILE!r}\n{FAULTY}"
    (folder / "faulty.toml").write_text(faulty, encoding="utf-8")
    brickpilot("hil", "faulty.toml", "--link", "serial:pty", "--out", "hil", cwd=folder)
    return (folder / "hil" / "report.html").read_text(encoding="utf-8")


def campaign(folder: Path) -> str:
    """Returns the page of a campaign of short flights, some of which fail, with hostile names."""
    (folder / "short.toml").write_text(
        'name = "short"\nkind = "mission"\nduration_s = 2\nwaypoints_m = [[0.3, 0], [0.5, 0.2]]\n'
    )
    (folder / "trial.toml").write_text(
        '[campaign]\nname = "trial"\nruns = 120\nscenario = "short.toml"\nsensors = ["imu", "imu+encoders"]\n[vary]\n'
        'parameter.mass = { distribution = "normal", mean = 0.9, sd = 0.1 }\ngain.heading_kp = [8, 12]\n'
    )
    given = file.load(folder / "trial.toml")
    hostile = dataclasses.replace(given, name=HOSTILE)
    run_campaign(hostile, folder / "trial", workers.Here(), lambda *_: None, HOSTILE)
    return (folder / "trial" / "report.html").read_text(encoding="utf-8")


def browse(folder: Path, html: str, *flags: str, scheme: str = "") -> tuple[str, str]:
    """Opens the page in headless Chromium without network; returns its standard output and error."""
    if BROWSER is None:
        pytest.skip("no chromium or google-chrome is installed: the page was not tested in a browser")
    (folder / "page.html").write_text(html, encoding="utf-8")
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={folder / 'profile'}", "--hide-scrollbars",
        "--enable-logging=stderr", *([f"--blink-settings=preferredColorScheme={scheme}"] if scheme else []), *flags,
        (folder / "page.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=True)
    return done.stdout, done.stderr


def probed(dom: str) -> Any:
    return json.loads(unescape(re.search(r"<title>(.*?)</title>", dom)[1]))


KINDS = (
    *VERDICTS, "why", "compare", "calibrate", "run", "hil", "tune", "campaign", "lab discover", "lab real",
    "bench scaling",
)  # fmt: skip


@pytest.mark.parametrize("kind", ["named", "run", "campaign"])
def test_the_keyboard_reaches_everything(pages, tmp_path, kind):
    html = pages[kind].replace("</body>", f"{PROBE}</body>")
    for _ in range(8):  # on a busy machine the window may get its focus too late
        dom, _ = browse(tmp_path, html, "--window-size=1000,900", "--dump-dom")
        found = probed(dom)
        if found["focused"]:
            break
    assert found["scrolled"] <= found["inner"] == 1000
    assert found["reached"] == found["stops"] > 20


@pytest.mark.parametrize("kind", KINDS)
def test_the_page_fits_a_narrow_screen_draws_all_figures_and_loads_nothing(pages, tmp_path, kind):
    assert_self_contained(pages[kind])
    assert "<script>alert" not in pages[kind]
    html = pages[kind].replace("</body>", f"{PROBE}</body>")
    (tmp_path / "inner.html").write_text(html, encoding="utf-8")
    dom, log = browse(tmp_path, NARROW, "--virtual-time-budget=10000", "--dump-dom")
    found = probed(dom)
    assert found["scrolled"] <= found["inner"] == 400
    assert found["figures"] > 1  # at least 2, as many as "why" has
    assert (found["empty"], found["loaded"]) == (0, 0)
    assert "CONSOLE" not in log


def test_figures_of_a_run_zoom_together_and_the_track_is_played(pages, tmp_path):
    html = pages["run"].replace("</body>", f"{USE}</body>")
    dom, log = browse(tmp_path, html, "--virtual-time-budget=20000", "--dump-dom", scheme="0")
    found = probed(dom)
    assert len(found["before"]) == 13
    end = found["before"][0][1]
    assert found["before"] == [[0.0, end]] * 13
    low, high = found["zoomed"][0]
    assert (low, high) == pytest.approx((0.25 * end, 0.5 * end), rel=0.02)
    assert found["zoomed"] == [[low, high]] * 13
    assert found["shown"].count(False) == 1
    assert found["cursors"] == pytest.approx([low + 1.5] * 13, abs=0.1)
    assert float(found["clock"].removesuffix(" s")) == pytest.approx(low + 1.5, abs=0.02)
    assert float(found["later"].removesuffix(" s")) > low + 1.6
    assert found["button"] == "Pause"
    assert found["paper"] == ["paper", "#ffffff", *[690] * 14]
    assert "CONSOLE" not in log


def test_light_and_dark_mode_are_both_drawn(pages, tmp_path):
    shots = {}
    for name, scheme in (("dark", "0"), ("light", "1")):
        shot = tmp_path / f"{name}.png"
        html = pages["ambiguous"]
        browse(tmp_path, html, "--window-size=1000,1600", f"--screenshot={shot}", scheme=scheme)
        shots[name] = imread(shot)[..., :3]
    assert shots["light"].shape == shots["dark"].shape == (1600, 1000, 3)
    assert np.median(shots["light"]) > 0.9
    assert np.median(shots["dark"]) < 0.2
    for shot in shots.values():
        chart = shot[500:, 100:900]
        assert np.ptp(chart, axis=(0, 1)).min() > 0.3  # curves, not a blank


@pytest.mark.parametrize(("kind", "least", "most"), [("named", 3, 15), ("run", 3, 8), ("campaign", 3, 8)])
def test_the_page_prints(pages, tmp_path, kind, least, most):
    _, log = browse(
        tmp_path, pages[kind], f"--print-to-pdf={tmp_path / 'page.pdf'}", "--no-pdf-header-footer", scheme="0"
    )
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert "CONSOLE" not in log
    assert least <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= most


@pytest.mark.parametrize("kind", ["named", "lab real"])
def test_figures_side_by_side_fit_on_paper(pages, tmp_path, kind):
    html = pages[kind].replace("</body>", f"{WIDE_PAPER}</body>")
    dom, _ = browse(tmp_path, html, "--window-size=800,900", "--virtual-time-budget=10000", "--dump-dom")
    assert max(probed(dom)) <= 0
