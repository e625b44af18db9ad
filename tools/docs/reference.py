"""Stages the reference pages: each is made from the one place where its facts stand."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import brickpilot
import click
from brickpilot import catalogue
from brickpilot.catalogue import EffectInfo, ParameterInfo
from brickpilot.cli import main
from brickpilot.data.signals import SIGNALS
from brickpilot.importers import IMPORTERS
from brickpilot.vehicle.settings import defaults, settings

MANY = 12
"""An effect with more parameters shows them on demand."""


FILES = (
    "data.description",
    "vehicle.model",
    "vehicle.scenario",
    "campaign.file",
    "vehicle.gains",
    "vehicle.compensation",
)
"""The readers of the files that a user writes: the docstring of each is the manual of its file."""


def stage(root: Path, pages: Path) -> None:
    """Writes the reference pages below `pages`."""
    written = {
        "index.md": index_page(),
        "files.md": files_page(),
        "verdict.md": verdict_page(),
        "rooms.md": rooms_page(),
        "python.md": python_page(),
        "effects.md": effects_page(),
        "settings.md": settings_page(),
        "glossary.md": glossary_page((root / "CONTRIBUTING.md").read_text(encoding="utf-8")),
        **dict(command_pages()),
    }
    for name, text in written.items():
        path = pages / "reference" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def index_page() -> str:
    """Returns the page that leads to the others."""
    pages = ("commands/index", "python", "files", "verdict", "effects", "settings", "c/index", "rooms")
    intro, entries = "Each page is made from the code, where what it says stands once.", "\n".join(pages)
    return f"# Reference\n\n{intro}\n\n```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n"


def files_page() -> str:
    """Returns the page of the files that a user writes, with the signals, the nominal values and the kinds of log."""
    parts = ["# Files\n\nWhat stands in each file that you write, as its reader says it."]
    for name in FILES:
        title, _, text = (inspect.getdoc(importlib.import_module(f"brickpilot.{name}")) or "").partition("\n")
        heading, _, more = title.rstrip(".").partition(": ")
        parts += [f"## {heading}", f"{more[:1].upper()}{more[1:]}.", _fenced(text)]
    signals = ((f"`{name}`", one.kind, one.unit, ", ".join(sorted(one.vehicles))) for name, one in SIGNALS.items())
    parts += ["## Signals", table(("signal", "kind", "SI unit", "vehicle"), signals)]
    nominal = ((f"`{one.name}`", one.unit, f"{one.minimum:g} to {one.maximum:g}", _plain(one.meaning))
               for one in catalogue.parameters())  # fmt: skip
    parts += ["## Nominal values", table(("parameter", "unit", "range", "meaning"), nominal)]
    logs = ((f"`{one.kind}`", " ".join(one.suffixes), _plain(one.help)) for one in IMPORTERS)
    parts += ["## Logs", table(("kind", "endings", "what"), logs)]
    return "\n\n".join(parts) + "\n"


def _fenced(manual: str) -> str:
    """Returns a manual with its indented lines as a block of TOML."""
    block = re.compile(r"(?:^ {4}.*\n(?:\n+(?= {4}))?)+", re.MULTILINE)
    return block.sub(lambda found: f"```toml\n{inspect.cleandoc(found[0])}\n```\n", f"{manual}\n").strip()


def verdict_page() -> str:
    """Returns the page of `verdict.json`, made of its schema: every key that the schema describes."""
    schema = json.loads(resources.files("brickpilot").joinpath("report/verdict.schema.json").read_text("utf-8"))
    parts = [f"# `verdict.json`\n\n{_plain(schema['description'])} `discover --json` prints the same."]
    apart = {name: part for name, part in schema["$defs"].items() if any(_keys(part, ()))}
    parts.append(table(("key", "means"), _keys(schema, apart)))
    for name, part in apart.items():
        parts += [f"## {name}", _plain(part.get("description")), table(("key", "means"), _keys(part, apart))]
    return "\n\n".join(parts) + "\n"


def _keys(part: Any, apart: Collection[str], above: str = "") -> Iterator[tuple[str, str]]:
    """Yields the described keys of a part of a schema, and what each means; those `apart` have tables of their own."""
    for key, one in part.get("properties", {}).items():
        forms = [one, *one.get("oneOf", ()), *one.get("anyOf", ())]
        held = [form for each in forms for form in (each, each.get("items"), each.get("additionalProperties"))]
        name = f"{above}{key}"
        shown = sorted({form["$ref"].rpartition("/")[2] for form in held if isinstance(form, dict) and "$ref" in form})
        see = "".join(f" See [{other}](#{other})." for other in shown if other in apart)
        if one.get("description") or see:
            yield f"`{name}`", f"{_plain(one.get('description'))}{see}".strip()
        for form in held:
            if isinstance(form, dict):
                yield from _keys(form, apart, f"{name}.")


def rooms_page() -> str:
    """Returns the page of the rooms of the package: what each says of itself."""
    parts = ["# Rooms of the package\n\nWhat each folder of `tools/brickpilot` says of itself."]
    for room in pkgutil.walk_packages(brickpilot.__path__, "brickpilot."):
        if room.ispkg:
            parts += [f"## `{room.name}`", _room(room.name)]
    return "\n\n".join(parts) + "\n"


def _room(name: str) -> str:
    """Returns the docstring of a room, from its file, as some names are a function's, too; a list of files is code."""
    source = Path(brickpilot.__path__[0], *name.split(".")[1:], "__init__.py").read_text(encoding="utf-8")
    text = inspect.cleandoc(source.split('"""')[1])
    return re.sub(r"^(\w+\.py +)", r"    \1", text, flags=re.MULTILINE)


def command_pages() -> Iterator[tuple[str, str]]:
    """Yields the file and the text of each command's page, made of its help, and of their index."""
    names = {command: name for name, command in vars(main).items() if isinstance(command, click.Command)}
    for command in main.COMMANDS:
        directive = (
            f".. click:: {main.__name__}:{names[command]}\n   :prog: brickpilot {command.name}\n   :nested: full"
        )
        yield f"commands/{command.name}.md", f"```{{eval-rst}}\n{directive}\n```\n"
    entries = "\n".join(f"{command.name}" for command in main.COMMANDS)
    lines = "\n".join(f"- [`brickpilot {one.name}`]({one.name}.md): {_plain(one.short_help)}" for one in main.COMMANDS)
    yield "commands/index.md", f"# Commands\n\n{lines}\n\n```{{toctree}}\n:hidden:\n\n{entries}\n```\n"


def python_page() -> str:
    """Returns the page of the public face: the docstring of the package, then each name with its own."""
    blocks = []
    for name in brickpilot.__all__:
        if name.startswith("_") or name == "discover_effects":
            continue
        module, _, attribute = {**brickpilot._NAMES, **brickpilot._CALLS}[name].partition(":")
        kind = _kind(getattr(brickpilot, name))
        members = "   :members:\n" if kind == "autoclass" else ""
        blocks.append(f"## bp.{name}\n\n```{{eval-rst}}\n.. {kind}:: {module}.{attribute}\n{members}```\n")
    tour = "```{eval-rst}\n.. automodule:: brickpilot\n   :no-members:\n```\n"
    return "\n".join(["# Python\n", tour, *blocks])


def _kind(thing: object) -> str:
    if isinstance(thing, type):
        return "autoexception" if issubclass(thing, Exception) else "autoclass"
    return "autofunction"


def effects_page() -> str:
    """Returns the page of the effects by mechanism, made of the plant's table."""
    known = catalogue.effects()
    parts = [f"# Effects\n\n{len(known)} effects can be switched on in the plant. Each stands once, in its own C file."]
    for mechanism in dict.fromkeys(effect.mechanism for effect in known):
        parts.append(f"## {mechanism.capitalize()}")
        parts += [_effect(effect) for effect in known if effect.mechanism == mechanism]
    return "\n\n".join(parts) + "\n"


def _links(names: Sequence[str]) -> str:
    return ", ".join(f"[`{one}`](#{one})" for one in names)


def _effect(effect: EffectInfo) -> str:
    lines = [f"### `{effect.name}`", _plain(effect.summary)]
    if effect.variant_of:
        lines.append(f"A variant of [`{effect.variant_of}`](#{effect.variant_of}), but {_plain(effect.variation)}.")
    lines.append(f"```text\n{effect.equation}\n```")
    lines.append(f"It acts on: {effect.acts_on}. Source: {_plain(effect.source)}.")
    lines.append(f"Prior: {effect.prior}. {_plain(effect.prior_reason)}")
    if effect.advice:
        lines.append(f"What to do: {_plain(effect.advice)}")
    if effect.contains:
        lines.append(f"It contains {_links(effect.contains)}.")
    if effect.made_of:
        lines.append(f"{_links(effect.made_of)} together are the same law.")
    head = ("parameter", "role", "unit", "range", "preset", "meaning")
    rows = table(head, (_parameter(one) for one in effect.parameters))
    if len(effect.parameters) > MANY:
        rows = f"<details><summary>Its {len(effect.parameters)} parameters</summary>\n\n{rows}\n\n</details>"
    return "\n\n".join([*lines, rows] if effect.parameters else lines)


def _parameter(one: ParameterInfo) -> tuple[str, ...]:
    span = f"{one.minimum:g} to {one.maximum:g}"
    return f"`{one.name}`", one.role, one.unit, span, f"{one.preset:g}", _plain(one.meaning)


def settings_page() -> str:
    """Returns the page of the firmware's settings, with the defaults of both profiles."""
    coupled, paper = defaults("coupled"), defaults("paper")
    rows = (
        (f"`{name}`", f"{row.value(coupled[name]):.4g}", f"{row.value(paper[name]):.4g}", row.range_in_unit,
         f"{row.range} ({row.format.text})", _plain(row.meaning))
        for name, row in settings().items()
    )  # fmt: skip
    head = ("setting", "coupled", "paper", "range", "raw range", "meaning")
    intro = (
        "# Settings\n\nWhat a host may change while the brick is on: `brickpilot hil --set NAME=VALUE` and "
        "`brickpilot upload --set NAME=VALUE` write the raw integer."
    )
    return f"{intro}\n\n{table(head, rows)}\n"


def glossary_page(contributing: str) -> str:
    """Returns the glossary, made of the table of words in CONTRIBUTING.md.

    Raises:
        ValueError: the table is not there.
    """
    section = contributing.partition("\n## Words\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (?!word \|)([^|-][^|]*?) \| (.*) \|$", section, re.MULTILINE)
    if not rows:
        raise ValueError("CONTRIBUTING.md has no table of words")
    blocks = ["\n".join(f"  {term.strip()}" for term in words.split(",")) + f"\n    {text}" for words, text in rows]
    entries = "\n\n".join(sorted(blocks, key=str.lower))
    return f"# Glossary\n\nOne word has one meaning.\n\n```{{eval-rst}}\n.. glossary::\n\n{entries}\n```\n"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Returns a Markdown table."""
    lines = [list(head), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _plain(text: str | None) -> str:
    """Returns words for a Markdown page: a star and a bracket are no markup."""
    return re.sub(r"([*_<>\[\]])", r"\\\1", text or "")
