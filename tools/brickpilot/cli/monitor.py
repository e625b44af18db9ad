"""`brickpilot monitor`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import as_json, show
from brickpilot.errors import WorkFailedError
from brickpilot.report.flight_text import monitor_line

if TYPE_CHECKING:
    from brickpilot.link.links import Link


@click.command(short_help="Shows live what a brick says about causes.")
@click.option("--link", "spec", required=True, metavar="LINK", help="serial:PORT, tcp:HOST:PORT, can:slcan:PORT, ...")
@click.option("--seconds", type=click.FloatRange(min=0.1), help="Stop after this time; default: at Ctrl-C.")
@as_json
def monitor(spec: str, seconds: float | None, as_json: bool) -> None:
    """Shows what the brick's own monitor says of each wheel and of the battery, a line for each change.

    It only listens, so it disturbs no run. Times count from the brick's start or the beginning of its session. With
    --json it prints what held at the end. The exit status is 1 if the link was lost.
    """
    from brickpilot.link.brick import open_link
    from brickpilot.link.links import LinkGoneError

    newest: dict[str, dict[str, Any]] = {}
    try:
        with closing(open_link(spec)) as link:
            for said in findings(link, seconds):
                before = newest.get(said["channel"], {"cause": "none"})
                newest[said["channel"]] = said
                if not as_json and said["cause"] != "none":
                    click.echo(monitor_line(said))
                elif not as_json and before["cause"] != "none":
                    click.echo(f"{said['channel']}: as the model again")
    except KeyboardInterrupt:
        pass
    except LinkGoneError as error:
        raise WorkFailedError(f"{spec}: {error}") from error
    show({"link": spec, "monitor": [one for one in newest.values() if one["cause"] != "none"]}, [], as_json=as_json)


def findings(link: Link, seconds: float | None) -> Iterator[dict[str, Any]]:
    """Yields each change that a brick reports, as the entries of `flight_figures.monitor_figures`.

    Args:
        seconds: the time to listen, s; None: for ever.
    """
    from brickpilot.link.messages import SIZE, book
    from brickpilot.vehicle.flight_figures import CAUSES

    channels = {book().by_name[f"MONITOR_{name.upper()}"].id: name for name in ("left", "right", "battery")}
    newest: dict[int, bytes] = {}
    ends = None if seconds is None else time.monotonic() + seconds
    while ends is None or time.monotonic() < ends:
        for identifier, data in link.receive(0.1):
            if identifier not in channels or len(data) != SIZE or data[-1] >= len(CAUSES):
                continue
            told = data[:6] + data[7:]  # without the time
            if newest.get(identifier) == told or (data[-1] == 0 and newest.get(identifier, b"\0")[-1] == 0):
                continue
            newest[identifier] = told
            layout = book().by_id[identifier]
            amount, since, _, cause = layout.unpack(data)
            yield {
                "channel": channels[identifier],
                "cause": CAUSES[cause],
                "size": amount * book().scale(layout.name, "amount"),
                "since_s": since * book().scale(layout.name, "since"),
                "until_s": None,
            }
