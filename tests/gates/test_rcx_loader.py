"""On the simulated brick, brickOS's kernel receives the RCX's programs from the tools, runs them and ends them."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import struct
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest
from brickpilot.errors import InputError
from brickpilot.flash import image_files, rom
from brickpilot.flash.program import CREATE, DATA, DELETE, RUN, SET_HOST
from brickpilot.link import lnp
from brickpilot.link.lnp import InfraredLink
from brickpilot.link.session import REALTIME, Session
from brickpilot.link.tower import Tower
from rcx_brick import Faults, RcxBrick
from rcx_brickos import BrickOs
from rcx_kernel import PROGRAMS, RUN_BUTTON, Kernel

ROOT = Path(__file__).resolve().parents[2]
BRICKOS = Path("/usr/lib/brickos")
HEAP = 0xADBC, 0xEF28
NINE_VOLTS, LEVEL = 319, 512
STEP_MS = 9

BYTE_S = 0.002
"""Byte time, s, for time-outs only: the pseudo-terminal carries the bytes of the simulator without delay."""
flash = functools.partial(rom.flash_program, progress=lambda *_: None, byte_s=BYTE_S)


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Returns a function: sensors -> the folder with the programs for these sensors, built once."""

    @functools.cache
    def built_for(sensors: str) -> Path:
        folder = tmp_path_factory.mktemp(sensors)
        subprocess.run([ROOT / "firmware/targets/rcx/build", folder, sensors], capture_output=True, check=True)
        return folder

    return built_for


@pytest.fixture(params=["imu", "rotation"])
def built(build: Callable[[str], Path], request: pytest.FixtureRequest) -> Path:
    return build(request.param)


@pytest.fixture
def imu(build: Callable[[str], Path]) -> Path:
    return build("imu")


@pytest.fixture
def kernel() -> Iterator[Kernel]:
    with Kernel() as brick:
        brick.convert(NINE_VOLTS, LEVEL, LEVEL, LEVEL)
        brick.run(1000)
        yield brick


def linked(folder: Path, name: str, at: int) -> bytes:
    """Returns the text and data sections of a program, linked for the address `at`."""
    script = ("-T", str(BRICKOS / "brickOS.lds"), "-relax", "-Ttext", f"{at:#x}", "--oformat", "coff-h8300")
    objects = sorted(str(file) for file in (folder / f"{name}-objects").iterdir())
    subprocess.run(["h8300-hms-ld", *script, "-o", "there.coff", *objects], cwd=folder, check=True)
    to_bytes = ["h8300-hms-objcopy", "-I", "coff-h8300", "-O", "binary", "there.coff", "there.bin"]
    subprocess.run(to_bytes, cwd=folder, check=True)
    return (folder / "there.bin").read_bytes()


def address(folder: Path, name: str) -> int:
    """Returns the address of a variable of the program that `linked` made last."""
    symbols = subprocess.run(["h8300-hms-nm", "there.coff"], cwd=folder, capture_output=True, text=True, check=True)
    return next(int(line.split()[0], 16) for line in symbols.stdout.splitlines() if line.split()[-1] == name)


def periods(kernel: Kernel, clock: int) -> list[int]:
    """Returns the times between successive control steps during one second, ms by the kernel's clock."""
    times = []
    for _ in range(1000):
        kernel.run(1)
        times.append(kernel.word(clock))
    return [(after - before) & 0xFFFF for before, after in itertools.pairwise(times) if after != before]


def is_in(kernel: Kernel, folder: Path, name: str) -> bool:
    """Returns whether memory holds a program linked for its address, and the copy of its data for the next start."""
    program = image_files.read_program(folder / f"{name}.lx")
    at = kernel.word(PROGRAMS)
    assert HEAP[0] <= at
    assert at + program.room <= HEAP[1]
    assert at != program.base
    wanted = linked(folder, name, at)
    size = program.text_size + program.data_size
    assert len(wanted) == size
    copy = kernel.memory(at + size + program.bss_size, program.data_size)
    return kernel.memory(at, size) == wanted and copy == wanted[program.text_size :]


def test_the_autopilot_arrives_runs_and_ends(kernel: Kernel, built: Path) -> None:
    assert kernel.shows("    -")
    with RcxBrick(device=kernel) as line:
        done = flash(image_files.read_program(built / "brickpilot.lx"), line.path)
    assert done.tally.sent_again == 0
    assert done.address == kernel.word(PROGRAMS)
    assert is_in(kernel, built, "brickpilot")
    kernel.run(500)
    assert kernel.shows("    1")
    assert kernel.user_tasks == 0

    kernel.press(RUN_BUTTON)
    assert kernel.shows("rESt ")
    assert kernel.user_tasks == 2
    kernel.run(1400)
    assert kernel.driven == (0, 0)
    kernel.run(600)
    assert kernel.shows("run 1")
    assert kernel.driven != (0, 0)
    taken = periods(kernel, address(built, "_now_ms"))
    assert sum(taken) / len(taken) == pytest.approx(STEP_MS, abs=0.1)
    assert max(taken) <= STEP_MS + 2

    with RcxBrick(device=kernel) as line:
        session = Session(InfraredLink(Tower(line.path, BYTE_S)), "infrared")
        session.open("coupled", REALTIME)
        kernel.run(20)
        assert kernel.shows("idLE ")
        session.upload([(1000, 0), (0, -500)])
        assert session.route() == [(1000, 0), (0, -500)]
        session.command("start")
        session.link.close()
    kernel.run(300)
    assert kernel.shows("run 1")
    assert min(kernel.driven) > 0  # straight ahead on the host's route; the program's own route begins with a turn

    kernel.press(RUN_BUTTON)
    kernel.run(600)
    assert kernel.user_tasks == 0
    assert kernel.driven == (0, 0)
    kernel.press(RUN_BUTTON)  # a new start: data and bss have their initial values
    kernel.run(2300)
    assert kernel.shows("run 1")
    assert min(kernel.driven) < 0


def test_the_autopilot_arrives_by_brickos_own_tool(kernel: Kernel, imu: Path) -> None:
    with RcxBrick(device=kernel) as line:
        command = ["dll", f"-t{line.path}", "-p1", "brickpilot.lx"]
        subprocess.run(command, cwd=imu, capture_output=True, timeout=60, check=True)
    assert is_in(kernel, imu, "brickpilot")
    kernel.press(RUN_BUTTON)
    kernel.run(2300)
    assert kernel.shows("run 1")


def test_the_recorder_arrives_on_a_line_that_hits_one_byte_of_a_hundred(kernel: Kernel, imu: Path) -> None:
    with RcxBrick(device=kernel, faults=Faults(corrupt=0.005, lose=0.005)) as line:
        done = flash(image_files.read_program(imu / "recorder.lx"), line.path)
        assert line.hit > 10
    assert done.tally.sent_again > 3
    assert is_in(kernel, imu, "recorder")
    kernel.press(RUN_BUTTON)
    assert kernel.shows("rEc  ")
    kernel.run(1500)
    kernel.run(500)
    assert min(kernel.driven) > 0


def test_nothing_is_loaded_over_a_program_that_runs(kernel: Kernel, imu: Path) -> None:
    recorder = image_files.read_program(imu / "recorder.lx")
    with RcxBrick(device=kernel) as line:
        flash(recorder, line.path, execute=True)
        assert kernel.user_tasks == 1
    with RcxBrick(device=kernel) as line, pytest.raises(InputError, match="a program runs on the brick"):
        flash(recorder, line.path)
    kernel.press(RUN_BUTTON)
    kernel.run(600)
    with RcxBrick(device=kernel) as line:
        flash(recorder, line.path)


def test_a_program_that_is_too_large_is_refused(kernel: Kernel, imu: Path) -> None:
    recorder = image_files.read_program(imu / "recorder.lx")
    large = dataclasses.replace(recorder, bss_size=14626)
    with RcxBrick(device=kernel) as line, pytest.raises(InputError, match="has no room for"):
        flash(large, line.path)


@pytest.mark.parametrize("wrong", ["missing", "beside"])
def test_a_wrong_relocation_is_seen(kernel: Kernel, imu: Path, wrong: str) -> None:
    recorder = image_files.read_program(imu / "recorder.lx")
    first, *others = recorder.relocations
    with RcxBrick(device=kernel) as line:
        table = others if wrong == "missing" else [first + 1, *others]
        flash(dataclasses.replace(recorder, relocations=tuple(table)), line.path)
    assert not is_in(kernel, imu, "recorder")


def some_command(random: Random, brick: BrickOs) -> bytes:
    """Returns a command for the brick's loader, in or out of order, complete or truncated; none starts a program."""
    number = random.randrange(3)
    slot = brick.slots[number]
    kind = random.choice([*2 * [DELETE], *3 * [CREATE], *8 * [DATA], RUN, SET_HOST, 0, 9])
    if slot.valid and random.random() < 0.5:
        kind = DELETE
    elif kind == RUN and slot.valid:
        kind = CREATE
    command = bytes([kind, 0 if kind == SET_HOST else number])
    if kind == CREATE:
        sizes = (14, 10, random.choice([20, 20, 20000]), 256, 0)
        command += b"".join(size.to_bytes(2, "big") for size in sizes) + b"\x0a"
    elif kind == DATA:
        offset = max(0, slot.downloaded + random.choice([0, 0, 0, 0, -4, 4]))
        command += offset.to_bytes(2, "big") + random.randbytes(min(8, max(1, 24 - offset)))
    return command[: random.randrange(1, len(command))] if random.random() < 0.1 else command


def without_addresses(reply: bytes) -> bytes:
    """Returns a reply to CREATE with the distances of sections in place of addresses and sum, or an empty reply."""
    if not reply:
        return reply
    text, data, bss = struct.unpack(">HHH", reply[6:12])
    return reply[:6] + bytes([data - text, bss - data])


def test_the_loader_that_other_tests_emulate_answers_as_the_kernel(kernel: Kernel) -> None:
    emulated, random = BrickOs(), Random(1)
    answered = whole = 0
    for _ in range(200):
        command = some_command(random, emulated)
        packet = lnp.packet(command, lnp.address(0), lnp.address(8))
        real, other = (b"".join(brick.byte(value) for value in packet) for brick in (kernel, emulated))
        if command[0] == CREATE:
            real, other = without_addresses(real), without_addresses(other)
        assert real == other, command.hex()
        answered += bool(real)
        whole += any(slot.valid for slot in emulated.slots)
    assert 60 < answered < 140
    assert whole > 20
