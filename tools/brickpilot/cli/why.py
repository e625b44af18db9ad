"""`brickpilot why`: from a log to an answer, by import, calibration and discovery behind one door."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.import_log import all_options, importer_and_files, options_taken
from brickpilot.cli.terminal import as_json, jobs_option, progress_shown, seed_option
from brickpilot.errors import InputError
from brickpilot.importers import IMPORTERS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brickpilot.data.dataset import Dataset
    from brickpilot.discover.finding import Finding
    from brickpilot.importers.writer import Imported
    from brickpilot.report.why_page import Constants
    from brickpilot.report.why_text import Answer

_DATA = "data"  # the folder of the imported log beside the page


@click.command()
@click.argument("log")
@click.option("--vehicle", type=click.Choice(["diff_drive", "motor"]), help="Default: guessed from a table.")
@click.option("--frame", type=click.Choice(["FLU", "FRD"]), help="Default: guessed from a table, else FRD.")
@click.option("--map", "mapping", multiple=True, metavar="SIGNAL=FORMULA[:UNIT]", help="As in import; repeatable.")
@click.option("--nominal", multiple=True, metavar="NAME=VALUE", help="A nominal parameter in SI; repeatable.")
@click.option("--out", metavar="DIR", help="The folder to write; default runs/why-NAME.")
@click.option(
    "--budget", type=click.FloatRange(min=0, min_open=True), metavar="SECONDS", help="As in discover: the best so far."
)
@seed_option
@jobs_option
@as_json
def why(
    log: str, vehicle: str | None, frame: str | None, mapping: tuple[str, ...], nominal: tuple[str, ...],
    out: str | None, budget: float | None, seed: int, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Says why a robot does not do what the simulation does, from a LOG: a file that import reads, or a data set.

    A table needs no map: its columns are guessed, and it is split at its rests. The page why.html says first what is
    wrong, how sure that is and what to do. Beside it lie discover's page, the model, a compensation for the firmware,
    and the robot's constants for ros2_control and for C.
    """
    from brickpilot.discover import pipeline
    from brickpilot.discover.finding import verdict_json
    from brickpilot.report import run_folder, why_page, why_text

    path = Path(log)
    folder = Path(out) if out else Path("runs") / f"why-{path.stem}"
    command = shlex.join(["brickpilot", "why", log, *_given(vehicle, frame, mapping, nominal, budget, seed)])
    with run_folder.fresh_folder(folder, {"why.html", *why_page.FILES} | _terms(folder)) as beside:
        data, notes, mend = _read(path, beside / _DATA, vehicle, frame, mapping, nominal)
        with progress_shown(as_json) as progress:
            found = pipeline.discover(data, seed=seed, jobs=jobs, budget_s=budget, progress=progress)
        answer, constants = _write(found, beside, log, command, notes, mend)
    if as_json:
        said = {"what": answer.what, "sure": answer.sure, "todo": answer.todo, "symptoms": answer.symptoms}
        told = {**said, "constants": constants.to_json(), "verdict": verdict_json(found)}
        click.echo(json.dumps(told, allow_nan=False))
        return
    for note in notes:
        click.echo(f"note: {note}")
    for line in why_text.lines(answer):
        click.echo(line)
    click.echo(f"page: {folder / 'why.html'}")


def _read(
    path: Path, into: Path, vehicle: str | None, frame: str | None, mapping: tuple[str, ...], nominal: tuple[str, ...]
) -> tuple[Dataset, tuple[str, ...], str]:
    """Returns the data set at `path`, or one made `into` a folder of the log there, its notes and what mends it."""
    from brickpilot.data import dataset as dataset_module

    if not (path / "dataset.toml").is_file():
        made = _import(path, into, vehicle, frame, mapping, nominal)
        return dataset_module.read(into), made.notes, made.mend
    if mapping or nominal or vehicle or frame:
        raise InputError("a data set describes itself: --map, --nominal, --vehicle and --frame are for logs", file=path)
    return dataset_module.read(path), (), ""


def _write(
    found: Finding, beside: Path, log: str, command: str, notes: Sequence[str], mend: str
) -> tuple[Answer, Constants]:
    """Writes the pages and files into `beside`, and returns what they say."""
    from brickpilot.discover.finding import verdict_json
    from brickpilot.report import composed_law, discover_page, experiment_files, why_page, why_text
    from brickpilot.vehicle import compensation, model

    undone = compensation.from_model(found.augmented)
    answer, constants = why_text.answer(found, undone, mend), why_page.constants_of(found)
    texts = {
        "verdict.json": json.dumps(verdict_json(found), indent=2, allow_nan=False) + "\n",
        "report.html": discover_page.page(found, command),
        **experiment_files.of_finding(found),
        **why_page.files_of(found.dataset.name, constants),
        **composed_law.of_finding(found),
    }
    for name, text in texts.items():
        (beside / name).write_text(text, encoding="utf-8")
    model.save(found.augmented, beside / "model.toml")
    if undone is not None:
        undone.save(beside / "compensation.toml")
    runs = len(found.dataset.runs)
    page = why_page.page(
        found,
        answer,
        constants,
        source=f"{log}: {runs} run{'s' if runs != 1 else ''}",
        files=sorted(one.name for one in beside.iterdir()),
        command=command,
        notes=(*notes, *found.notes),
    )
    (beside / "why.html").write_text(page, encoding="utf-8")
    return answer, constants


def _given(
    vehicle: str | None,
    frame: str | None,
    mapping: tuple[str, ...],
    nominal: tuple[str, ...],
    budget: float | None,
    seed: int,
) -> list[str]:
    """Returns the options that make the answer what it is."""
    found = [*(["--vehicle", vehicle] if vehicle else []), *(["--frame", frame] if frame else [])]
    for flag, values in (("--map", mapping), ("--nominal", nominal)):
        found += [word for value in values for word in (flag, value)]
    return [*found, *([] if budget is None else ["--budget", f"{budget:g}"]), "--seed", str(seed)]


def _terms(folder: Path) -> set[str]:
    """Returns the C files of composed terms that an earlier call has left in the folder."""
    return {path.name for path in folder.glob("composed_for_*.c")} if folder.is_dir() else set()


def _import(
    path: Path, into: Path, vehicle: str | None, frame: str | None, mapping: tuple[str, ...], nominal: tuple[str, ...]
) -> Imported:
    """Makes a data set of a log, with guesses where its kind allows them.

    Raises:
        InputError: there is no such file, its kind is not known, or an option is missing that its kind needs.
    """
    from brickpilot.importers.mapping import parse_nominal

    if not path.exists():
        raise InputError("no such file", file=path)
    importer, files = importer_and_files([str(path)], None, IMPORTERS)
    asked: dict[str, Any] = {option.keyword: option.default for option in all_options(IMPORTERS)}
    asked |= {option.keyword: () for option in all_options(IMPORTERS) if option.repeatable}
    asked |= {option.keyword: True for option in importer.options if option.keyword == "guessed"}
    asked |= {option.keyword: ("rests",) for option in importer.options if option.keyword == "split"}
    asked |= {"vehicle": vehicle, "mapping": mapping} | ({"frame": frame} if frame else {})
    taken = options_taken(importer, IMPORTERS, asked)
    return importer.load()(files, into, nominal=parse_nominal(nominal), name=path.stem, **taken)
