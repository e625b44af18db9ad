"""A layout for Foxglove: the panels that show the topics of a run, or of a link's traffic."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from brickpilot.export.mcap_file import Topic

_PLOTS = {
    "Speed": ("/truth.speed_m_s", "/estimate.speed_m_s", "/control.demand_speed_m_s"),
    "Heading": ("/truth.heading_rad", "/estimate.heading_rad", "/control.demand_heading_rad"),
    "Motors": (
        "/motors.left_voltage_v",
        "/motors.right_voltage_v",
        "/motors.left_current_a",
        "/motors.right_current_a",
    ),
    "Sensors": ("/sensors.yaw_rate_rad_s", "/sensors.accel_surge_m_s2", "/sensors.accel_sway_m_s2"),
    "Cross track": ("/control.cross_track_m", "/control.heading_error_rad"),
    "Link": ("/ticks.round_trip_ms", "/ticks.late_ticks", "/ticks.lost_frames"),
}
_STATES = ("/control.mode", "/control.phase", "/control.waypoint", "/control.fault")


def run_layout(topics: Sequence[Topic]) -> str:
    """Returns the layout of a run, with the plots of which it has the signals."""
    have = {f"{topic.name}.{field}" for topic in topics for field in topic.units}
    panels = {"3D!run": _scene([topic.name for topic in topics if topic.name.startswith("/pose")])}
    for title, paths in _PLOTS.items():
        if shown := [path for path in paths if path in have]:
            panels[f"Plot!{title.lower().replace(' ', '-')}"] = _plot(title, shown)
    if states := [path for path in _STATES if path in have]:
        panels["StateTransitions!mode"] = {"paths": [_path(path) for path in states], "isSynced": True}
    return _layout(panels)


def traffic_layout(topics: Sequence[Topic]) -> str:
    """Returns the layout of a link's traffic: one plot for each message, of its fields."""
    panels = {
        f"Plot!{topic.name.rpartition('/')[2].lower()}": _plot(
            topic.name, [f"{topic.name}.{field}" for field in topic.units]
        )
        for topic in topics
        if topic.units
    }
    return _layout(panels)


def _path(value: str) -> dict[str, Any]:
    return {"value": value, "enabled": True, "timestampMethod": "receiveTime"}


def _plot(title: str, paths: Sequence[str]) -> dict[str, Any]:
    return {
        "title": title,
        "paths": [_path(path) for path in paths],
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _scene(topics: Sequence[str]) -> dict[str, Any]:
    colours = ("#2a9d8fff", "#e76f51ff")
    shown = {
        topic: {
            "visible": True,
            "color": colours["estimate" in topic],
            "lineWidth": 0.01,
            "type": "line" if "path" in topic else "arrow",
        }
        for topic in topics
    }
    grid = {"layerId": "foxglove.Grid", "visible": True, "frameLocked": True, "size": 6, "divisions": 12}
    camera = {"distance": 5, "perspective": False, "phi": 0, "thetaOffset": 90, "target": [0, 0, 0]}
    return {"fixedFrame": "map", "topics": shown, "layers": {"grid": grid}, "cameraState": camera}


def _layout(panels: Mapping[str, Any]) -> str:
    layout = {
        "configById": dict(panels),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(list(panels), "row"),
    }
    return json.dumps(layout, indent=2) + "\n"


def _split(names: Sequence[str], direction: str) -> Any:
    """Returns panels side by side and one above the other in turn, each half as many."""
    if len(names) <= 1:
        return names[0] if names else ""
    half = max(1, len(names) // 2) if direction == "column" else 1 if names[0].startswith("3D") else len(names) // 2
    parts = (_split(names[:half], "column"), _split(names[half:], "column" if direction == "row" else "row"))
    return {"first": parts[0], "second": parts[1], "direction": direction, "splitPercentage": 50}
