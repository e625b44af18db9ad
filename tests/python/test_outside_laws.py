"""The odd laws of the hidden data are not in the library: no single effect of the library explains their data."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from hidden import effects
from lab import nearest_laws
from lab.nearest_laws import Nearest

MAKE = "make the table again: PYTHONPATH=tests .venv/bin/python -m lab.nearest_laws --write"
FACTOR, LEAST = 1.5, 0.05  # allowed ratio of a figure to the table's figure; figures below LEAST count as LEAST

STATED, SETS = nearest_laws.stated(), nearest_laws.sets()


def contradiction(found: Nearest, stated: Nearest) -> str:
    """Returns how the measurement `found` contradicts the row `stated` of the table; "": they agree."""
    what = f"{found.odd}: {found.law} leaves {found.left:.2g} noise variances of its {found.error:.3g}"
    if not found.is_beyond_noise and stated.is_beyond_noise:
        return f"{what}, which noise hides: it is no odd law. Put another law in its place, or state it: {MAKE}"
    away = max(found.left, LEAST) / max(stated.left, LEAST)
    if found.is_beyond_noise != stated.is_beyond_noise or not 1 / FACTOR < away < FACTOR:
        return f"{what}, but the table says {stated.left:.2g} by {stated.law}: {MAKE}"
    return ""


def test_the_table_has_each_odd_law_and_says_which_are_beyond_noise() -> None:
    assert list(STATED) == list(effects.ODD) == [name for one in SETS for name in one.hidden], MAKE
    rows = nearest_laws.README.read_text(encoding="utf-8").splitlines()
    for name, one in STATED.items():
        [row] = [row for row in rows if row.startswith(f"| `{name}` |") and row.count("|") == 7]
        assert row.endswith("| yes |" if one.is_beyond_noise else "| no |"), MAKE


@pytest.mark.parametrize("recipe", SETS, ids=[one.name for one in SETS])
def test_no_effect_of_the_library_explains_an_odd_law_unless_the_table_says_so(recipe) -> None:
    found = nearest_laws.nearest(recipe)
    said = contradiction(found, STATED[found.odd])
    assert not said, said


def test_an_effect_of_the_library_in_place_of_an_odd_law_is_found() -> None:
    drag = next(one for one in SETS if "odd_cubic_drag" in one.hidden)
    found = nearest_laws.nearest(replace(drag, hidden={"quadratic_drag": {"drag": 6.0}}))
    assert found.law == "quadratic_drag"
    said = contradiction(replace(found, odd="odd_cubic_drag"), STATED["odd_cubic_drag"])
    assert "odd_cubic_drag: quadratic_drag leaves" in said
    assert "it is no odd law" in said
