"""Turns telemetry into the controller's columns of a flight's log."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import STEP_MS
from brickpilot.link.messages import book

Array = NDArray[np.float64]

COLUMNS = {
    "estimate_x_m": ("TELEMETRY_X", "x"),
    "estimate_heading_rad": ("TELEMETRY_X", "heading"),
    "waypoint": ("TELEMETRY_X", "waypoint"),
    "estimate_y_m": ("TELEMETRY_Y", "y"),
    "estimate_speed_m_s": ("TELEMETRY_Y", "speed"),
    "overshoots": ("TELEMETRY_Y", "overshoots"),
    "estimate_yaw_rate_rad_s": ("TELEMETRY_TRACK", "yaw_rate"),
    "cross_track_m": ("TELEMETRY_TRACK", "cross_track"),
    "heading_error_rad": ("TELEMETRY_TRACK", "heading_error"),
    "gyro_full_steps": ("TELEMETRY_EFFORT", "gyro_full"),
    "mode": ("TELEMETRY_TRACK", "mode"),
    "phase": ("TELEMETRY_TRACK", "phase"),
    "at_rest": ("TELEMETRY_TRACK", "at_rest"),
    "bias_unknown": ("TELEMETRY_TRACK", "bias_unknown"),
    "demand_speed_m_s": ("TELEMETRY_DEMAND", "speed"),
    "demand_heading_rad": ("TELEMETRY_DEMAND", "heading"),
    "fault": ("TELEMETRY_DEMAND", "fault"),
    "surge_saturated": ("TELEMETRY_DEMAND", "surge_saturated"),
    "yaw_saturated": ("TELEMETRY_DEMAND", "yaw_saturated"),
    "speed_p_v": ("TELEMETRY_SPEED", "proportional"),
    "speed_i_v": ("TELEMETRY_SPEED", "integral"),
    "speed_d_v": ("TELEMETRY_SPEED", "derivative"),
    "yaw_p_v": ("TELEMETRY_HEADING", "proportional"),
    "yaw_i_v": ("TELEMETRY_HEADING", "integral"),
    "yaw_d_v": ("TELEMETRY_HEADING", "derivative"),
    "surge_effort_v": ("TELEMETRY_EFFORT", "surge"),
    "yaw_effort_v": ("TELEMETRY_EFFORT", "yaw"),
}
"""Column of the log -> (message, signal)."""

LAST = "TELEMETRY_EFFORT"
TICK_AT = 6


class Telemetry:
    """Collects a brick's telemetry. `waypoint` and `mode` are the newest values, for a live view."""

    def __init__(self) -> None:
        self._layouts = {layout.id: layout for name, layout in book().by_name.items() if name.startswith("TELEMETRY_")}
        self._names = {layout.id: layout.name for layout in self._layouts.values()}
        self._rows: dict[str, tuple[list[int], list[tuple[int, ...]]]] = {
            name: ([], []) for name in self._names.values()
        }
        self._choices = {
            message.name: [
                (self._layouts[message.frame_id].names.index(one.name), len(one.choices))
                for one in message.signals
                if one.choices
            ]
            for message in book().database.messages
            if message.frame_id in self._layouts
        }
        self.newest_step = -1
        self.mode = 0
        self.waypoint = 0

    def take(self, identifier: int, data: bytes, step: int, *, lockstep: bool) -> bool:
        """Stores a message. Returns False if it is no telemetry.

        Args:
            identifier: the id of the message.
            data: its bytes.
            step: the present control step.
            lockstep: the brick has the plant's clock, so the low byte of its time gives the step, up to 85 steps ago.
        """
        layout = self._layouts.get(identifier)
        if layout is None:
            return False
        if len(data) != 8:
            return True
        if lockstep:
            age_ms = (STEP_MS * step - data[TICK_AT]) & 255
            step -= age_ms // STEP_MS
        row = layout.unpack(data)
        if any(row[at] >= count for at, count in self._choices[layout.name]):
            return True  # damaged on a transport without a checksum
        steps, values = self._rows[layout.name]
        steps.append(max(step, 0))
        values.append(row)
        if layout.name == LAST:
            self.newest_step = step
        elif layout.name == "TELEMETRY_TRACK":
            self.mode = values[-1][layout.names.index("mode")]
        elif layout.name == "TELEMETRY_X":
            self.waypoint = values[-1][layout.names.index("waypoint")]
        return True

    def columns(self, steps: int) -> dict[str, Array]:
        """Returns each of COLUMNS with shape (steps,): 0 before the first report, then the last report."""
        found = {}
        for column, (message, signal) in COLUMNS.items():
            at, rows = self._rows[message]
            layout = book().by_name[message]
            found[column] = _held(at, [row[layout.names.index(signal)] for row in rows], steps)
            found[column] = found[column] * book().scale(message, signal)
        return found


def _held(at: list[int], values: list[int], steps: int) -> Array:
    column = np.zeros(steps)
    if not at:
        return column
    newest = np.full(steps, -1)
    inside = np.asarray(at) < steps
    newest[np.asarray(at)[inside]] = np.flatnonzero(inside)
    newest = np.maximum.accumulate(newest)
    known = newest >= 0
    column[known] = np.asarray(values, dtype=np.float64)[newest[known]]
    return column
