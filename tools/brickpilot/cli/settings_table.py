"""`brickpilot settings`, and the table of settings that `brickpilot hil --settings` prints too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import click

from brickpilot.cli.terminal import as_json, profile_option, setting_names, show
from brickpilot.errors import InputError, did_you_mean


@click.command(short_help="Lists the firmware's settings: unit, range, default, meaning.")
@click.argument("word", metavar="[WORD]", required=False, shell_complete=setting_names)
@profile_option("The profile whose defaults are shown.", "coupled")
@as_json
def settings(word: str | None, profile: str, as_json: bool) -> None:
    """Lists the settings of the firmware: unit, range, default and meaning; with WORD, only settings with this word.

    The column "raw" holds the integers that `--set NAME=VALUE` of `hil` and `upload` takes.
    """
    from brickpilot.vehicle.settings import defaults
    from brickpilot.vehicle.settings import settings as rows

    chosen = {name for name, row in rows().items() if word is None or word in name or word.lower() in row.meaning}
    if not chosen:
        raise InputError(f"no setting has this word{did_you_mean(str(word), rows())}", field=word)
    values = {name: raw for name, raw in defaults(profile).items() if name in chosen}
    show({name: _entry(name, raw) for name, raw in values.items()}, setting_lines(values, "default"), as_json=as_json)


def setting_lines(values: Mapping[str, int], title: str) -> Iterator[str]:
    """Yields a table of the settings in `values` (name -> raw integer); `title` heads the column of their SI values."""
    from brickpilot.vehicle.settings import named

    yield f"{'setting':16} {title:>10}  {'range':30} {'raw: value, range':>26}  meaning"
    for name, raw in values.items():
        row = named(name)
        shown, meaning = f"{raw}, {row.range}", f"{row.meaning} (raw: {row.format.text})"
        yield f"{name:16} {row.value(raw):>10.4g}  {row.range_in_unit:30} {shown:>26}  {meaning}"


def _entry(name: str, raw: int) -> dict[str, Any]:
    from brickpilot.vehicle.settings import named

    row = named(name)
    return {
        "default": row.value(raw), "unit": row.format.unit, "range": [row.value(row.low), row.value(row.high)],
        "raw_default": raw, "raw_range": [row.low, row.high], "raw_format": row.format.text, "meaning": row.meaning,
        "compensation": bool(row.compensation),
    }  # fmt: skip
