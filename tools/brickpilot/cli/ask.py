"""`brickpilot ask`: a robot behind a link flies missions that show which explanation of its behaviour is right."""

from __future__ import annotations

from pathlib import Path

import click

from brickpilot.cli.terminal import model_option, progress_shown, search_options, show, target_option


@click.command()
@click.argument("robot")
@click.option(
    "--link", metavar="LINK", help="The link to the brick, as in hil: serial:pty, tcp, can:virtual, serial:PORT, ..."
)
@target_option("A simulated processor instead of --link, as in hil.")
@click.option("--realtime", is_flag=True, help="Follow the clock; default: lockstep, a step for each reply.")
@model_option("The model that the robot's owner believes in; default: the packaged robot.")
@click.option(
    "--space", type=float, default=1.5, show_default=True, metavar="M", help="The largest distance from the start, m."
)
@click.option(
    "--speed", type=float, default=0.4, show_default=True, metavar="M/S", help="The largest speed of a mission, m/s."
)
@click.option("--battery", type=float, metavar="V", help="Begin no mission below this voltage of the battery.")
@click.option(
    "--most", type=click.IntRange(1, 32), default=6, show_default=True, help="The largest number of missions."
)
@click.option("--sensors", type=click.Choice(["imu", "imu+encoders"]), default="imu+encoders", show_default=True)
@click.option("--out", metavar="DIR", help="The folder to write; default runs/ask-ROBOT.")
@search_options
def ask(
    robot: str, link: str | None, target: str, realtime: bool, model: str | None, space: float, speed: float,
    battery: float | None, most: int, sensors: str, out: str | None, seed: int, jobs: int, as_json: bool,
) -> None:  # fmt: skip
    """Flies missions until one explanation is left for the difference between ROBOT and its model.

    ROBOT is the model.toml of the simulated robot at this end of the link; the search does not see it. Each mission
    begins at the same place and stays within --space and --speed. It is the mission in which the remaining explanations
    differ most. The motors stop if the position that the brick estimates is beyond the fence of --space, or if the
    link is lost. The exit status is 1 if the fence, a lost link or a limit ended the missions. The page ask.html shows
    the missions and the changes of the explanations' weights.
    """
    from brickpilot.errors import WorkFailedError
    from brickpilot.public import asking
    from brickpilot.public.doors import command_line
    from brickpilot.report import ask_page

    folder = Path(out) if out else Path("runs") / f"ask-{Path(robot).stem}"
    target_given = None if target == "host" else target
    command = command_line(
        "ask", robot, link=link, target=target_given, realtime=realtime, model=model, space=space, speed=speed,
        battery=battery, most=most, sensors=sensors, seed=seed,
    )  # fmt: skip
    with progress_shown(as_json) as progress:
        asked = asking.ask(
            robot, model, link=link, target=target, space_m=space, speed_m_s=speed, battery_v=battery, most=most,
            sensors=sensors, lockstep=not realtime, seed=seed, jobs=jobs, out=folder, progress=progress,
            command=command,
        )  # fmt: skip
    show(asked.to_json(), [*ask_page.lines(asked), f"page: {folder / 'ask.html'}"], as_json=as_json)
    if asked.stopped in ("fence", "link", "budget"):
        raise WorkFailedError(asked.sentence)
