"""Checks of arguments for every public function; a wrong argument gives a one-line error that names the argument.

All functions that write a folder return a `Made`.
"""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.vehicle import compensation, gains
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.flight import Plan
from brickpilot.vehicle.model import Model


@dataclass(frozen=True, repr=False)
class Made:
    """A folder that was written.

    Attributes:
        folder: the folder with the page, the figures and the other files of the command of the same name.
        sentence: the result in words.
        figures: the output of `--json`, in SI.
    """

    folder: Path
    sentence: str
    figures: Mapping[str, Any]

    def __repr__(self) -> str:
        """Returns the sentence and the folder."""
        return f"{self.sentence}\n  in {self.folder}, with {len(self.figures)} figures"


Data = Dataset | str | Path
"""A data set, or its folder."""


def dataset_of(given: Data) -> Dataset:
    """Returns a data set; if its folder is given, reads the data set.

    Raises:
        InputError: `given` is neither a data set nor a folder, or the folder is no data set.
    """
    if isinstance(given, Dataset):
        return given
    if isinstance(given, str | Path):
        return read(given)
    message = f"is a {type(given).__name__}: give a Dataset, its folder, or Dataset.from_frames of your tables"
    raise InputError(message, field="dataset")


def model_of(given: Model | str | Path | None) -> Model | None:
    """Returns a model; if its file is given, reads the model.

    Raises:
        InputError: `given` is neither a model nor a file, or the file is no model.
    """
    if given is None or isinstance(given, Model):
        return given
    if isinstance(given, str | Path):
        return dataclasses.replace(model_file.load(Path(given)), name=str(given))
    raise InputError(f"is a {type(given).__name__}: give a Model or its file", field="model")


def whole(field: str, given: int, low: int, high: int = 2**63 - 1) -> int:
    """Returns a whole number from `low` to `high`.

    Raises:
        InputError: `given` is no such number.
    """
    if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
        upper = "" if high == 2**63 - 1 else f" to {high}"
        raise InputError(f"needs a whole number from {low}{upper}, not {given!r}", field=field)
    return given


def silent(done: int, total: int, text: str) -> None:
    """Ignores the progress of work; a caller who wants to see it gives another function."""


def jobs_of(given: int) -> int:
    """Returns how many processes or threads work at the same time, 1..256; InputError if `given` is no such number."""
    return whole("jobs", given, 1, 256)


def seed_of(given: int) -> int:
    """Returns a seed, 0 or more; InputError if `given` is no seed."""
    return whole("seed", given, 0)


def names_of(field: str, given: str | Iterable[str]) -> tuple[str, ...]:
    """Returns the names in `given`; a single text is one name.

    Raises:
        InputError: one of the names is no text.
    """
    names = (given,) if isinstance(given, str) else tuple(given)
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"needs names, not {names!r}", field=field)
    return names


@dataclass(frozen=True)
class FlightRequest:
    """The options that the commands for flights share, as the user gave them; None: the option is absent."""

    scenario_name: str | None = None
    scenario_file: str | None = None
    profile: str | None = None
    sensors: str | None = None
    model_file: str | Path | None = None
    compensation_file: str | Path | None = None
    gains_file: str | Path | None = None
    seed: int | None = None

    @property
    def scenario(self) -> str:
        """The scenario's name or file; the packaged mission by default."""
        if self.scenario_name is not None:
            return self.scenario_name
        return "mission" if self.scenario_file is None else self.scenario_file

    def choices(self) -> dict[str, Any]:
        """Returns the arguments of `flight.plan` other than the scenario.

        Raises:
            InputError: a file is bad, or the scenario is given twice.
        """
        if self.scenario_name is not None and self.scenario_file is not None:
            raise InputError("the scenario is given twice: as an argument and as an option", field="--scenario")
        return {
            "model": model_file.load(Path(self.model_file)) if self.model_file else None,
            "profile": self.profile,
            "sensors": self.sensors,
            "seed": self.seed,
            "compensation": compensation.load(Path(self.compensation_file)) if self.compensation_file else None,
            "gains": gains.load(Path(self.gains_file)) if self.gains_file else None,
        }

    def options(self, plan: Plan) -> dict[str, Any]:
        """Returns the options with which `command_line` repeats the flight of `plan`."""
        chosen = {"profile": plan.controller, "sensors": plan.sensors, "seed": plan.seed}
        files = {"model": self.model_file, "compensation": self.compensation_file, "gains": self.gains_file}
        return chosen | files


_FLAGS = {"mapping": "map", "settings": "set"}


def command_line(command: str, *arguments: str, **options: Any) -> str:
    """Returns a command line of `brickpilot`; a page shows the command that made the page.

    Args:
        command: the name of the command.
        arguments: the positional arguments, in order.
        options: keyword of a public function -> its value. None, False and () are left out, True gives a flag without a
            value, and a sequence repeats the flag for each entry.
    """
    words = ["brickpilot", command, *arguments]
    for name, value in options.items():
        flag = f"--{_FLAGS.get(name, name).replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif isinstance(value, list | tuple):
            words += [word for entry in value for word in (flag, str(entry))]
        elif value is not None and value is not False:
            words += [flag, f"{value:g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)
