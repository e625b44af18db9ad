"""The topics of a run: its signals as logged, and its poses as Foxglove shows them.

Signals are in the run's own frame, y to the right and yaw clockwise. Foxglove's 3D panel has z up, so in poses and
transforms y is to the left and yaw counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from brickpilot.export.mcap_file import Sample, Topic, signals
from brickpilot.export.run_read import TIME, Array, Run, unit

POSES = {"/pose": "true", "/pose_estimate": "estimate"}
"""Topic of poses -> how the columns of its position begin."""

_POSE_EVERY = 10  # rows: 33 poses a second
_FRAME, _ROBOT = "map", "robot"
_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_TURN = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_POSE = {"type": "object", "properties": {"position": _VECTOR, "orientation": _TURN}}


def _schema(title: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": dict(fields), "required": list(fields)}


_IN_FRAME = {"timestamp": _TIME, "frame_id": {"type": "string"}}
_POSE_SCHEMA = _schema("foxglove.PoseInFrame", _IN_FRAME | {"pose": _POSE})
_PATH_SCHEMA = _schema("foxglove.PosesInFrame", _IN_FRAME | {"poses": {"type": "array", "items": _POSE}})
_FRAMES = {"parent_frame_id": {"type": "string"}, "child_frame_id": {"type": "string"}}
_MOVED = {"timestamp": _TIME, **_FRAMES, "translation": _VECTOR, "rotation": _TURN}
_TRANSFORM_SCHEMA = _schema("foxglove.FrameTransform", _MOVED)


def groups(run: Run) -> dict[str, dict[str, Array]]:
    """Returns topic -> field -> values of every column of the run, but for the times of its rows."""
    found: dict[str, dict[str, Array]] = {}
    for column, values in run.log.items():
        if column != TIME:
            topic, field = _place(column)
            found.setdefault(topic, {})[field] = values
    ticks = {name: values for name, values in run.ticks.items() if name != TIME}
    return found | ({"/ticks": ticks} if ticks else {})


def _place(column: str) -> tuple[str, str]:
    """Returns topic and field of a column of the log."""
    head, _, rest = column.partition("_")
    if head in ("true", "measured", "estimate"):
        return {"true": "/truth", "measured": "/sensors", "estimate": "/estimate"}[head], rest
    electrical = head in ("left", "right", "battery", "charge") and column.endswith(("_rad_s", "_a", "_v", "_c"))
    return ("/motors" if electrical else "/control"), column


def topics(run: Run) -> list[Topic]:
    """Returns the topics of a run."""
    found = [signals(name, {field: unit(field) for field in fields}) for name, fields in groups(run).items()]
    for name, head in POSES.items():
        if f"{head}_heading_rad" in run.log:
            found += [Topic(name, _POSE_SCHEMA, {}), Topic(f"{name}_path", _PATH_SCHEMA, {})]
    return [*found, Topic("/tf", _TRANSFORM_SCHEMA, {})]


def samples(run: Run) -> Iterator[Sample]:
    """Yields every message of a run, in the order of time."""
    of_ticks = {name: fields for name, fields in groups(run).items() if name == "/ticks"}
    of_log = {name: fields for name, fields in groups(run).items() if name not in of_ticks}
    signals_of = [*_rows(run.log[TIME], of_log), *_rows(run.ticks.get(TIME, np.empty(0)), of_ticks)]
    yield from sorted([*_paths(run), *signals_of, *_poses(run)], key=lambda one: one.time_ns)


def _ns(time: float) -> int:
    return round(time * 1e9)


def _rows(times: Array, fields_of: Mapping[str, Mapping[str, Array]]) -> Iterator[Sample]:
    """Yields a message for each row of each topic. What is not finite is null, as JSON has no NaN."""
    for topic, fields in fields_of.items():
        rows = np.column_stack(list(fields.values())).tolist()
        for time, row in zip(times.tolist(), rows, strict=True):
            pairs = zip(fields, row, strict=True)
            yield Sample(topic, _ns(time), {name: value if math.isfinite(value) else None for name, value in pairs})


def _stamp(time: float) -> dict[str, int]:
    return dict(zip(("sec", "nsec"), divmod(_ns(time), 10**9), strict=True))


def _pose(x: float, y: float, heading: float) -> dict[str, Any]:
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(-heading / 2), "w": math.cos(heading / 2)}
    return {"position": {"x": x, "y": -y, "z": 0.0}, "orientation": turn}


def _tracks(run: Run) -> Iterator[tuple[str, list[tuple[float, dict[str, Any]]]]]:
    """Yields each topic of poses with (time, pose) of every tenth row."""
    for name, head in POSES.items():
        if f"{head}_heading_rad" in run.log:
            columns = [run.log[key] for key in (TIME, f"{head}_x_m", f"{head}_y_m", f"{head}_heading_rad")]
            rows = np.column_stack(columns)[::_POSE_EVERY]
            known = rows[np.isfinite(rows).all(axis=1)].tolist()
            yield name, [(time, _pose(x, y, heading)) for time, x, y, heading in known]


def _poses(run: Run) -> Iterator[Sample]:
    for name, track in _tracks(run):
        for time, pose in track:
            yield Sample(name, _ns(time), {"timestamp": _stamp(time), "frame_id": _FRAME, "pose": pose})
            if name == "/pose":
                frames = {"parent_frame_id": _FRAME, "child_frame_id": _ROBOT}
                moved = {"translation": pose["position"], "rotation": pose["orientation"]}
                yield Sample("/tf", _ns(time), {"timestamp": _stamp(time), **frames, **moved})


def _paths(run: Run) -> Iterator[Sample]:
    """Yields each whole track once, at the start, so that the 3D panel shows it from there on."""
    for name, track in _tracks(run):
        start = track[0][0] if track else 0.0
        poses = [pose for _, pose in track]
        yield Sample(f"{name}_path", _ns(start), {"timestamp": _stamp(start), "frame_id": _FRAME, "poses": poses})
