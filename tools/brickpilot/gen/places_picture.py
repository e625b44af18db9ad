"""Draws `tools/places.svg`, which says in the README what runs where: on this machine, in simulators, on bricks."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from brickpilot.gen.svg_figure import BLUE, GREEN, GREY, ORANGE, figure, to_svg

_PLANT, _WORLD = "plant: robot and sensors\nin double precision", "motors, sensors,\nfloor"
_ROWS = (
    ("brickpilot run", _PLANT, "hal/sil", "in one process", "firmware\nfor this machine", GREY),
    ("hil --link", _PLANT, "hal/link", "serial, TCP, CAN", "firmware\nfor this machine", GREY),
    ("hil --target h8sim", _PLANT, "hal/link", "simulator of the H8/300", "firmware for the\nRCX's processor", BLUE),
    ("hil --target avr:...", _PLANT, "hal/avr", "pins and volts, simavr", "image for the\nATmega328P or 2560", ORANGE),
    ("LEGO RCX", _WORLD, "hal/rcx", "brickOS, H8/3292", "image\nbrickpilot.lx", BLUE),
    ("Arduino Uno, Mega", _WORLD, "hal/avr", "ATmega328P, 2560", "image\nbrickpilot.hex", ORANGE),
)  # fmt: skip
_LEFT, _MIDDLE, _RIGHT, _WIDE, _HIGH = 2.8, 5.3, 7.7, 1.9, 0.62


def _box(axis: Axes, x: float, y: float, text: str, colour: str) -> None:
    corner = (x - _WIDE / 2, y - _HIGH / 2)
    axis.add_patch(FancyBboxPatch(corner, _WIDE, _HIGH, "round,pad=0.04", fill=False, edgecolor=colour, linewidth=1.4))
    axis.text(x, y, text, ha="center", va="center", fontsize=8)


def picture() -> str:
    """Returns the picture as SVG: a row for each place where the firmware runs, with its world and its port."""
    drawn, (axis,) = figure(width=8.6, row_height=5.2)
    axis.set_axis_off()
    axis.grid(visible=False)
    for number, (name, world, port, place, program, colour) in enumerate(_ROWS):
        y = -float(number)
        axis.text(0.0, y, name, ha="left", va="center", fontsize=9, fontweight="bold")
        _box(axis, _LEFT, y, world, GREEN)
        _box(axis, _RIGHT, y, program, colour)
        for start, end in ((_LEFT + _WIDE / 2 + 0.05, _MIDDLE - 0.62), (_MIDDLE + 0.62, _RIGHT - _WIDE / 2 - 0.05)):
            axis.annotate("", (end, y), (start, y), arrowprops={"arrowstyle": "<->", "color": GREY})
        axis.text(_MIDDLE, y + 0.06, port, ha="center", va="bottom", fontsize=9, color=colour)
        axis.text(_MIDDLE, y - 0.08, place, ha="center", va="top", fontsize=7)
    axis.set_xlim(-0.05, _RIGHT + _WIDE / 2 + 0.1)
    axis.set_ylim(-len(_ROWS) + 0.55, 0.45)
    return to_svg(
        drawn, "what runs where: the same firmware on this machine, in two simulators, on an RCX and on Arduinos"
    )


def main() -> None:
    """Writes the picture; run from the root of a checkout."""
    Path("tools/places.svg").write_text(picture(), encoding="utf-8")


if __name__ == "__main__":
    main()
