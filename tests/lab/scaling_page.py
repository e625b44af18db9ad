"""The program that `brickpilot bench --scaling` runs: it measures how time grows with the work, and writes a page.

python -m lab.scaling_page --out DIR [--json]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from brickpilot.cli.main import run_to_exit
from brickpilot.cli.terminal import as_json, progress_shown
from brickpilot.public.doors import command_line
from brickpilot.report import run_folder
from brickpilot.report.plot import Curve, Figure, Panel, to_html
from brickpilot.report.template import render
from markupsafe import Markup

from lab import scaling

Content = Mapping[str, Any]


def page(content: Content, command: str) -> str:
    """Returns the page as HTML that loads no other file, from the figures of `scaling.as_dict`; it shows `command`."""
    sweeps = content["sweeps"].values()
    return render(
        "scaling",
        folder=Path(__file__).parent,
        title="How time grows",
        command=command,
        machine=content["machine"],
        sweeps=[(one, _row(one), _growth(one)) for one in sweeps],
        linear=sum(one["growth"] == "linear" for one in sweeps),
        worse=[one["what"] for one in sweeps if one["growth"] == "more than linear"],
        crowd=content["workers"],
        crowd_rows=list(zip(content["workers"]["numbers"], content["workers"]["gain"], strict=True)),
        crowd_figure=_crowd(content["workers"]),
    )


def _row(one: Content) -> dict[str, str]:
    low, high = one["exponent"]["ci95"]
    each = 1e6 * min(one["seconds"][-1]) / one["sizes"][-1]
    return {
        "more": f"{one['times_work']:.3g}",
        "longer": f"{one['times_as_long']:.3g}",
        "exponent": f"{one['exponent']['value']:.2f}",
        "interval": f"{low:.2f} to {high:.2f}",
        "each": f"{each:.3g} µs" if each < 1e3 else f"{each / 1e3:.3g} ms",
    }


def _growth(one: Content) -> Markup:
    """Returns a figure as HTML: time against amount of work, relative to the smallest, and a line of linear growth.

    Both axes are logarithmic.
    """
    beyond = np.array(one["sizes"], dtype=float) - one["least"]
    sizes = beyond / beyond[0]
    seconds = np.array(one["seconds"], dtype=float)
    times = seconds / seconds[0].min()
    curves = [
        Curve(f"repeat {k + 1}" if times.shape[1] > 1 else "measured", times[:, k], "blue", shape="marks")
        for k in range(times.shape[1])
    ]
    curves.append(Curve("linear growth", sizes, "grey", dashed=True))
    low, high = one["exponent"]["ci95"]
    return to_html(
        Figure(
            title=f"{one['what']}: exponent {one['exponent']['value']:.2f}, {low:.2f} to {high:.2f}",
            x=sizes,
            panels=[Panel("times as long", "", curves, height=190, log=True)],
            x_label=f"times as many {one['unit']}, from {one['sizes'][0]:,}",
            x_unit="",
            log=True,
        )
    )


def _crowd(workers: Content) -> Markup:
    rates = np.array(workers["flights_per_s"], dtype=float)
    numbers = np.array(workers["numbers"], dtype=float)
    gains = rates / rates[0].max()
    curves = [Curve(f"repeat {k + 1}", gains[:, k], "blue", shape="marks") for k in range(gains.shape[1])]
    curves.append(Curve("one core each", np.minimum(numbers, workers["cores"]), "grey", dashed=True))
    return to_html(
        Figure(
            title=f"flights per second by workers, on {workers['cores']} cores",
            x=numbers,
            panels=[Panel("times as many flights a second", "", curves, height=190)],
            x_label="workers",
            x_unit="",
        )
    )


@click.command()
@click.option("--out", required=True, metavar="DIR", help="The folder to write.")
@as_json
def measure_scaling(out: str, as_json: bool) -> None:
    """Measures how time grows with the amount of work; writes report.html and scaling.json."""
    folder = Path(out)
    with run_folder.fresh_folder(folder, ("report.html", "scaling.json")) as beside:
        with progress_shown(as_json) as progress:
            found = scaling.as_dict(scaling.measure(progress))
        command = command_line("bench", scaling=True, out=folder)
        (beside / "scaling.json").write_text(json.dumps(found, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        (beside / "report.html").write_text(page(found, command), encoding="utf-8")
    if as_json:
        click.echo(json.dumps(found, allow_nan=False))
        return
    click.echo(f"on {found['machine']}")
    for one in found["sweeps"].values():
        low, high = one["exponent"]["ci95"]
        growth = f"{one['growth']}, exponent {one['exponent']['value']:.2f} ({low:.2f} to {high:.2f})"
        ratio = f"{one['times_as_long']:6.1f} times as long for {one['times_work']:4.1f} times the {one['unit']}"
        click.echo(f"{ratio}: {growth}; {one['what']}")
    for number, gain in zip(found["workers"]["numbers"], found["workers"]["gain"], strict=True):
        click.echo(f"{gain:6.2f} times the flights of one worker with {number} on {found['workers']['cores']} cores")
    click.echo(f"report: {folder / 'report.html'}")


if __name__ == "__main__":
    run_to_exit(measure_scaling, None, "brickpilot")
