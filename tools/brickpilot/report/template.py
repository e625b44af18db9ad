"""Renders the package's templates: pages, and files for other programs."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from brickpilot import __version__
from brickpilot.report import quantities
from brickpilot.text_template import render_text

_FILTERS = ("fit_number", "fit_text", "gap_text", "number", "percent", "plain", "quantity", "say", "signed")
"""The functions of `quantities` that a page uses as filters; the further filter `role` names the role of a run."""

_HERE = Path(__file__).parent
_SCRIPTS = ("templates/figures.js", "templates/track.js", "templates/start.js")


def render(name: str, folder: Path = _HERE / "templates", **content: object) -> str:
    """Returns the page `name`, a template of `folder`, as one self-contained HTML text.

    Text is escaped; `Markup` is not escaped. A template in another folder may extend the templates of this package.
    """
    environment = Environment(
        loader=ChoiceLoader([FileSystemLoader(folder), PackageLoader("brickpilot.report")]),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
    )
    environment.filters |= {name: getattr(quantities, name) for name in _FILTERS}
    environment.filters["role"] = quantities.ROLES.__getitem__
    return environment.get_template(f"{name}.html.j2").render(version=__version__, page=_inlined(), **content)


@cache
def _inlined() -> dict[str, Markup]:
    """Returns the plot library, its licence, and the scripts. Every page contains them, so it needs no other file."""
    library = _HERE / "uplot"
    texts = {
        "library": library / "uPlot.iife.min.js",
        "library_style": library / "uPlot.min.css",
        "licence": library / "LICENSE",
        "style": _HERE / "templates" / "page.css",
    }
    found = {name: Markup(file.read_text(encoding="utf-8").strip()) for name, file in texts.items()}
    return found | {"scripts": Markup("\n").join(Markup((_HERE / one).read_text(encoding="utf-8")) for one in _SCRIPTS)}


def render_plain(template: str, **content: object) -> str:
    """Returns the text of a file for another program, such as a C header; nothing in `template` is escaped."""
    return render_text("report", template, version=__version__, **content)
