"""Renders the package's templates: pages, and files of other programs."""

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


def render_plain(template: str, **content: object) -> str:
    """Returns the file `template` of another program, such as a C header; nothing is escaped."""
    environment = Environment(
        loader=PackageLoader("brickpilot.report"),
        autoescape=False,  # it writes no HTML
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(f"{template}.j2").render(version=__version__, **content)
