"""The page that discovery writes, in headless Chromium."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from brickpilot.report.discover_page import page
from findings import COMMAND, VERDICTS, all_verdicts
from matplotlib.image import imread

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PROBE = """<script>
document.querySelectorAll("details").forEach(one => { one.open = true; });
const stops = [...document.querySelectorAll("a, summary, [tabindex]")];
const reached = stops.filter(one => {
  one.focus();
  return document.activeElement === one && getComputedStyle(one).outlineStyle !== "none";
});
document.querySelector(".skip").focus();
const skip = document.querySelector(".skip").getBoundingClientRect();
const root = document.documentElement;
const found = [innerWidth, root.scrollWidth, document.hasFocus(), stops.length, reached.length, skip.left, skip.width];
document.title = JSON.stringify(found);
parent.postMessage(JSON.stringify(found), "*");
</script>"""
NARROW = """<!doctype html><title>nothing</title><script>onmessage = event => { document.title = event.data; };</script>
<iframe src="inner.html" style="border: 0; width: 400px; height: 900px"></iframe>"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return all_verdicts(tmp_path_factory.mktemp("report") / "set")


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


def probed(dom: str) -> list[float]:
    return json.loads(re.search(r"<title>(.*?)</title>", dom)[1])


@pytest.mark.parametrize("kind", VERDICTS)
def test_the_page_fits_its_window_and_the_keyboard_reaches_everything(found, tmp_path, kind):
    html = page(found[kind], COMMAND).replace("</body>", f"{PROBE}</body>")
    for _ in range(8):  # on a busy machine the window may get its focus too late
        dom, log = browse(tmp_path, html, "--window-size=1000,900", "--dump-dom")
        inner, scrolled, focused, stops, reached, skip_left, skip_width = probed(dom)
        if focused:
            break
    assert scrolled <= inner == 1000
    assert reached == stops > 20
    assert skip_left >= 0
    assert skip_width > 50
    assert "CONSOLE" not in log


@pytest.mark.parametrize("kind", VERDICTS)
def test_the_page_fits_a_narrow_screen(found, tmp_path, kind):
    html = page(found[kind], COMMAND).replace("</body>", f"{PROBE}</body>")
    (tmp_path / "inner.html").write_text(html, encoding="utf-8")
    dom, log = browse(tmp_path, NARROW, "--virtual-time-budget=10000", "--dump-dom")
    inner, scrolled = probed(dom)[:2]
    assert scrolled <= inner == 400
    assert "CONSOLE" not in log


def test_light_and_dark_mode_are_both_drawn(found, tmp_path):
    shots = {}
    for name, scheme in (("dark", "0"), ("light", "1")):
        shot = tmp_path / f"{name}.png"
        html = page(found["ambiguous"], COMMAND)
        browse(tmp_path, html, "--window-size=1000,1600", f"--screenshot={shot}", scheme=scheme)
        shots[name] = imread(shot)[..., :3]
    assert shots["light"].shape == shots["dark"].shape == (1600, 1000, 3)
    assert np.median(shots["light"]) > 0.9
    assert np.median(shots["dark"]) < 0.2
    for shot in shots.values():
        chart = shot[500:, 100:900]
        assert np.ptp(chart, axis=(0, 1)).min() > 0.3  # curves, not a blank


def test_the_page_prints(found, tmp_path):
    browse(tmp_path, page(found["named"], COMMAND), f"--print-to-pdf={tmp_path / 'page.pdf'}", "--no-pdf-header-footer")
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 15
