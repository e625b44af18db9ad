"""Makes the documentation site: stages the pages, then lets Sphinx render them. `sh tools/docs/build` calls this."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import documents
import gallery
import headers
import recipe
import reference
from sphinx.cmd.build import build_main

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def make(out: Path, *, root: Path = ROOT, run: gallery.Run = gallery.run) -> int:
    """Makes the site of the checkout at `root` in the folder `out`. Returns 0, or Sphinx's status.

    `run` runs the commands of the gallery. What is staged stays in the folder `out`-pages.
    """
    pages = out.with_name(f"{out.name}-pages")
    for folder in (out, pages):
        shutil.rmtree(folder, ignore_errors=True)
    for part in (documents, reference, headers, recipe):
        part.stage(root, pages)
    gallery.stage(root, pages, run)
    return render(pages, out)


def render(pages: Path, out: Path) -> int:
    """Renders staged pages. Returns 0, or Sphinx's status: whatever it warns of, as a broken link, is an error."""
    options = ["-b", "html", "-q", "-W", "--keep-going", "-c", str(HERE), "-d", str(pages / ".doctrees")]
    options += ["-D", f"html_extra_path={pages / gallery.EXTRA}"]
    return build_main([*options, str(pages), str(out)])


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) > 1 else "build/docs").resolve()
    status = make(place)
    if status == 0:
        print(f"site: {place / 'index.html'}")
    sys.exit(status)
