"""Reads the figures of the HTML pages that the commands write, and checks that these pages load no file."""

from __future__ import annotations

import json
import re
from typing import Any

HOSTILE = "<script>alert(1)<!--"
"""A hostile name: its slash makes it no file name, and HTML would take it for markup."""

FAULTY = """
kind = "mission"
duration_s = 4
waypoints_m = [[0.3, 0]]
[[faults]]
kind = "corrupt"
rate = 0.02
from_s = 1.0
to_s = 1.2
"""
"""A scenario without its name: a short flight with damaged messages."""

_PLOT = re.compile(r'<div class="plot"[^>]*aria-label="([^"]*)"[^>]*><script type="application/json">(.*?)</script>')


def figures(page: str) -> dict[str, dict[str, Any]]:
    """Returns accessible name -> description of each figure of a page, in order; raises if a name occurs twice."""
    found = _PLOT.findall(page)
    assert len(dict(found)) == len(found) == page.count('class="plot"')
    return {name: json.loads(text) for name, text in found}


def curves(figure: dict[str, Any]) -> dict[str, list[float | None]]:
    """Returns "panel: curve" -> values of a figure."""
    return {f"{panel['label']}: {one['name']}": one["values"] for panel in figure["panels"] for one in panel["curves"]}


def assert_self_contained(page: str) -> None:
    """Fails if the page loads anything, or has scripts other than the library, its own script and its figures."""
    assert not re.search(r"<(?:link|img|iframe|object|embed|base)\b", page)
    outside = page.split("<script>\n")[0]  # the library and the page's own script follow
    assert not re.search(r'\b(?:src|srcset|poster|data|action)="', outside)
    assert not re.search(r'href="(?!#|[\w.]+")', outside)
    assert not re.search(r"url\((?!#)|@import", page)
    assert page.count("<script") == page.count("</script") == 2 + page.count('class="plot"')
    assert not re.search(r"\bfetch\(|XMLHttpRequest|\bimport\(|WebSocket|sendBeacon", page)
