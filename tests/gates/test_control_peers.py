"""Programs in Q16.16 and in soft float compute the firmware's control law on both bricks, at the stated cost."""

from __future__ import annotations

import functools
import subprocess
from pathlib import Path

import numpy as np
import pytest
from brickpilot.errors import SimulationError
from lab import control_peers
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
STEPS = 120

# Cycles of the median and of the worst of the 500 steps of `control_peers`, and bytes of flash. If a figure changes by
# more than TOLERANCE, correct it here and in tools/docs/benchmarks.md.
TOLERANCE = 0.03
MEASURED = {
    ("h8", "ours"): (29706, 35276, 3922),
    ("h8", "q16"): (61296, 84308, 3976),
    ("h8", "float"): (114020, 156513, 3626),
    ("avr", "ours"): (8421, 9617, 6186),
    ("avr", "q16"): (11106, 13390, 3350),
    ("avr", "float"): (9177, 10856, 3794),
}


recorded = functools.cache(control_peers.record)
"""`control_peers.record` with a cache: all tests with the same number of steps share one flight."""


def built(program: str, folder: Path) -> NDArray[np.int32]:
    """Builds a program for this machine beside its records, and returns its voltages (STEPS, 2) as raw numbers."""
    subprocess.run([ROOT / "tests/peers/build", "host", folder, program], check=True)
    output = subprocess.run([folder / program], stdout=subprocess.PIPE, check=True).stdout
    return np.frombuffer(output, dtype="<i4").reshape(STEPS, 5)[:, :2]


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.float64]:
    """Returns the firmware's voltages (STEPS, 2), V. Its program reads only the waypoints of constants.inc."""
    folder = tmp_path_factory.mktemp("ours")
    control_peers.write_records(recorded(STEPS), folder)
    return built("ours", folder) * 1e-3


@pytest.mark.parametrize("brick", control_peers.BRICKS)
def test_peers_give_the_firmwares_answers_at_the_cost_that_is_told(brick: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(control_peers, "record", recorded)
    found = control_peers.measure(brick)
    assert found.keys() == control_peers.ARITHMETICS.keys()
    for name, cost in found.items():
        got = (float(np.median(cost.cycles)), int(cost.cycles.max()), cost.flash)
        assert got == pytest.approx(MEASURED[brick, name], rel=TOLERANCE), (brick, name)
    # The mission turns, drives and brakes, so the voltages vary widely.
    assert np.ptp(found["ours"].voltages, axis=0).min() > 10.0


@pytest.mark.parametrize("constant", ["", "HEADING_KP", "FEEDFORWARD", "TWICE_DECEL", "SPEED_KI_PERIOD"])
def test_a_peer_that_computes_another_law_is_refused(constant: str, ours: NDArray[np.float64], tmp_path: Path) -> None:
    control_peers.write_records(recorded(STEPS), tmp_path)
    path = tmp_path / "constants.inc"
    if constant:
        lines = path.read_text().splitlines()
        at = next(i for i, line in enumerate(lines) if line.startswith(f"#define {constant} "))
        lines[at] = lines[at].replace(f"{constant} (", f"{constant} (1.1 * ")
        path.write_text("\n".join([*lines, ""]))
    theirs = built("q16", tmp_path) / 65536
    if not constant:
        control_peers.check_same_answers("Q16.16", ours, theirs)
        return
    with pytest.raises(SimulationError, match="does not compute the firmware's control law"):
        control_peers.check_same_answers("Q16.16", ours, theirs)
