"""The command line explains itself: help that is not cut off, effects, settings, suggestions, and completion."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from brickpilot import __version__, catalogue
from brickpilot.cli.main import cli
from brickpilot.hil import ends
from brickpilot.importers import IMPORTERS
from brickpilot.link.session import LOCKSTEP, Session
from brickpilot.vehicle.scenario import packaged
from brickpilot.vehicle.settings import defaults, settings
from click.testing import CliRunner
from command import brickpilot


def groups(command: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    if isinstance(command, click.Group):
        yield path
        for name, below in command.commands.items():
            yield from groups(below, (*path, name))


@pytest.mark.parametrize("path", list(groups(cli)))
@pytest.mark.parametrize("width", [60, 80, 110])
def test_no_line_of_help_is_cut_off(path: tuple[str, ...], width: int) -> None:
    shown = CliRunner().invoke(cli, [*path, "--help"], terminal_width=width)
    assert shown.exit_code == 0
    assert "..." not in shown.output.replace("[ARGS]...", "").replace("FILE...", "")


def test_the_version_is_told(tmp_path: Path) -> None:
    assert brickpilot("--version", cwd=tmp_path).stdout.split()[-1] == __version__


def test_effects_can_be_filtered_by_a_word_and_by_mechanism(tmp_path: Path) -> None:
    def names(*arguments: str) -> list[str]:
        done = brickpilot("effects", *arguments, "--json", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return list(json.loads(done.stdout))

    all_of_them = {effect.name: effect for effect in catalogue.effects()}
    gears = [name for name, effect in all_of_them.items() if effect.mechanism == "gear"]
    assert names("--mechanism", "gear") == gears
    found = names("Friction")
    assert {name for name in all_of_them if "friction" in name} <= set(found)
    assert all("friction" in name + all_of_them[name].summary.lower() for name in found)
    assert names(gears[0]) == [gears[0]]
    shown = brickpilot("effects", gears[0], cwd=tmp_path).stdout
    assert all_of_them[gears[0]].equation in shown


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("effects", "coulomb_fricton"), "did you mean coulomb_friction"),
        (("effects", "--mechanism", "glue"), "known: timing"),
        (("settings", "hedding_kp"), "did you mean heading_kp"),
        (("upload", "--link", "tcp:127.0.0.1:1", "--set", "spedd_kp=1"), "did you mean speed_kp"),
        (
            ("upload", "--link", "tcp:127.0.0.1:1", "--set", "cruise=0"),
            "it takes 1..32767 (1/16 mm/s), which is 6.25e-05 to",
        ),
    ],
)
def test_a_wrong_name_or_value_is_told_what_would_be_right(
    arguments: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    done = brickpilot(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert says in done.stderr


@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_settings_are_listed_with_what_a_brick_begins_with(profile: str, tmp_path: Path) -> None:
    done = brickpilot("settings", "--profile", profile, "--json", cwd=tmp_path)
    listed = json.loads(done.stdout)
    with ends.both_ends("tcp") as both:
        session = Session(both.link, "tcp")
        session.open(profile, LOCKSTEP)
        held = {name: session.read(name) for name in settings()}
    assert {name: row["raw_default"] for name, row in listed.items()} == held == defaults(profile)
    for name, row in settings().items():
        assert listed[name]["unit"] == row.format.unit
        assert listed[name]["range"] == [row.value(row.low), row.value(row.high)]
        assert listed[name]["meaning"] == row.meaning


def test_settings_are_a_line_each(tmp_path: Path) -> None:
    head, *lines = brickpilot("settings", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(settings())
    assert head.split()[:3] == ["setting", "default", "range"]
    (cruise,) = (line for line in lines if line.startswith("cruise"))
    assert " 0.4  6.25e-05 to 2.048 m/s " in cruise
    found = brickpilot("settings", "deceleration", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in found[1:]] == ["decel"]


@pytest.mark.parametrize(
    ("words", "offers"),
    [
        ("brickpilot ru", ["run"]),
        ("brickpilot run ", list(packaged())),
        ("brickpilot run --scenario mis", ["mission"]),
        ("brickpilot effects coulomb", ["coulomb_friction"]),
        ("brickpilot calibrate x --effects gear_b", ["gear_backlash"]),
        ("brickpilot effects --mechanism ge", ["gear"]),
        ("brickpilot settings heading_k", ["heading_kp", "heading_ki", "heading_kd"]),
        ("brickpilot upload --set cru", ["cruise="]),
        ("brickpilot import ", [row.kind for row in IMPORTERS]),
        ("brickpilot import --kind mat", ["matlab"]),
        ("brickpilot import matlab mat", ["file,mat"]),
    ],
)
def test_the_shell_completes(words: str, offers: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("_BRICKPILOT_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
    done = brickpilot(cwd=tmp_path, timeout=60)
    assert [line.removeprefix("plain,") for line in done.stdout.split()] == offers, done.stderr
