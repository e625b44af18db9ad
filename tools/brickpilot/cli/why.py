"""`brickpilot why`: imports logs, calibrates a model, discovers and gives an answer, in one command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from brickpilot.cli.terminal import budget_option, log_options, progress_shown, search_options, show


@click.command()
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@log_options
@click.option("--out", metavar="DIR", help="The folder to write; default runs/why-NAME.")
@budget_option("Give the best answer so far after this time.")
@click.option("--verbose", is_flag=True, help="Also print every step to take, every symptom and every note.")
@search_options
def why(
    logs: tuple[str, ...], out: str | None, budget: float | None, verbose: bool, seed: int, jobs: int, as_json: bool,
    **how: Any,
) -> None:  # fmt: skip
    """Says why a robot behaves differently from its simulation.

    Each LOG is a log that import reads, or a data set; all are of one robot. A table needs no --map: the signals of its
    columns are guessed, and the table is split where the robot rests. The page why.html begins with what is wrong, how
    sure that is and what to do. There are four answers: nothing is wrong, a cause is known, something is missing (the
    page then says what to drive next), or the data contradict themselves. The folder also gets discover's page, the
    model, a compensation for the firmware, the manoeuvre to drive next, and the constants for ros2_control and for C.
    """
    from brickpilot.discover.finding import verdict_json
    from brickpilot.importers.mapping import parse_nominal
    from brickpilot.public import logs as public
    from brickpilot.public.doors import command_line
    from brickpilot.report import why_text

    folder = Path(out) if out else Path("runs") / f"why-{Path(logs[0]).stem}"
    command = command_line("why", *logs, **how, budget=budget, seed=seed)
    how["nominal"] = parse_nominal(how["nominal"])
    with progress_shown(as_json) as progress:
        found = public.why(
            logs, **how, out=folder, budget_s=budget, seed=seed, jobs=jobs, progress=progress, command=command
        )
    figures = {name: getattr(found.answer, name) for name in ("what", "sure", "todo", "symptoms", "ending")}
    figures |= {"constants": found.constants.to_json(), "verdict": verdict_json(found.finding)}
    lines = why_text.lines(found.answer, found.notes, found.finding.dataset.guesses, verbose=verbose)
    show(figures, [*lines, f"page: {folder / 'why.html'}"], as_json=as_json)
