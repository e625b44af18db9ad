"""Opens the link to a brick that runs already, and sends settings and route for a flight to the brick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from brickpilot.errors import InputError
from brickpilot.link import links
from brickpilot.link.links import Link
from brickpilot.link.lnp import InfraredLink
from brickpilot.link.session import Session
from brickpilot.link.tower import Tower
from brickpilot.vehicle import flight
from brickpilot.vehicle.gains import check_pairs
from brickpilot.vehicle.settings import settings as known_settings

INFRARED = "infrared"
"""The infrared tower of an RCX. It is too slow for a plant; only `brickpilot upload` uses it."""

FORMS = ("serial:PORT", "tcp:HOST:PORT", "can:slcan:PORT", "can:socketcan:CHANNEL")


def open_link(spec: str, known: Sequence[str] = (f"{INFRARED}:PORT", *FORMS)) -> Link:
    """Opens this end of a link to a running brick.

    Args:
        spec: the link, as `brickpilot upload --link` takes it.
        known: the forms of links that the error for an unknown link lists.

    Raises:
        InputError: the link is unknown or cannot be opened.
    """
    kind, _, rest = spec.partition(":")
    if kind == "serial" and rest:
        return links.open_serial(spec, rest)
    if kind == "tcp" and rest:
        return links.open_tcp(spec, rest)
    if kind == INFRARED and rest:
        return InfraredLink(Tower(rest))
    name, _, channel = rest.partition(":")
    if kind == "can" and name in links.CAN_KINDS and channel and name != "virtual":
        return links.CanLink(links.open_bus(spec, name, channel))
    raise InputError(f"is no link; known links: {', '.join(known)}", field=f"--link {spec}")


def prepare(
    session: Session, plan: flight.Plan, pace: str, telemetry_every: int | None, settings: Mapping[str, int]
) -> None:
    """Opens a session and sends the data of the flight: compensation, gains, settings and route.

    Raises:
        InputError: the brick refuses some of the data, or two settings contradict each other. In the second case, no
            setting is written.
    """
    session.open(plan.controller, pace)
    cruise = {"cruise": known_settings()["cruise"].raw(plan.cruise)} if plan.cruise > 0 else {}
    written = flight.written(plan)
    check_pairs({**written, **settings}, lambda name: cruise[name] if name in cruise else session.read(name))
    if telemetry_every is not None:
        session.write("telemetry_every", telemetry_every)
    for name, raw in (*cruise.items(), *written.items(), *settings.items()):
        session.write(name, raw)
    session.upload([(round(x * 1e3), round(y * 1e3)) for x, y in plan.scenario.waypoints])
    session.resets.begin()
