"""`firmware --board rcx` writes an image for the simulator of the RCX's processor, and `hil` flies this image."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from brickpilot.vehicle.settings import settings
from command import brickpilot
from test_firmware import corner, make, write

# The robot of tools/docs/guides/my_robot.md, with an IMU whose range differs from the packaged IMU's.
ROBOT = """
[parameters]
mass = 1.2
wheel_radius = 0.033
half_track = 0.08
battery_voltage = 7.4
[sensors.imu]
gyro_range = { value = 17.45, unit = "rad/s", basis = "1000 degrees/s" }
"""


def hil(*options: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return brickpilot("hil", *options, "--json", cwd=cwd)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder that `firmware` made for an RCX; `robot.toml` and `route.toml` are beside this folder."""
    parent = tmp_path_factory.mktemp("rcx")
    done = make(parent / "made", write(parent, "robot", ROBOT), "rcx", "--scenario", str(corner(parent)))
    assert (done.returncode, done.stderr) == (0, "")
    return parent / "made"


def test_ones_own_firmware_flies_on_the_rcx_processor_as_in_simulation(made: Path) -> None:
    told = json.loads((made / "firmware.json").read_text())
    route, model = made.parent / "route.toml", made.parent / "robot.toml"
    assert told["fly"] == f"brickpilot hil --image {made / 'brickpilot.h8sim'} --model {model} --scenario {route}"
    assert f"On a simulator of the RCX's processor: `{told['fly']}`" in (made / "README.md").read_text()
    flown = hil(*told["fly"].split()[2:], cwd=made.parent)  # a folder without a checkout
    figures = json.loads(flown.stdout)
    assert (flown.returncode, figures["waypoints_reached"], figures["final_mode"]) == (0, 2, "arrived"), flown.stderr
    assert (figures["link"], figures["lost_frames"]) == ("h8sim:imu", 0)
    assert figures["motor_stream_sha256"] == told["flight"]["motor_stream_sha256"]
    page = (made.parent / "runs/hil-route-coupled-imu/report.html").read_text(encoding="utf-8")
    assert f"--image {made / 'brickpilot.h8sim'}" in page


def test_its_settings_are_the_robots_own(made: Path) -> None:
    image = ("--image", str(made / "brickpilot.h8sim"), "--model", str(made.parent / "robot.toml"))
    own = json.loads(hil(*image, "--settings", cwd=made.parent).stdout)
    cruise = json.loads((made / "firmware.json").read_text())["flight"]["cruise_m_s"]
    assert own["cruise"] == settings()["cruise"].raw(cruise)


def test_build_sh_makes_the_same_image_again(made: Path) -> None:
    root = Path(__file__).parents[2]
    subprocess.run(["sh", made / "build.sh", root, made / "image"], capture_output=True, check=True)
    assert (made / "image/brickpilot.h8sim").read_bytes() == (made / "brickpilot.h8sim").read_bytes()


@pytest.mark.parametrize(
    ("image", "says"),
    [
        ("made/brickpilot.srec", "is nothing that hil flies of the board rcx; it flies an Arduino's ELF file and"),
        ("made/brickpilot.lx", "is nothing that hil flies of the board rcx"),
        ("made/empty.h8sim", "is nothing that hil flies of the board rcx"),
        ("made/avr.elf", "is nothing that hil flies of the board rcx"),
        ("alone.h8sim", "stands in no folder of `brickpilot firmware`"),
        ("made/none.h8sim", "no such file"),
    ],
)
def test_a_file_that_is_no_such_image_is_one_line(image: str, says: str, made: Path) -> None:
    (made / "empty.h8sim").write_bytes(b"")
    (made / "avr.elf").write_bytes(b"\x7fELF".ljust(18, b"\0") + b"\x53\0")
    (made.parent / "alone.h8sim").write_bytes((made / "brickpilot.h8sim").read_bytes())
    done = hil("--image", image, "--model", "robot.toml", cwd=made.parent)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(f"brickpilot: {image}: ")
    assert says in done.stderr
