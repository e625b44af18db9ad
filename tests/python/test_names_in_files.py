"""Names and paths in a file cannot run code, lead out of a folder, or read a file elsewhere."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path

import pytest
from brickpilot.campaign import file as campaign_file
from brickpilot.errors import InputError
from brickpilot.firmware import boards, robot
from brickpilot.vehicle import compensation, gains, model, scenario
from brickpilot.vehicle.fixed_point import comment

ROOT = Path(__file__).parents[2]
CODE = "x*/__attribute__((constructor))static void planted(void){}/*"
MODEL = 'name = "{}"\nvehicle = "diff_drive"\nprofile = "coupled"\n'
BAD_NAMES = (
    "x/../../escaped",
    "/tmp/escaped",
    ".",
    "..",
    ".hidden",
    "a\\\\b",
    "a\\nb",
    "a\\u001bb",
    " ",
    "x" * 201,
    CODE,
)


def code_of(header: Path) -> str:
    """Returns a header's preprocessed code, without the files that it includes."""
    lines = [line for line in header.read_text(encoding="utf-8").splitlines() if not line.startswith("#include")]
    asked = ["cc", "-E", "-P", "-DSTEP_MS=9", "-Wall", "-Werror", "-x", "c", "-"]
    return subprocess.run(asked, input="\n".join(lines), check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_name_that_is_no_part_of_a_file_name_is_refused(name: str, tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(MODEL.format(name))
    with pytest.raises(InputError, match=r"model.toml:1: name: ") as error:
        model.load(file)
    assert str(error.value).isprintable()
    for load in (gains.load, compensation.load):
        with pytest.raises(InputError):
            load(file)


@pytest.mark.parametrize("text", [CODE, "*/", "/*", "*/*/", "/*/", "**//", "a */ b /* c", "*", "/", "ordinary"])
def test_nothing_in_a_text_ends_a_comment_of_c(text: str) -> None:
    asked = ["cc", "-E", "-P", "-Wall", "-Werror", "-x", "c", "-"]
    left = subprocess.run(asked, input=comment(text), check=True, capture_output=True, text=True).stdout
    assert left.strip() == ""
    assert comment("ordinary") == "/* ordinary */"


def test_a_title_and_a_name_stay_comments_of_the_generated_headers(tmp_path: Path) -> None:
    """The name of a robot is escaped even if no check of a file has seen this name."""
    own = robot.load(robot.RCX)
    own = dataclasses.replace(own, model=dataclasses.replace(own.model, name=CODE))
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), title=CODE)
    boards.write_headers(own, mission, boards.BOARDS["template"], 0.009, tmp_path, ROOT)
    for name in ("mission.h", "params_gen.h"):
        assert "planted" not in code_of(tmp_path / "app" / name)


def campaign(folder: Path, line: str) -> Path:
    """Writes a campaign that names another file, in a folder of its own."""
    inside = folder / "inside"
    inside.mkdir()
    (folder / "outside.toml").write_text(scenario.packaged()["mission"].read_text())
    (inside / "link.toml").symlink_to(folder / "outside.toml")
    (inside / "campaign.toml").write_text(f'[campaign]\nname = "c"\nruns = 2\n{line}\n')
    return inside / "campaign.toml"


@pytest.mark.parametrize("key", ["scenario", "model", "gains", "compensation"])
@pytest.mark.parametrize("path", ["../outside.toml", "{folder}/outside.toml", "link.toml", "sub/../../outside.toml"])
def test_a_path_in_a_campaign_stays_in_its_folder(key: str, path: str, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    file = campaign(folder, f'{key} = "{path.format(folder=folder)}"')
    (file.parent / "sub").mkdir()
    with pytest.raises(InputError, match=rf"campaign.toml:4: campaign.{key}: .* is outside this file's folder"):
        campaign_file.load(file)


def test_a_file_in_the_campaigns_folder_is_read(tmp_path: Path) -> None:
    file = campaign(tmp_path, 'scenario = "own.toml"')
    (file.parent / "own.toml").write_text(scenario.packaged()["mission"].read_text())
    assert campaign_file.load(file).scenarios[0].kind == "mission"
