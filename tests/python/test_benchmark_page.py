"""The pages of the benchmark have the numbers of the Markdown tables, list wrong results first, and load no file."""

from __future__ import annotations

import copy
import re
from html import unescape

import pytest
from brickpilot.report.quantities import DASH
from command import lab
from lab import page, real_logs, real_results, real_table, table
from lab.page import hidden_page, marked, real_page
from lab.result import RESULTS, append
from lab_results import effect, quick_results, result
from pages import HOSTILE, assert_self_contained, figures


def bodies(page):
    """Returns for each table of a page its rows, each a list of the texts of its cells."""
    found = []
    for body in re.findall(r"<tbody>(.*?)</tbody>", page, re.DOTALL):
        rows = [re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL) for row in re.findall(r"<tr>(.*?)</tr>", body)]
        found.append([[unescape(re.sub(r"<[^>]+>", "", cell)) for cell in row] for row in rows])
    return found


def markdown_rows(lines):
    """Returns the rows of Markdown tables, each a list of cells, without header rows and without back quotes."""
    rows = [
        [cell.strip().replace("`", "") for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")
    ]
    return [row for row, after in zip(rows, [*rows[1:], [""]], strict=True) if not {row[0], after[0]} & {"---"}]


def hidden(results):
    return hidden_page(page.hidden(results, table.table(results)))


def real(kept):
    return real_page(page.real(kept, real_logs.by_name()))


@pytest.fixture(scope="module")
def kept():
    return real_results.load(real_results.KEPT)


def marks(figure):
    """Returns row -> {curve: value of x} of a chart whose vertical axis lists rows."""
    panel = figure["panels"][0]
    found = {name: {} for name in panel["rows"]}
    for curve in panel["curves"]:
        for place, row in zip(figure["x"]["values"], curve["values"], strict=True):
            if row is not None:
                found[panel["rows"][int(row)]][curve["name"]] = place
    return found


def test_hidden_page_has_the_numbers_of_the_markdown_table() -> None:
    results = quick_results()
    wanted = [row[2:] for row in markdown_rows(table.markdown(table.table(results)))]
    page = hidden(results)
    assert len(wanted) > 15
    assert [row[2:-1] for body in bodies(page)[:-1] for row in body] == wanted
    drawn = [place for one in figures(page).values() for row in marks(one).values() for place in row.values()]
    shares = [float(cells[0].removesuffix(" %")) for cells in wanted if cells[0].endswith(" %")]
    assert sorted(drawn) == pytest.approx(sorted(shares), abs=0.05)


def test_figure_shows_intervals_what_is_asked_and_what_is_met() -> None:
    (first, *_) = figures(hidden(quick_results())).values()
    panel = first["panels"][0]
    top = len(panel["rows"]) - 1
    assert panel["rows"][top] == "1  mechanism right"
    assert marks(first)["1  mechanism right"] == {"not met": pytest.approx(66.67, abs=0.01)}
    assert marks(first)["3  first name right, claimed or suspected"] == {
        "nothing asked, or too few sets": pytest.approx(33.33, abs=0.01)
    }
    assert next(span for span in panel["spans"] if span[0] == top)[1:] == pytest.approx([20.77, 93.85], abs=0.01)
    assert next(span for span in panel["asked"] if span[0] == top)[1:] == [95.0, 100.0]
    assert {row for row, *_ in panel["asked"]} < set(range(top + 1))


def test_wrong_sets_come_first_and_their_number_is_that_of_the_claims() -> None:
    results = quick_results()
    rows = bodies(hidden(results))[-1]
    assert len(rows) == len(results)
    assert [row[0].strip() for row in rows[:4]] == [
        f"{one} planar" for one in ("other-b", "same-b", "same-c", "nulls-000")
    ]
    assert [row[3] for row in rows] == ["wrong"] * 3 + ["right"] * 202
    assert rows[1] == ["same-b planar", "x", "yaw_scrub", "wrong", "wrong", "wrong", "5.00", "3.00", "7.5"]
    assert rows[2][3:6] == ["wrong", "right", "wrong"]
    made = {name: {one["what"]: one["value"] for one in made} for name, made in table.table(results)["suites"].items()}
    same = [row for row in rows if "same" in row[0]]
    for column, what in ((4, "mechanism right"), (5, "law right, or said to differ")):
        share = sum(row[column] == "right" for row in same) / len(same)
        assert share == made["same: one effect, by the library's law"][what]


def test_what_makes_a_set_right() -> None:
    assert page.is_right(result(["a"], "named", effect("a")))
    assert not page.is_right(result(["a"], "named", effect("a"), effect("b")))
    null = quick_results()[-1]
    assert page.is_right(null | {"verdict": "unknown"})
    assert not page.is_right(null | {"verdict": "named", "effects": [effect("gyro_bias")]})
    assert not page.is_right(null | {"error": "ValueError: no"})
    nominal = null | {"group": "nominal", "wrong": {"mass": 1.0}}
    assert not page.is_right(nominal)
    assert page.is_right(nominal | {"left_prior": ["mass"]})


def test_long_suites_and_errors_have_a_page_too() -> None:
    broken = result([], "error", name="b", error="InputError: <b>", held_out=dict.fromkeys(("before", "after")))
    page = hidden([result(["a"], "named", effect("a")), broken | {"hidden": None, "visibility": {}}])
    assert "Claims, all" in page
    sets = bodies(page)[-1]
    assert [row[2:4] for row in sets] == [["error: InputError: <b>", "wrong"], ["a", "right"]]
    assert sets[0][-3:-1] == [DASH, DASH]
    assert "<b>" not in page


def test_real_page_has_the_numbers_of_the_markdown_table(kept) -> None:
    known = real_logs.by_name()
    wanted = markdown_rows(real_table.lines(kept, known))
    verdicts, fits = bodies(real(kept))
    assert [row[:-1] for row in verdicts] + fits == wanted
    shares = [real_table.removed(one) for one in real_table.ordered(kept, known)]
    assert [row[-1] for row in verdicts] == ["-" if one is None else f"{100 * one:.0f} %" for one in shares]
    assert sum(one is not None for one in shares) > 5
    changed = copy.deepcopy(kept)
    changed["omni_wheel"]["peers"]["PySINDy"]["held_out"]["pooled"] += 0.2
    assert bodies(real(changed))[1] != fits


def test_real_figures_have_the_numbers_of_the_markdown_table(kept) -> None:
    overview, *logs = figures(real(kept)).values()
    rows = markdown_rows(real_table.lines(kept, real_logs.by_name()))[-len(logs) :]
    columns = {"before": "nominal", "after": "discover"}
    models = {
        columns.get(name, name): k for k, name in enumerate(real_table.FIT_HEAD) if name not in ("log", "attainable")
    }
    assert len(logs) == len(kept)
    for row, figure in zip(rows, logs, strict=True):
        places = marks(figure)
        assert places.keys() == models.keys()
        for model, column in models.items():
            texts = {"held-out runs": row[column].split(" (")[0], "fit runs": row[column].split("(")[-1].strip(")")}
            shown = {
                name: max(float(text.replace("< ", "")), 0.0) for name, text in texts.items() if text[-1].isdigit()
            }
            assert places[model] == pytest.approx(shown, abs=0.06), (row[0], model)
        limit = real_table.FIT_HEAD.index("attainable")
        assert figure["lines"] == pytest.approx([float(row[limit])], abs=0.06)
        judged = {name: next(reversed(places[name].values())) for name in ("nominal", "discover")}
        assert judged.items() <= {key: one for key, one in marks(overview)[row[0]].items() if key in judged}.items()


def test_pages_are_escaped_reproducible_and_load_nothing(kept) -> None:
    name = f"</script>{HOSTILE}"
    hostile = {name: kept["omni_wheel"] | {"name": name}}
    for make, content in ((hidden, quick_results()), (real, hostile), (real, kept)):
        page = make(content)
        assert_self_contained(page)
        assert "<script>alert" not in page
        assert page == make(copy.deepcopy(content))
    assert hidden(quick_results()) == hidden(list(reversed(quick_results())))
    assert marked("a `b` <c>") == "a <code>b</code> &lt;c&gt;"


def test_commands_write_the_page_beside_stored_results(tmp_path, kept) -> None:
    results = [one | {"name": one["name"].replace("/", "")} for one in quick_results()[:5]]
    for one in results:
        append(tmp_path / "out" / RESULTS, one)
    done = lab("discover", "--table", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "report.html").read_text(encoding="utf-8") == hidden(results)
    real_results.save({"omni_wheel": kept["omni_wheel"]}, tmp_path / "real" / "r.json")
    done = lab("real", "--part", "none", "--results", "real/r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "real" / "report.html").read_text(encoding="utf-8") == real({"omni_wheel": kept["omni_wheel"]})
    assert sorted(path.name for path in (tmp_path / "real").iterdir()) == ["r.json", "report.html"]
    (tmp_path / "real" / "report.html").unlink()
    (tmp_path / "real" / "report.html").mkdir()
    done = lab("real", "--part", "none", "--results", "real/r.json", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "report.html: cannot be written" in done.stderr
    assert sorted(path.name for path in (tmp_path / "real").iterdir()) == ["r.json", "report.html"]
