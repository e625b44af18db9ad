"""The documentation site shows all commands, effects and documents, has no broken link, and needs no network."""

from __future__ import annotations

import functools
import html
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import brickpilot
import documents
import gallery
import headers
import make
import pytest
from brickpilot import catalogue
from brickpilot.cli.main import COMMANDS
from brickpilot.vehicle.settings import settings
from command import brickpilot as run_command

ROOT = Path(__file__).resolve().parents[2]
BROWSER = next(filter(None, map(shutil.which, gallery.BROWSERS)), None)
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
SVG = '"http://www.w3.org/2000/svg"'
"""The name of an XML namespace; no browser loads it."""

LOADING = {
    "img": ("src", "srcset"), "script": ("src",), "iframe": ("src",), "audio": ("src",), "video": ("src", "poster"),
    "source": ("src", "srcset"), "embed": ("src",), "object": ("data",), "input": ("src",), "track": ("src",),
}  # fmt: skip
"""Tag -> attributes whose target a browser loads. For the tag `link`, `LOADING_RELATIONS` decides."""

LOADING_RELATIONS = {
    "stylesheet",
    "icon",
    "preload",
    "prefetch",
    "preconnect",
    "dns-prefetch",
    "modulepreload",
    "manifest",
}


class Page(HTMLParser):
    """The targets that a page of the site loads, the targets of its links, and its anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        self.loads += [given[name] for name in LOADING.get(tag, ()) if name in given]
        if tag == "link" and LOADING_RELATIONS & set(given.get("rel", "").split()):
            self.loads.append(given["href"])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs") / "site"
    assert make.make(out, run=run_command) == 0
    return out


@pytest.fixture(scope="module")
def parsed(site: Path) -> dict[Path, Page]:
    return {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}


def is_remote(target: str) -> bool:
    return bool(urlsplit(target).netloc) or urlsplit(target).scheme in ("http", "https")


def loads_of(site: Path, pages: dict[Path, Page]) -> Iterator[str]:
    """Yields a line for everything that a page or a style sheet would load from the network."""
    for path, page in pages.items():
        styles = re.findall(r"<style[^>]*>(.*?)</style>", path.read_text(encoding="utf-8"), re.DOTALL)
        targets = [*page.loads, *(one for style in styles for one in loads_of_style(style))]
        yield from (f"{path.relative_to(site)} loads {one}" for one in targets if is_remote(one))
    for path in site.rglob("*.css"):
        targets = loads_of_style(path.read_text(encoding="utf-8"))
        yield from (f"{path.relative_to(site)} loads {one}" for one in targets if is_remote(one))


def loads_of_style(text: str) -> list[str]:
    imported = re.findall(r"@import\s+[\"']([^\"']+)", text)
    return [*imported, *re.findall(r"url\(\s*[\"']?([^\"')]+)", text)]


def test_nothing_is_loaded_from_the_network(site: Path, parsed: dict[Path, Page]) -> None:
    assert len(parsed) > 40
    assert sum(len(page.loads) for page in parsed.values()) > 200
    assert list(loads_of(site, parsed)) == []


def test_no_script_of_the_site_names_a_place_on_the_network(site: Path) -> None:
    scripts = list(site.rglob("*.js"))
    assert len(scripts) > 5
    for path in scripts:
        if path.name != "searchindex.js":  # searchindex.js holds words of the pages
            text = path.read_text(encoding="utf-8").replace(SVG, "")
            assert not re.search(r"[\"'`](https?:)?//[\w-]+\.\w", text), path


@pytest.mark.parametrize(
    "planted",
    [
        '<script src="https://cdn.example/x.js"></script>',
        '<link rel="stylesheet" href="//fonts.example/css">',
        '<img src="http://example.org/a.png">',
        "<style>@import 'https://fonts.example/a.css';</style>",
        "<style>a { background: url(https://example.org/a.png) }</style>",
    ],
)
def test_a_load_from_the_network_would_be_found(planted: str, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(f'<html><a href="https://example.org">a link is none</a>{planted}</html>')
    assert len(list(loads_of(tmp_path, {page: Page(page.read_text())}))) == 1


def test_every_link_leads_somewhere(site: Path, parsed: dict[Path, Page]) -> None:
    broken = []
    for path, page in parsed.items():
        for link in (*page.links, *page.loads):
            parts = urlsplit(link)
            if is_remote(link) or parts.scheme in ("mailto", "data", "javascript"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchors = parsed[target].anchors if target in parsed else {parts.fragment}
            if not target.exists() or (parts.fragment and unquote(parts.fragment) not in anchors):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert broken == []


def text_of(page: Path) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", page.read_text(encoding="utf-8")))


def test_the_reference_has_every_command_effect_setting_name_and_word(site: Path) -> None:
    for command in COMMANDS:
        assert f"brickpilot {command.name}" in text_of(site / f"reference/commands/{command.name}.html")
    effects = text_of(site / "reference/effects.html")
    for effect in catalogue.effects():
        assert effect.name in effects
        assert " ".join(effect.equation.split())[:40] in " ".join(effects.split())
        assert all(one.name in effects for one in effect.parameters)
        assert effect.prior_reason in " ".join(effects.split())
    listed = text_of(site / "reference/settings.html")
    assert all(name in listed and row.meaning in listed for name, row in settings().items())
    python = text_of(site / "reference/python.html")
    assert all(f"bp.{name}" in python for name in brickpilot.__all__ if name not in ("__version__", "discover_effects"))
    words = text_of(site / "reference/glossary.html")
    assert "golden stream" in words
    assert "the motor commands of a mission that every build must give" in words


def test_the_headers_pages_have_every_function(site: Path) -> None:
    for name in headers.HEADERS:
        page = text_of(site / f"reference/c/{Path(name).stem}.html")
        source = re.sub(r"/\*.*?\*/", "", (ROOT / name).read_text(), flags=re.DOTALL)
        declared = re.findall(r"^\w[\w ]*[ *](\w+)\(", source, re.MULTILINE)
        assert len(declared) >= 5
        assert [one for one in declared if one not in page] == []


def test_every_document_is_a_page_and_notebooks_show_their_outputs(site: Path) -> None:
    for path in documents.documents(ROOT):
        place = path.relative_to(ROOT).with_suffix(".html")
        assert (site / (place if str(place) != "README.html" else "index.html")).is_file()
    paper = (site / "tools/examples/paper.html").read_text(encoding="utf-8")
    assert "949 degrees/s at the end" in paper
    assert len(re.findall(r'<img alt="[^"]*" src="[^"]*_images/', paper)) >= 4


def test_the_gallery_shows_every_page(site: Path) -> None:
    shown = (site / "gallery/index.html").read_text(encoding="utf-8")
    names = re.findall(r"<figcaption><b>(\w+)</b>", shown)
    assert {"run", "hil", "why", "check", "discover", "calibrate", "compare", "tune", "campaign"} <= set(names)
    for name in names:
        assert (site / f"gallery/{name}").is_dir() or (site / f"gallery/{name}.html").is_file()
        assert BROWSER is None or name == "check" or (site / f"gallery/{name}.png").stat().st_size > 5000


@pytest.mark.parametrize(
    "planted",
    [
        "[no page](nowhere.md)",
        "[no file](nothing.csv)",
        "[no heading](../index.md#bottom)",
        "![no picture](no.svg)",
    ],
)
def test_a_broken_link_fails_the_build(planted: str, tmp_path: Path) -> None:
    pages = tmp_path / "pages"
    (pages / gallery.EXTRA).mkdir(parents=True)
    (pages / "hal").mkdir()
    (pages / "index.md").write_text("# Top\n\n```{toctree}\n\nhal/README\n```\n")
    whole = "# HAL\n\n[up](../index.md#top)\n"
    (pages / "hal/README.md").write_text(whole)
    assert make.render(pages, tmp_path / "out") == 0
    (pages / "hal/README.md").write_text(f"{whole}\n{planted}\n")
    assert make.render(pages, tmp_path / "out") != 0


def browsed(address: str, folder: Path) -> str:
    """Returns the page as the browser shows it; the browser can resolve no host name."""
    assert BROWSER is not None, "needs a browser: sh tests/run installs chromium"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=8000", f"--user-data-dir={folder}"]
    network = ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--proxy-server=direct://"]
    command = [BROWSER, *options, *network, "--dump-dom", address]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


def assert_the_search_finds(shown: str) -> None:
    assert re.search(r"found \d+ page", shown)
    assert 'href="reference/effects.html#gear-backlash"' in shown


def test_the_search_works_from_the_disk_without_a_network(site: Path, tmp_path: Path) -> None:
    assert_the_search_finds(browsed(f"{(site / 'search.html').as_uri()}?q=backlash", tmp_path))


def test_the_search_works_from_a_server_without_a_network(site: Path, tmp_path: Path) -> None:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert_the_search_finds(browsed(f"http://127.0.0.1:{server.server_port}/search.html?q=backlash", tmp_path))
        server.shutdown()
