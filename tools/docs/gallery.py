"""Stages the gallery: runs each command of gallery.toml on the example logs, and shows the page that it writes."""

from __future__ import annotations

import html
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

LIST = Path(__file__).with_name("gallery.toml")
EXTRA = "_extra"
"""The folder of the staged pages whose files Sphinx copies as they are."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WINDOW = "1200,800"
SCALE = "0.5"
TOGETHER = 2
LONGEST_S = 300


@dataclass(frozen=True)
class Entry:
    """A command of the gallery; gallery.toml explains the fields."""

    name: str
    chain: str
    run: str
    page: str = ""
    says: str = ""

    @property
    def place(self) -> str:
        """Where its page stands below the gallery."""
        return f"{self.name}/{Path(self.page).name}" if self.page else f"{self.name}.html"


Run = Callable[..., subprocess.CompletedProcess[str]]
"""Runs `brickpilot` with these words in the folder `cwd`, for `timeout` seconds at most."""


def run(*words: str, cwd: Path, timeout: float) -> subprocess.CompletedProcess[str]:
    """Runs `brickpilot` as a user does."""
    program = Path(sys.executable).with_name("brickpilot")
    return subprocess.run([program, *words], cwd=cwd, capture_output=True, text=True, timeout=timeout, check=False)


def stage(root: Path, pages: Path, run: Run = run) -> None:
    """Runs the commands by `run`, and writes the gallery and its pages below `pages`.

    Raises:
        RuntimeError: a command failed, with what it said.
    """
    described = tomllib.loads(LIST.read_text(encoding="utf-8"))
    entries = [Entry(**one) for one in described["pages"]]
    place = pages / EXTRA / "gallery"
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(TOGETHER) as pool:
        chains = [
            pool.submit(_run_chain, chain, [one for one in entries if one.chain == chain], folder, place, run)
            for chain in dict.fromkeys(one.chain for one in entries)
            if (folder := _prepared(Path(scratch) / chain, root, described["files"]))
        ]
        printed = {name: text for chain in chains for name, text in chain.result().items()}
        shown = [one for one in entries if one.says]
        list(pool.map(lambda one: _picture(place, one), [one for one in shown if one.page]))
    for one in shown:
        if not one.page:
            (pages / "gallery").mkdir(parents=True, exist_ok=True)
            text = (
                f"# `brickpilot {one.name}`\n\n{one.says}\n\n```text\n$ brickpilot {one.run}\n{printed[one.name]}```\n"
            )
            (pages / "gallery" / f"{one.name}.md").write_text(text, encoding="utf-8")
    (pages / "gallery").mkdir(parents=True, exist_ok=True)
    (pages / "gallery/index.md").write_text(_index(shown, place), encoding="utf-8")


def _prepared(folder: Path, root: Path, files: dict[str, str]) -> Path:
    """Returns a folder with the example logs and the gallery's own files."""
    folder.mkdir(parents=True)
    for path in sorted((root / "tools/examples").iterdir()):
        if path.suffix in (".csv", ".toml"):
            shutil.copy(path, folder)
    for name, text in files.items():
        (folder / name).write_text(text.lstrip(), encoding="utf-8")
    return folder


def _run_chain(chain: str, entries: list[Entry], folder: Path, place: Path, run: Run) -> dict[str, str]:
    """Runs commands one after the other, and keeps their pages. Returns name -> what each has printed."""
    printed = {}
    for one in entries:
        done = run(*shlex.split(one.run), cwd=folder, timeout=LONGEST_S)
        if done.returncode != 0:
            raise RuntimeError(f"gallery, {chain}: brickpilot {one.run}: {done.stderr.strip()}")
        printed[one.name] = done.stdout
        if one.page:
            _keep(folder / one.page, place / one.name)
    return printed


def _keep(page: Path, place: Path) -> None:
    """Copies a page, and what stands beside it that it links to."""
    place.mkdir(parents=True)
    for name in {page.name, *re.findall(r'href="([\w.]+)"', page.read_text(encoding="utf-8"))}:
        file = page.with_name(name)
        if file.is_dir():
            shutil.copytree(file, place / name)
        else:
            shutil.copy(file, place)


def _picture(place: Path, one: Entry) -> None:
    """Takes a picture of a page, if there is a browser."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return
    with tempfile.TemporaryDirectory() as profile:
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={profile}"]
        size = [f"--window-size={WINDOW}", f"--force-device-scale-factor={SCALE}"]
        picture = f"--screenshot={place / one.name}.png"
        command = [browser, *options, *size, picture, (place / one.place).as_uri()]
        subprocess.run(command, capture_output=True, timeout=LONGEST_S, check=True)


def _index(shown: list[Entry], place: Path) -> str:
    figures = "\n".join(_figure(one, place) for one in shown)
    texts = "\n".join(one.name for one in shown if not one.page)
    intro = (
        "Each command that finds something out writes a page: one file, which needs nothing else and no network. "
        "These were made with this site, from the logs of `tools/examples`. A picture leads to its page. "
        "`brickpilot bench --scaling` writes one too; it is not here, as it measures for minutes."
    )
    contents = f"```{{toctree}}\n:hidden:\n\n{texts}\n```\n" if texts else ""
    return f'# Gallery\n\n{intro}\n\n<div class="gallery">\n{figures}\n</div>\n\n{contents}'


def _figure(one: Entry, place: Path) -> str:
    picture = "".join(_pictures(one, place))
    said = f"<b>{html.escape(one.name)}</b><br>{html.escape(one.says)} <code>brickpilot {html.escape(one.run)}</code>"
    opened = f'<a href="{one.place}">'
    return f"<figure>{opened}{picture}</a><figcaption>{said} {opened}Open</a></figcaption></figure>"


def _pictures(one: Entry, place: Path) -> Iterator[str]:
    if (place / f"{one.name}.png").is_file():
        yield f'<img src="{one.name}.png" alt="The page of brickpilot {html.escape(one.name)}" loading="lazy">'
