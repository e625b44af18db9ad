"""Functions that turn logs into a data set or an answer: `import_log`, `why` and `changed`."""

from __future__ import annotations

import dataclasses
import json
import shlex
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from brickpilot.changed.change import Changed
from brickpilot.changed.what_changed import BEFORE, what_changed
from brickpilot.data import reading
from brickpilot.data.dataset import Dataset, joined
from brickpilot.errors import InputError
from brickpilot.fit.descent import Progress
from brickpilot.importers import IMPORTERS, Importer, importer_and_files, options_taken
from brickpilot.importers.writer import Imported
from brickpilot.public.analysis import discover
from brickpilot.public.doors import jobs_of, seed_of, silent
from brickpilot.readiness.data_check import check
from brickpilot.report import changed_page, discover_page, why_page, why_text
from brickpilot.report.run_folder import fresh_folder
from brickpilot.report.why_page import Why
from brickpilot.vehicle import compensation, model
from brickpilot.vehicle.manoeuvres import Manoeuvre
from brickpilot.vehicle.model import Model

_DATA = "data"  # name of the folder, beside the page, with the data set that is made of the log

Logs = Dataset | str | Path | Sequence[str | Path]
"""A data set, its folder, or a log; or several logs or folders of one robot."""

Recording = Dataset | str | Path
"""A data set, its folder, or a log."""


def import_log(
    files: str | Path | Sequence[str | Path], out: str | Path, *, kind: str | None = None,
    nominal: Mapping[str, float] | None = None, name: str | None = None, progress: Progress | None = None,
    importers: Sequence[Importer] = IMPORTERS, **options: Any,
) -> Imported:  # fmt: skip
    """Makes a data set from logs of other tools, and returns its folder, its runs and notes on how the logs were read.

    Args:
        files: one log, or several logs whose runs make one data set.
        out: the new folder.
        kind: the kind of log, one of those that `brickpilot import --help` lists; None: the file's extension shows the
            kind.
        nominal: parameter -> its value in SI, as in [nominal] of a data set.
        name: the name of the data set; None: the name of the folder.
        progress: called with (done, total, text); only importers that take long call this function.
        importers: the table of kinds.
        options: the options of this kind of log, such as `mapping`, `vehicle`, `frame`, `split` and `guessed`.

    Raises:
        InputError: a log or an option is wrong; the message names file, line and column, or the option. Then no file is
            written.

    >>> import brickpilot as bp, pathlib, tempfile
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> _ = (folder / "log.csv").write_text("ms,pwm,rpm\\n0,0,0\\n10,100,5\\n20,100,9\\n")
    >>> mapping = ["time=ms:ms", "duty=pwm/255", "speed=rpm:rpm"]
    >>> made = bp.import_log(folder / "log.csv", folder / "bench", vehicle="motor", mapping=mapping)
    >>> made.runs
    ('log',)
    """
    given = [files] if isinstance(files, str | Path) else list(files)
    importer, paths = importer_and_files([str(path) for path in given], kind, importers)
    taken = options_taken(importer, importers, options)
    if importer.reports_progress:
        taken["progress"] = progress or silent
    return importer.import_files(paths, Path(out), nominal=nominal or {}, name=name, **taken)


def why(
    logs: Logs, *, vehicle: str | None = None, frame: str | None = None, mapping: Sequence[str] = (),
    nominal: Mapping[str, float] | None = None, as_wired: bool = False, out: str | Path | None = None,
    budget_s: float | None = None, seed: int = 0, jobs: int = 2, progress: Progress | None = None,
    command: str = "bp.why",
) -> Why:  # fmt: skip
    """Finds from logs or data sets why a robot behaves differently from its simulation.

    Args:
        logs: a log that `import_log` reads, a data set or its folder; or several logs, or several folders, of one
            robot.
        vehicle: "diff_drive", "motor" or "skid_steer"; None: guessed if the log is a table.
        frame: "FLU" or "FRD"; None: guessed if the log is a table, else FRD.
        mapping: the signals in a table's columns, as in `import_log`; the signals in all other columns are guessed.
        nominal: parameter -> value in SI.
        as_wired: whether channels that look swapped, reversed or scaled wrongly stay as they are.
        out: the folder to write with the page why.html; None: nothing is written.
        budget_s, seed, jobs, progress: as in `discover`.
        command: the command line that the page shows, to repeat the call.

    Raises:
        InputError: a log cannot be read, or an argument is wrong.

    A motor that behaves as its nominal values predict:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "wheel_inertia": 1e-3}
    >>> motor = bp.Model("bench", "motor", "coupled", {**known, "viscous_friction": 1e-4})
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> def run(volts):
    ...     voltage = np.where((time > 0.1) & (time < 1.4), volts, 0.0)
    ...     (simulated,) = bp.simulate([(motor, bp.OpenLoopRun(time, voltage[:, np.newaxis]))])
    ...     noise = np.random.default_rng(1).normal(0.0, 0.02, time.size)
    ...     return pd.DataFrame({"time": time, "voltage": voltage, "speed": simulated.outputs["speed"] + noise})
    >>> runs = {"low": run(3.0), "back": run(-5.0), "high": run(7.0)}
    >>> found = bp.why(bp.Dataset.from_frames(runs, vehicle="motor", nominal=known))
    >>> found.answer.ending
    'nothing'
    """
    options = {"vehicle": vehicle, "frame": frame, "mapping": mapping, "nominal": nominal, "as_wired": as_wired}
    files = {"why.html", *why_page.FILES} | (set() if out is None else _terms(Path(out)))
    with _folder(out, files) as folder:
        data, notes, mend = _read(logs, folder / _DATA, options)
        finding = discover(data, seed=seed, jobs=jobs, budget_s=budget_s, progress=progress)

        def advised() -> list[Manoeuvre]:
            (progress or silent)(0, 1, "looking for what to drive next")
            return [advice.manoeuvre for advice in check(data, seed=seed, jobs=jobs).advice]

        undone = compensation.from_model(finding.augmented)
        answer = why_text.answer(finding, undone, mend, advised)
        made = Why(finding, answer, why_page.constants_of(finding), tuple(notes))
        if out is not None:
            runs = len(data.runs)
            source = f"{_words(logs)}: {runs} run{'s' if runs != 1 else ''}"
            _write(made, folder, source, command)
    return made


def changed(
    before: Recording | Model, *after: Recording, vehicle: str | None = None, frame: str | None = None,
    mapping: Sequence[str] = (), nominal: Mapping[str, float] | None = None, as_wired: bool = False,
    out: str | Path | None = None, seed: int = 0, jobs: int = 2, progress: Progress | None = None,
    command: str = "bp.changed",
) -> Changed:  # fmt: skip
    """Finds what is different in later recordings of a machine, by how much, and since when.

    Args:
        before: a recording of the machine before the change: a data set, its folder, or a log that `import_log` reads;
            or a model of the machine, or the model's file.
        after: later recordings.
        vehicle, frame, mapping, nominal, as_wired: options for logs, as in `why`.
        out: the folder to write with the page changed.html; None: nothing is written.
        seed, jobs, progress: as in `discover`.
        command: the command line that the page shows, to repeat the call.

    Raises:
        InputError: a recording cannot be read or is of another vehicle, or an argument is wrong.

    A motor whose bearing brakes more than before:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "wheel_inertia": 1e-3}
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> def recording(friction, seed):
    ...     motor = bp.Model("bench", "motor", "coupled", {**known, "viscous_friction": friction})
    ...     runs = {}
    ...     for number, volts in enumerate((3.0, -5.0, 7.0)):
    ...         voltage = np.where((time > 0.1) & (time < 1.4), volts, 0.0)
    ...         (simulated,) = bp.simulate([(motor, bp.OpenLoopRun(time, voltage[:, np.newaxis]))])
    ...         noise = np.random.default_rng([seed, number]).normal(0.0, 0.02, time.size)
    ...         speed = simulated.outputs["speed"] + noise
    ...         runs[f"run_{number}"] = pd.DataFrame({"time": time, "voltage": voltage, "speed": speed})
    ...     return bp.Dataset.from_frames(runs, vehicle="motor", nominal=known, name=f"week {seed}")
    >>> found = bp.changed(recording(1e-3, 1), recording(2e-3, 2))
    >>> found.verdict, [change.what for change in found.changes]
    ('changed', ['kV'])
    """
    if not after:
        raise InputError("no later recording is given", field="AFTER")
    seed, jobs = seed_of(seed), jobs_of(jobs)
    options = {"vehicle": vehicle, "frame": frame, "mapping": mapping, "nominal": nominal, "as_wired": as_wired}
    names = _names([before, *after])
    places = {"changed.html", "changed.json", *(f"{_DATA}_{number}" for number in range(len(names)))}
    with _folder(out, places) as folder:

        def read(number: int, given: Recording) -> tuple[Dataset, tuple[str, ...]]:
            return _read(given, folder / f"{_DATA}_{number}", options)[:2]

        notes: list[str] = []
        first: Dataset | Model
        if isinstance(before, Model) or _is_model(before):
            first = before if isinstance(before, Model) else model.load(Path(str(before)))
        else:
            first, own = read(0, before)
            notes += own
        later = {}
        for number, (name, recording) in enumerate(zip(names[1:], after, strict=True), 1):
            later[name], own = read(number, recording)
            notes += own
        compared = what_changed(first, later, seed=seed, jobs=jobs, progress=progress)
        result = dataclasses.replace(compared, before=names[0], notes=tuple(dict.fromkeys([*notes, *compared.notes])))
        if out is not None:
            text = json.dumps(result.to_dict(), indent=2, allow_nan=False) + "\n"
            (folder / "changed.json").write_text(text, encoding="utf-8")
            (folder / "changed.html").write_text(changed_page.page(result, command), encoding="utf-8")
    return result


def _is_model(given: Recording) -> bool:
    """Returns whether `given` is the file of a model, and not a data set or a log."""
    return isinstance(given, str | Path) and Path(given).suffix == ".toml" and Path(given).name != "dataset.toml"


def _names(given: Sequence[Recording | Model]) -> list[str]:
    """Returns a unique name for each recording: the name of a file or of a data set."""
    names: list[str] = []
    for recording in given:
        if isinstance(recording, str | Path):
            path = Path(recording)
            name = path.parent.name if path.name == "dataset.toml" else path.name if path.is_dir() else path.stem
        else:
            name = recording.name
        wanted = name = name.replace("@", "_").replace(": ", "_") or "recording"
        number = 1
        while name in {BEFORE, *names}:
            number += 1
            name = f"{wanted} {number}"
        names.append(name)
    return names


@contextmanager
def _folder(out: str | Path | None, files: Collection[str]) -> Iterator[Path]:
    """Yields the working folder: it becomes `out`, or is deleted if `out` is None."""
    if out is not None:
        with fresh_folder(Path(out), files) as folder:
            yield folder
        return
    with tempfile.TemporaryDirectory(prefix="brickpilot-logs-", ignore_cleanup_errors=True) as beside:
        yield Path(beside)


def _words(logs: Logs) -> str:
    """Returns the logs as the page names them."""
    if isinstance(logs, Dataset):
        return logs.name
    return str(logs) if isinstance(logs, str | Path) else shlex.join(map(str, logs))


def _terms(folder: Path) -> set[str]:
    """Returns the names of the C files of composed terms that an earlier call wrote into the folder."""
    return {path.name for path in folder.glob("composed_for_*.c")} if folder.is_dir() else set()


def _read(logs: Logs, into: Path, options: Mapping[str, Any]) -> tuple[Dataset, tuple[str, ...], str]:
    """Returns a data set, the notes on its import, and the options of `import` that would correct its wiring.

    Logs are imported into the folder `into`. `options`: the options for logs, by the keywords of `why`.
    """
    if isinstance(logs, Dataset):
        return logs, (), ""
    paths = [Path(log) for log in ([logs] if isinstance(logs, str | Path) else logs)]
    if not paths:
        raise InputError("no log is given", field="LOG")
    are_sets = [(path / "dataset.toml").is_file() or path.name == "dataset.toml" for path in paths]
    if not any(are_sets):
        made = _import(paths, into, {keyword: value for keyword, value in options.items() if value})
        return reading.read(into), made.notes, made.mend
    if not all(are_sets):
        raise InputError(
            "is a log, but another path is a data set: import the log first", file=paths[are_sets.index(False)]
        )
    if any(options.values()):
        message = "a data set describes itself: --map, --nominal, --vehicle, --frame and --as-wired are for logs"
        raise InputError(message, file=paths[0])
    return joined([reading.read(path) for path in paths]), (), ""


def _import(paths: Sequence[Path], into: Path, options: Mapping[str, Any]) -> Imported:
    """Makes a data set from logs with the given options, and with guesses if the kind of log allows guesses.

    Raises:
        InputError: a file does not exist, the kind of log is not known, or an option that this kind needs is missing.
    """
    for path in paths:
        if not path.exists():
            raise InputError("no such file", file=path)
    importer, _ = importer_and_files([str(path) for path in paths], None, IMPORTERS)
    keywords = {option.keyword for option in importer.options}
    guesses: dict[str, Any] = {"guessed": True, "split": ("rests",)}
    guesses = {keyword: value for keyword, value in guesses.items() if keyword in keywords}
    return import_log(paths, into, name=paths[0].stem, **options, **guesses)


def _write(made: Why, beside: Path, source: str, command: str) -> None:
    """Writes the pages and files into `beside`."""
    discover_page.write(made.finding, beside, command, made.answer.next)
    for name, text in why_page.files_of(made.finding.dataset.name, made.constants).items():
        (beside / name).write_text(text, encoding="utf-8")
    files = sorted(path.name for path in beside.iterdir())
    page = why_page.page(made, source=source, files=files, command=command)
    (beside / "why.html").write_text(page, encoding="utf-8")
