"""Renders the package's page templates."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from brickpilot import __version__


def render(name: str, **content: object) -> str:
    """Returns the page `name` as one self-contained HTML text; text is escaped, `Markup` is not."""
    environment = Environment(
        loader=PackageLoader("brickpilot.report"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
    )
    return environment.get_template(f"{name}.html.j2").render(version=__version__, **content)
