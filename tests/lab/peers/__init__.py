"""Peers: models of the same logs by well-known libraries. Each is fitted to the fit runs and simulates all runs.

    grid.py            runs on even time steps, and the choice of a peer's settings by the fit runs
    feedforward.py     kS/kV/kA: with delays by simulation, and WPILib's own regression
    sindy.py           PySINDy in discrete time
    narx.py            SysIdentPy's polynomial NARX
    subspace.py        nfoursid's state space
    mujoco_motor.py    mujoco.sysid on a joint with damping, dry friction and a motor

To add a peer, write a file here with a function like `Peer.fit`, and add a row to `PEERS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles

from lab.real_score import Predictions


@dataclass(frozen=True)
class Peer:
    """One peer.

    Attributes:
        function: ``module:name`` of a function that takes a data set and its roles, fits a model to the fit runs only,
            and returns the free run of every run.
        package: the package that the peer imports, or ``package:name``; None: the peer needs no other package.
    """

    name: str
    function: str
    package: str | None

    def missing(self) -> str | None:
        """Returns a line for the user if the peer's package is not installed, otherwise None."""
        if self.package is None or _installed(self.package):
            return None
        package = self.package.partition(":")[0]
        return f"{self.name} is left out: {package} is not installed; pip install 'brickpilot[peers]'"

    def load(self) -> Callable[[Dataset, Roles], Predictions]:
        module, _, name = self.function.partition(":")
        found: Callable[[Dataset, Roles], Predictions] = getattr(importlib.import_module(module), name)
        return found


def _installed(needs: str) -> bool:
    """Whether a package can be imported; with ``package:name``, also whether it contains the name."""
    package, _, name = needs.partition(":")
    try:
        return find_spec(package) is not None and (not name or hasattr(importlib.import_module(package), name))
    except ImportError:
        return False


PEERS = (
    Peer("kS/kV/kA with delays", "lab.peers.feedforward:with_delays", None),
    Peer("WPILib kS/kV/kA", "lab.peers.feedforward:by_regression", None),
    Peer("PySINDy", "lab.peers.sindy:fit", "pysindy"),
    Peer("SysIdentPy NARX", "lab.peers.narx:fit", "sysidentpy"),
    Peer("nfoursid", "lab.peers.subspace:fit", "nfoursid"),
    Peer("mujoco.sysid", "lab.peers.mujoco_motor:fit", "mujoco.sysid:optimize"),
)
