"""`ask`: flies missions with a simulated robot over a link, to find which explanation of its behaviour is right."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Literal

from brickpilot.ask.courses import Limits
from brickpilot.ask.question import Asked, Choice, Driven
from brickpilot.ask.question import ask as ask_until
from brickpilot.constants import STEP_S
from brickpilot.data import reading
from brickpilot.data.rows import CsvFormat, read_columns
from brickpilot.discover.finding import Finding
from brickpilot.errors import InputError
from brickpilot.fit.descent import Progress
from brickpilot.hil.fly import Fence
from brickpilot.public import flights
from brickpilot.public.analysis import discover
from brickpilot.public.doors import FlightRequest, jobs_of, model_of, seed_of, silent, whole
from brickpilot.public.logs import import_log
from brickpilot.report import ask_page
from brickpilot.report.run_folder import fresh_folder
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.scenario import Scenario, render_mission

FILES = ("ask.html", "ask.json", "model.toml", "data", "flights")
"""The files and folders that `ask` writes into the folder `out`."""


def ask(
    robot: str | Path, model: Model | str | Path | None = None, *, link: str | None = None, target: str = "host",
    space_m: float = 1.5, speed_m_s: float = 0.4, battery_v: float | None = None, most: int = 6,
    sensors: str = "imu+encoders", lockstep: bool = True, seed: int = 0, jobs: int = 2,
    choose: Choice | None = None, out: str | Path | None = None, progress: Progress | None = None,
    command: str = "bp.ask",
) -> Asked:  # fmt: skip
    """Flies missions that distinguish the possible explanations of a robot's behaviour, until one explanation remains.

    The robot is simulated: its brick is at the other end of the link, and its plant is at this end. The plant has
    effects that the search does not know. Each mission begins at the same place. The search sees only the signals that
    a host of a real robot can log.

    Args:
        robot: the file of the simulated robot's model; the search has to find the effects of this model.
        model: the robot's model as the owner believes it to be, or the file of this model; None: the packaged robot.
        link, target, lockstep: where the brick is, as in `hil`.
        space_m: the fence: the largest distance from the start, m. The motors stop before the robot passes the fence.
        speed_m_s: the largest speed of a mission, m/s.
        battery_v: the lowest battery voltage, V, at which a mission may begin; None: no limit.
        most: the largest number of missions, 1..32.
        sensors: "imu" or "imu+encoders".
        seed: the seed of the sensors' noise and of the search, 0 or more.
        jobs, progress: as in `discover`.
        choose: chooses each mission after the first; None: the mission that distinguishes best between the rival
            explanations is chosen.
        out: the folder with the page, the flights and their data set; None: runs/ask-NAME.
        command: the command line that the page shows, to repeat the call.

    Raises:
        InputError: an argument is wrong, or a link cannot be opened.
        SimulationError: the plant diverges.
    """
    limits = Limits(space_m, speed_m_s, battery_v, whole("most", most, 1, 32))
    seed, jobs = seed_of(seed), jobs_of(jobs)
    believed, show = model_of(model) or rcx(), progress or silent
    if sensors not in ("imu", "imu+encoders"):
        raise InputError(f"{sensors!r} is not one of imu, imu+encoders", field="sensors")
    stated = {name: value for name, value in believed.parameters.items() if rcx().parameters.get(name) != value}
    spec = flights.link_of(link, target, lockstep)
    file = Path(robot).resolve()
    model_file.load(file)  # refuses a bad file before the first flight
    folder = Path(out) if out else Path("runs") / f"ask-{file.stem}"
    with fresh_folder(folder, FILES) as beside:
        made: list[Path] = []

        def drive(course: Scenario) -> Driven:
            show(len(made), limits.most, f"driving {course.title}")
            own = beside / "flights" / f"{len(made) + 1}_{course.name}"
            own.parent.mkdir(exist_ok=True)
            mission = own.with_suffix(".toml")
            mission.write_text(render_mission(course), encoding="utf-8")
            # Each flight has another seed, and so other noise.
            request = FlightRequest(
                scenario_file=str(mission), profile="coupled", sensors=sensors, model_file=file, seed=seed + len(made)
            )
            fence = Fence(limits.reach_m)
            flown = flights.fly_over(request, flights.Session(spec, lockstep, watch=fence), own, silent)
            made.append(own)
            ended: Literal["fence", "link"] | None = "fence" if fence.crossed else None
            if flown.figures["broke_off"] is not None:
                ended = "link"
            (battery,) = read_columns(own / "log.csv", {"battery": "battery_v"}, CsvFormat()).values.values()
            return Driven(flown.figures["steps"] * STEP_S, float(battery[-1]), ended)

        def conclude() -> Finding:
            show(len(made), limits.most, "concluding")
            shutil.rmtree(beside / "data", ignore_errors=True)
            data = reading.read(import_log(made, beside / "data", kind="flight", nominal=stated).folder)
            return discover(data, believed if believed.effects else None, seed=seed, jobs=jobs)

        asked = ask_until(believed, sensors, limits, drive, conclude, choose)
        text = json.dumps(asked.to_json(), indent=2, allow_nan=False) + "\n"
        (beside / "ask.json").write_text(text, encoding="utf-8")
        (beside / "ask.html").write_text(ask_page.page(asked, file.stem, command), encoding="utf-8")
        model_file.save(dataclasses.replace(asked.finding.augmented, name=file.stem), beside / "model.toml")
    return asked
