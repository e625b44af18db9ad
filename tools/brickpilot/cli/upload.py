"""`brickpilot upload`."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brickpilot.cli.terminal import as_json, profile_option, scenario_names, set_option, settings_of, show
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.vehicle.flight import Plan


@click.command()
@click.argument("scenario_name", metavar="SCENARIO", default="mission", shell_complete=scenario_names)
@click.option(
    "--link",
    "spec",
    required=True,
    metavar="LINK",
    help="infrared:PORT is an RCX at a serial infrared tower. The others are serial:PORT, tcp:HOST:PORT, "
    "can:slcan:PORT and can:socketcan:CHANNEL.",
)
@profile_option("The controller's constants; default: the scenario's.")
@click.option("--compensation", "undone", metavar="FILE", help="Send this compensation.toml of the robot too.")
@click.option("--gains", "tuned", metavar="FILE", help="Send this gains.toml of `brickpilot tune` too.")
@set_option("Write this raw value to a setting; repeatable.")
@click.option("--start", is_flag=True, help="Start the mission at the end.")
@as_json
def upload(
    scenario_name: str, spec: str, profile: str | None, undone: str | None, tuned: str | None,
    written: tuple[str, ...], start: bool, as_json: bool,
) -> None:  # fmt: skip
    """Sends another mission and other settings to a brick that runs the autopilot; the image stays.

    SCENARIO is a packaged scenario or a file; the default is the paper's eight waypoints. An upload stops the motors.
    The route is read back from the brick and compared. The brick keeps route and settings until its program ends or
    another session begins. Each upload begins a session with the profile's constants, so send all settings together.
    """
    from brickpilot.vehicle import compensation, flight, gains, model, scenario

    settings = settings_of(written)  # these settings override those of the gain set
    chosen = scenario.load(scenario.find(scenario_name))
    if not chosen.waypoints:
        raise InputError("has no waypoints", field=scenario_name)
    plan = flight.plan(
        chosen, model.rcx(), profile=profile, sensors="imu", seed=None,
        compensation=compensation.load(Path(undone)) if undone else None,
        gains=gains.load(Path(tuned)) if tuned else None,
    )  # fmt: skip
    sent_again = _send(spec, plan, settings, start)
    figures = {
        "link": spec, "scenario": chosen.name, "profile": plan.controller, "waypoints": len(chosen.waypoints),
        "settings": settings, "started": start, "sent_again": sent_again,
    }  # fmt: skip
    line = (
        f"{len(chosen.waypoints)} waypoints of {chosen.name} and {len(settings)} settings were sent to the brick; "
        f"the mission was {'started' if start else 'not started'}; {sent_again} requests were sent again"
    )
    show(figures, [line], as_json=as_json)


def _send(spec: str, plan: Plan, settings: dict[str, int], start: bool) -> int:
    """Sends a plan and settings to the brick, reads the route back, and returns how many requests were sent again."""
    from brickpilot.link.brick import open_link, prepare
    from brickpilot.link.links import LinkGoneError
    from brickpilot.link.session import REALTIME, Session

    try:
        with closing(open_link(spec)) as link:
            session = Session(link, spec)
            prepare(session, plan, REALTIME, None, settings)
            route = session.route()
            if start:
                session.command("start")
    except LinkGoneError as error:
        raise InputError(str(error), field=f"--link {spec}") from None
    if route != [(round(x * 1e3), round(y * 1e3)) for x, y in plan.scenario.waypoints]:
        raise InputError(f"the brick holds another route, {route} mm", field=f"--link {spec}")
    return link.damaged + session.repeated
