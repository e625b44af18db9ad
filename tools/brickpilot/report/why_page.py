"""The page of `why`, and the constants that `why` writes for other programs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from brickpilot.data.shown import Result
from brickpilot.discover.finding import Finding
from brickpilot.report import experiment_files
from brickpilot.report.discover_runs import telling_figures
from brickpilot.report.template import render, render_plain
from brickpilot.report.user_terms import frames, told
from brickpilot.report.why_text import Answer, as_stated
from brickpilot.vehicle.drive_constants import FeedForward, Odometry, feed_forward, odometry

if TYPE_CHECKING:
    import pandas

CONTROLLER, HEADER, MOTOR_HEADER = "diff_drive_controller.yaml", "robot_constants.h", "motor_constants.h"

_FIGURES = 2  # number of figures that show what is wrong; report.html has all figures

FILES = {
    "report.html": "the complete finding, with plots",
    "verdict.json": "the complete finding, for programs",
    "model.toml": "the model with the missing effects, for brickpilot run, compare and calibrate",
    "compensation.toml": "for the firmware: brickpilot run --model model.toml --compensation compensation.toml",
    CONTROLLER: "odometry for ros2_control",
    HEADER: "the constants as C macros",
    MOTOR_HEADER: "the constants as C macros",
    **experiment_files.FILES,
    "data": "the log as a data set: brickpilot check, compare and discover take it",
}
"""Each file or folder that the command may write -> its purpose."""


@dataclass(frozen=True)
class Constants:
    """The constants that other programs need; see `vehicle.drive_constants`. `odometry` is None for a motor."""

    feed_forward: FeedForward
    odometry: Odometry | None

    def to_json(self) -> dict[str, Any]:
        one, wheels = self.feed_forward, self.odometry
        found: dict[str, Any] = {"feed_forward": {"ks": one.ks, "kv": one.kv, "ka": one.ka, "per": one.unit}}
        if wheels is not None:
            found["odometry"] = {
                "wheel_radius": wheels.radius,
                "wheel_separation": wheels.separation,
                "left_wheel_radius_multiplier": wheels.left,
                "right_wheel_radius_multiplier": wheels.right,
                "wheel_separation_multiplier": wheels.turning,
            }
        return found


def constants_of(finding: Finding) -> Constants:
    """Returns the constants of the augmented model; the odometry is relative to the stated radius and half track."""
    return Constants(feed_forward(finding.augmented), odometry(finding.augmented, as_stated(finding).parameters))


def files_of(name: str, constants: Constants) -> dict[str, str]:
    """Returns file -> text for other programs. `name`: the robot's name, in comments."""
    plain = re.sub(r"[^\w .+-]", " ", name)  # so that the name cannot end a comment in C or YAML
    speed = "MPS" if constants.feed_forward.unit == "m" else "RADPS"
    given: Mapping[str, object] = {
        "name": plain, "feed_forward": constants.feed_forward, "odometry": constants.odometry, "speed": speed,
        "c_float": _c_float,
    }  # fmt: skip
    if constants.odometry is None:
        return {MOTOR_HEADER: render_plain(HEADER, **given, what="MOTOR")}
    return {one: render_plain(one, **given, what="ROBOT") for one in (HEADER, CONTROLLER)}


def _c_float(value: float) -> str:
    """Returns a constant of type float in C, which needs a point or an exponent before its suffix."""
    text = f"{value:.6g}"
    return f"{text if '.' in text or 'e' in text else f'{text}.0'}f"


@dataclass(frozen=True)
class Why(Result):
    """The result of `why`.

    Attributes:
        finding: the result of discovery, from which the answer is made.
        constants: the constants of the augmented model, for other programs.
        notes: sentences on how the log was read.
    """

    finding: Finding
    answer: Answer
    constants: Constants
    notes: tuple[str, ...]

    def to_frame(self) -> pandas.DataFrame:
        """Returns the effects that were found; see `Finding.to_frame`."""
        return self.finding.to_frame()


def page(why: Why, *, source: str, files: Sequence[str], command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        source: the logs or data sets that were read, in words.
        files: the names of the files beside the page.
        command: the command line that reproduces the result.
    """
    finding, answer, constants, name = why.finding, why.answer, why.constants, why.finding.dataset.name
    return render(
        "why",
        title=f"{name} does what the simulation does"
        if answer.ending == "nothing"
        else f"Why {name} does not do what the simulation does",
        answer=answer,
        constants=constants,
        files=[(file, FILES.get(file, "the composed term in C")) for file in files],
        found=finding.verdict != "none",
        figures=telling_figures(finding, _FIGURES),
        frames=frames(finding.dataset),
        source=source,
        command=command,
        notes=told(finding.dataset, [*why.notes, *finding.notes]),
    )
