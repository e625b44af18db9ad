"""Other ways to model the same logs, from well-known libraries: each is fitted on the fit runs and simulates every run.

    grid.py            runs on even steps, and simulated channels back at the measured samples
    choice.py          chooses a peer's settings on the fit runs alone
    feedforward.py     kS/kV/kA: with delays by simulation, and WPILib's own regression
    sindy.py           PySINDy in discrete time
    narx.py            SysIdentPy's polynomial NARX
    subspace.py        nfoursid's state space
    mujoco_motor.py    mujoco.sysid on a joint with damping, dry friction and a motor

To add a peer, write a file here with a function like `Peer.fit`, and add a row to `PEERS`.
"""

from __future__ import annotations

from brickpilot.benchmark.peers.peer import Peer

PEERS = (
    Peer("kS/kV/kA with delays", "brickpilot.benchmark.peers.feedforward:with_delays", None),
    Peer("WPILib kS/kV/kA", "brickpilot.benchmark.peers.feedforward:by_regression", None),
    Peer("PySINDy", "brickpilot.benchmark.peers.sindy:fit", "pysindy"),
    Peer("SysIdentPy NARX", "brickpilot.benchmark.peers.narx:fit", "sysidentpy"),
    Peer("nfoursid", "brickpilot.benchmark.peers.subspace:fit", "nfoursid"),
    Peer("mujoco.sysid", "brickpilot.benchmark.peers.mujoco_motor:fit", "mujoco.sysid:optimize"),
)

__all__ = ["PEERS", "Peer"]
