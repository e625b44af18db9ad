"""Renders templates of texts other than HTML, such as C headers. Each room has its templates in `templates`."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined


def render_text(room: str, template: str, **content: object) -> str:
    """Returns the text of a file for another program; nothing in the template is escaped.

    Args:
        room: the room (subpackage) whose folder `templates` holds the template.
        template: the name of the template without the suffix .j2.
        content: the values that the template names.
    """
    environment = Environment(
        loader=PackageLoader(f"brickpilot.{room}"),
        autoescape=False,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(f"{template}.j2").render(**content)
