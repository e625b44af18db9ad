"""`brickpilot firmware --board avr` makes a robot's image for an AVR chip, and an Arduino library of the firmware."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
from pathlib import Path

import arduino_build
import numpy as np
import pytest
from brickpilot.firmware import robot, simulate
from brickpilot.hil import avr_flight
from brickpilot.vehicle import flight
from command import brickpilot
from test_firmware import OWN, make, route, write

SHORT_S = 3.2  # duration of a flight on simavr, s: the rest at the start, and more than a second of driving


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder that `brickpilot firmware` makes of the robot `middle`, for an ATmega328P with encoders."""
    parent = tmp_path_factory.mktemp("avr")
    done = make(parent / "made", write(parent, "middle", OWN["middle"]), "avr", "--sensors", "imu+encoders")
    assert (done.returncode, done.stderr) == (0, "")
    return parent / "made"


def there_and_back(folder: Path) -> str:
    """Writes a scenario and returns its path: a leg, half a turn and a leg twice as long.

    At the end of this route, a scale error of a few per cent is visible.
    """
    return str(route(folder, 12.0, (0.4, 0.0), (-0.4, 0.05)))


def plan(folder: Path) -> flight.Plan:
    own = robot.load(folder.parent / "middle.toml")
    planned = simulate.plan(own, simulate.mission(own, None), "imu+encoders", 0)
    return dataclasses.replace(planned, steps=round(SHORT_S / 0.003))


def fly(image: Path, planned: flight.Plan) -> flight.Flight:
    flown = avr_flight.fly(planned, "avr:328p-rotation", image, telemetry_every=10, progress=lambda *_: None)
    assert (flown.broke_off, flown.late_ticks) == (None, 0)
    return flown.flight


def test_the_robot_flies_all_waypoints_and_its_image_fits(made: Path) -> None:
    figures = json.loads((made / "firmware.json").read_text())
    assert figures["flight"]["waypoints_reached"] == 8
    assert figures["step_s"] == 0.003
    assert figures["bytes"]["flash"] < figures["bytes"]["flash_of_chip"] == 32768
    assert figures["bytes"]["ram"] < figures["bytes"]["ram_of_chip"] == 2048
    assert (made / "brickpilot.hex").read_text().startswith(":10000000")
    image, model = made / "brickpilot.elf", made.parent / "middle.toml"
    assert figures["fly"] == f"brickpilot hil --image {image} --model {model}"


def hil(*options: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return brickpilot("hil", *options, "--json", cwd=cwd)


def test_ones_own_image_flies_with_its_model_and_its_own_wiring(tmp_path: Path) -> None:
    model, short = write(tmp_path, "small", OWN["small"]), there_and_back(tmp_path)
    done = make(tmp_path / "made", model, "avr", "--sensors", "imu+encoders", "--scenario", short)
    assert done.returncode == 0, done.stderr
    fly = json.loads(done.stdout)["fly"]
    image = tmp_path / "made/brickpilot.elf"
    assert fly == f"brickpilot hil --image {image} --model {model} --scenario {short}"
    wiring = (tmp_path / "made/include/avr/board.h").read_text()
    assert "PER_COUNT_Q8 8725" in wiring  # a gyro with a range of 1000 deg/s
    assert "every edge counts, 120 counts a turn of the wheel." in wiring
    flown = hil(*fly.split()[2:], cwd=tmp_path)
    figures = json.loads(flown.stdout)
    assert (flown.returncode, figures["waypoints_reached"], figures["link"]) == (0, 2, "avr:328p-rotation"), (
        flown.stderr
    )
    assert figures["image"] == str(image)  # `import` reads here that another robot flew
    assert figures["closest_approach_m"] == pytest.approx(
        json.loads((tmp_path / "made/firmware.json").read_text())["flight"]["closest_approach_m"], abs=0.005
    )


def test_an_image_for_a_digital_imu_flies_with_it(tmp_path: Path) -> None:
    model = write(tmp_path, "middle", OWN["middle"])
    done = make(tmp_path / "made", model, "avr", "--imu", "lsm6ds", "--scenario", there_and_back(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "#define BOARD_IMU BOARD_LSM6DS" in (tmp_path / "made/include/avr/board.h").read_text()
    library = tmp_path / "made/arduino/Brickpilot/src/avr"
    assert "#define BOARD_IMU BOARD_LSM6DS" in (library / "board.h").read_text()
    assert {"twi.c", "digital.c"} <= {file.name for file in library.iterdir()}
    fly = json.loads(done.stdout)["fly"]
    figures = json.loads(hil(*fly.split()[2:], cwd=tmp_path).stdout)
    assert (figures["waypoints_reached"], figures["link"]) == (2, "avr:328p-imu")
    assert "--imu lsm6ds" in (tmp_path / "made/README.md").read_text()


@pytest.mark.parametrize(
    ("board", "gyro_range", "says"),
    [("rcx", None, "rcx reads no IMU on I2C"), ("avr", 20.0, "20 is beyond the 17.45 of an IMU on I2C")],
)
def test_a_digital_imu_that_cannot_be_is_one_line(
    board: str, gyro_range: float | None, says: str, tmp_path: Path
) -> None:
    text = OWN["middle"] + ("" if gyro_range is None else f"\n[sensors.imu]\ngyro_range = {gyro_range}\n")
    done = make(tmp_path / "made", write(tmp_path, "middle", text), board, "--imu", "mpu6050")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert says in done.stderr


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--image", "made/brickpilot.elf"), "--image: needs --model"),
        (("--image", "made/brickpilot.hex", "--model", "middle.toml"), "is nothing that hil flies of the board avr"),
        (("--image", "made/host.elf", "--model", "middle.toml"), "is nothing that hil flies of the board avr"),
        (("--image", "middle.toml", "--model", "middle.toml"), "stands in no folder of `brickpilot firmware`"),
        (("--image", "made/none.elf", "--model", "middle.toml"), "no such file"),
        (("--image", "made/brickpilot.elf", "--model", "middle.toml", "--sensors", "imu"), "was made for imu+encoders"),
        (
            ("--image", "made/brickpilot.elf", "--model", "middle.toml", "--target", "h8sim"),
            "--target h8sim: cannot be used",
        ),
        (("--image", "made/brickpilot.elf", "--model", "middle.toml", "--gains", "g.toml"), "--gains: cannot be used"),
    ],
)
def test_an_image_that_cannot_be_flown_so_is_one_line(options: tuple[str, ...], says: str, made: Path) -> None:
    (made / "host.elf").write_bytes(b"\x7fELF".ljust(18, b"\0") + b"\x3e\0")  # an ELF file for x86-64
    done = hil(*options, cwd=made.parent)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert says in done.stderr


@pytest.fixture(scope="module")
def arduino(made: Path) -> tuple[Path, Path]:
    """Builds the library's example with the build commands of Arduino's core; returns its ELF file and its HEX file."""
    assert arduino_build.CORE.is_dir(), "needs arduino-core-avr: sh tests/run installs it"
    library = made / "arduino/Brickpilot"
    return arduino_build.build(library, library / "examples/Mission/Mission.ino", made.parent / "arduino")


def test_the_library_is_built_by_arduinos_recipes_and_has_no_fuses(arduino: tuple[Path, Path]) -> None:
    elf, image = arduino
    sections = subprocess.run(["avr-size", "-A", elf], capture_output=True, text=True, check=True).stdout
    sizes = {name: int(size) for name, size in re.findall(r"^\.(\w+) +(\d+)", sections, re.MULTILINE)}
    assert "fuse" not in sizes
    assert sizes["text"] + sizes["data"] < 32768 - 512  # 512 bytes for the boot loader
    assert sizes["data"] + sizes["bss"] < 2048 - 400
    types = [line[7:9] for line in image.read_text().split()]
    assert types == ["00"] * (len(types) - 1) + ["01"]  # records for data below 64 KB, then the end record


def test_the_image_and_the_library_drive_the_robot_on_simavr_as_the_simulation_does(
    made: Path, arduino: tuple[Path, Path]
) -> None:
    planned = plan(made)
    simulated = np.loadtxt(made / "flight/log.csv", delimiter=",", skiprows=1, max_rows=planned.steps)
    names = (made / "flight/log.csv").read_text().split("\n", 1)[0].split(",")
    ahead = simulated[:, names.index("true_x_m")], simulated[:, names.index("true_y_m")]
    gone = np.hypot(ahead[0][-1], ahead[1][-1])
    assert gone > 0.1
    for image in (made / "brickpilot.elf", arduino[0]):
        log = fly(image, planned).log
        apart = np.hypot(log["true_x_m"] - ahead[0], log["true_y_m"] - ahead[1])
        assert apart.max() < 0.1 * gone


def test_the_librarys_layout_is_that_of_arduino_and_platformio(made: Path) -> None:
    library = made / "arduino/Brickpilot"
    rows = dict(line.split("=", 1) for line in (library / "library.properties").read_text().splitlines())
    required = {"name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures"}
    assert required <= rows.keys()
    assert (rows["name"], rows["architectures"], rows["category"]) == ("Brickpilot", "avr", "Device Control")
    assert re.fullmatch(r"\d+\.\d+\.\d+", rows["version"])
    manifest = json.loads((library / "library.json").read_text())
    assert (manifest["name"], manifest["version"]) == (rows["name"], rows["version"])
    assert (manifest["frameworks"], manifest["platforms"]) == ("arduino", "atmelavr")
    assert (library / "src" / manifest["headers"]).is_file()
    assert (library / "src" / rows["includes"]).is_file()
    for example in manifest["examples"]:
        for name in example["files"]:
            assert (library / example["base"] / name).is_file()
            assert Path(name).stem == Path(example["base"]).name  # else the Arduino IDE does not open the example
    sources = [path for path in library.rglob("*.[ch]") if path.parent != library]
    assert all(path.is_relative_to(library / "src") for path in sources)  # src/ is the only include path
    known = {path.relative_to(library / "src").as_posix() for path in sources}
    for path in sources:
        for included in re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE):
            assert included in known, f"{path.name}: {included}"
