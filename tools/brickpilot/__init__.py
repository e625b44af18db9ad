"""Brickpilot: from measured runs of a small robot or a motor to a model that explains them.

You provide a data set: DataFrames, or a folder with `dataset.toml` and a table of columns for each run. You get a
calibrated model, its gap to the measurement, and the effects that the model lacks. `brickpilot COMMAND` prints the
result of the function of the same name.

Three runs of a motor are simulated here and given as DataFrames. Every value is in SI unless a unit is stated:

>>> import brickpilot as bp
>>> import numpy as np, pandas as pd
>>> known = {"resistance": 22.0, "torque_constant": 0.195, "wheel_inertia": 1e-3, "viscous_friction": 1e-4}
>>> motor = bp.Model("bench motor", "motor", "coupled", {**known, "emf_constant": 0.3})
>>> time = np.arange(0.0, 2.0, 0.01)
>>> def bench(volts):
...     voltage = np.where((time > 0.1) & (time < 1.4), volts, 0.0)
...     (simulated,) = bp.simulate([(motor, bp.OpenLoopRun(time, voltage[:, np.newaxis]))])
...     noise = np.random.default_rng(round(10 * abs(volts))).normal(0.0, 0.02, time.size)
...     return pd.DataFrame({"time": time, "volts": voltage, "speed": simulated.outputs["speed"] + noise})
>>> dataset = bp.Dataset.from_frames(                        # bp.read("folder") reads a data set of files
...     {"low": bench(3.0), "back": bench(-5.0), "high": bench(7.0)},
...     vehicle="motor", signals={"voltage": "volts", "speed": ("speed", "rad/s")},
...     nominal=known, roles={"low": "fit", "back": "fit", "high": "held_out"}, name="bench",
... )
>>> [fault.kind for fault in dataset.faults]                 # damaged samples are left out
[]

The parameters that `nominal` does not state are fitted. Each result gives its tables as DataFrames:

>>> fitted = bp.calibrate(dataset)
>>> fitted.to_frame()[["parameter", "value", "unit", "identifiable"]].round(3)
      parameter  value     unit  identifiable
0  emf_constant    0.3  V s/rad          True
>>> comparison = bp.compare(dataset, fitted.model)           # simulated from the inputs alone
>>> comparison.share("held_out", "speed") < 0.01
True
>>> finding = bp.discover(dataset)                           # what the simulator lacks
>>> finding.verdict, finding.to_frame().empty
('none', True)

The model simulates runs that were never measured. `fly` flies the mission of the packaged robot:

>>> run = bp.OpenLoopRun(time, np.full((200, 1), 4.5))
>>> (simulated,) = bp.simulate([(fitted.model, run)])
>>> round(float(simulated.outputs["speed"][-1]), 1)          # rad/s at the end
14.4
>>> flown = bp.fly("mission", sensors="imu+encoders", seed=1)
>>> flown.figures["waypoints_reached"], flown.failure
(8, None)

The other commands are functions too, with the same files: `bp.import_log`, `bp.why`, `bp.changed`, `bp.ask`,
`bp.campaign`, `bp.tune`, `bp.export`, `bp.firmware` and `bp.hil`. `help` shows the arguments of a function.

The names below are the public interface. Each name is loaded at its first use, so `import brickpilot` takes no time.
`discover`, `changed`, `ask`, `campaign`, `tune`, `export`, `firmware` and `hil` are also names of packages:
`bp.discover(dataset)` works before and after an import of the package's modules.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from brickpilot.catalogue import effects
    from brickpilot.changed.change import Changed
    from brickpilot.data.reading import Dataset, read
    from brickpilot.discover.finding import Finding
    from brickpilot.errors import InputError, SimulationError
    from brickpilot.fit.calibration import Calibration
    from brickpilot.fit.comparison import Comparison
    from brickpilot.public.analysis import calibrate, check, compare, discover
    from brickpilot.public.analysis import discover as discover_effects
    from brickpilot.public.asking import ask
    from brickpilot.public.flights import hil
    from brickpilot.public.logs import changed, import_log, why
    from brickpilot.public.making import campaign, export, firmware, tune
    from brickpilot.readiness.data_check import Check
    from brickpilot.report.notebook import to_html, to_text
    from brickpilot.report.why_page import Why
    from brickpilot.vehicle.flight_figures import Flown, fly
    from brickpilot.vehicle.model import Model, rcx
    from brickpilot.vehicle.model import load as load_model
    from brickpilot.vehicle.model import save as save_model
    from brickpilot.vehicle.plant import OpenLoopRun, simulate

__version__ = "0.1.0"

_NAMES = {
    "Calibration": "brickpilot.fit.calibration:Calibration",
    "Changed": "brickpilot.changed.change:Changed",
    "Check": "brickpilot.readiness.data_check:Check",
    "Comparison": "brickpilot.fit.comparison:Comparison",
    "Dataset": "brickpilot.data.reading:Dataset",
    "Finding": "brickpilot.discover.finding:Finding",
    "Flown": "brickpilot.vehicle.flight_figures:Flown",
    "InputError": "brickpilot.errors:InputError",
    "Model": "brickpilot.vehicle.model:Model",
    "OpenLoopRun": "brickpilot.vehicle.plant:OpenLoopRun",
    "SimulationError": "brickpilot.errors:SimulationError",
    "Why": "brickpilot.report.why_page:Why",
    "calibrate": "brickpilot.public.analysis:calibrate",
    "check": "brickpilot.public.analysis:check",
    "compare": "brickpilot.public.analysis:compare",
    "discover_effects": "brickpilot.public.analysis:discover",  # the older name of discover
    "effects": "brickpilot.catalogue:effects",
    "fly": "brickpilot.vehicle.flight_figures:fly",
    "import_log": "brickpilot.public.logs:import_log",
    "load_model": "brickpilot.vehicle.model:load",
    "rcx": "brickpilot.vehicle.model:rcx",
    "read": "brickpilot.data.reading:read",
    "save_model": "brickpilot.vehicle.model:save",
    "simulate": "brickpilot.vehicle.plant:simulate",
    "to_html": "brickpilot.report.notebook:to_html",
    "to_text": "brickpilot.report.notebook:to_text",
    "why": "brickpilot.public.logs:why",
}

_CALLS = {
    "ask": "brickpilot.public.asking:ask",
    "campaign": "brickpilot.public.making:campaign",
    "changed": "brickpilot.public.logs:changed",
    "discover": "brickpilot.public.analysis:discover",
    "export": "brickpilot.public.making:export",
    "firmware": "brickpilot.public.making:firmware",
    "hil": "brickpilot.public.flights:hil",
    "tune": "brickpilot.public.making:tune",
}
"""Functions that share their name with a package. A call of the package calls the function."""

__all__ = [
    "Calibration",
    "Changed",
    "Check",
    "Comparison",
    "Dataset",
    "Finding",
    "Flown",
    "InputError",
    "Model",
    "OpenLoopRun",
    "SimulationError",
    "Why",
    "__version__",
    "ask",
    "calibrate",
    "campaign",
    "changed",
    "check",
    "compare",
    "discover",
    "discover_effects",
    "effects",
    "export",
    "firmware",
    "fly",
    "hil",
    "import_log",
    "load_model",
    "rcx",
    "read",
    "save_model",
    "simulate",
    "to_html",
    "to_text",
    "tune",
    "why",
]


def _loaded(place: str) -> Any:
    """Returns the object that "module:name" names."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


class _CallableRoom(ModuleType):
    """A package that can be called; `inspect.signature` and `help` show the function that is called."""

    @property
    def __wrapped__(self) -> Any:
        return _loaded(_CALLS[self.__name__.rpartition(".")[2]])

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.__wrapped__(*args, **kwargs)

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """The text that `help` shows: the arguments and the docstring of the function."""
        function = self.__wrapped__
        return f"{function.__name__}{inspect.signature(function)}\n\n{inspect.getdoc(function)}"


def make_callable(package: str) -> None:
    """Lets a caller call the package like the public function of the same name. The package's `__init__` calls this."""
    sys.modules[package].__class__ = _CallableRoom


def __getattr__(name: str) -> Any:
    if name in _CALLS:
        return importlib.import_module(f"brickpilot.{name}")
    if name not in _NAMES:
        raise AttributeError(f"module 'brickpilot' has no attribute {name!r}")
    found = globals()[name] = _loaded(_NAMES[name])
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
