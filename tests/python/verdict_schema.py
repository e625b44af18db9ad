"""The published schema of verdict.json, and a check of a finding against it."""

from __future__ import annotations

import json
from importlib import resources

from brickpilot.discover.finding import verdict_json
from jsonschema import Draft202012Validator

SCHEMA = json.loads(resources.files("brickpilot").joinpath("report/verdict.schema.json").read_text(encoding="utf-8"))


def closed(schema):
    """Returns the schema, changed to refuse keys that it does not describe; the published schema allows later keys."""
    if isinstance(schema, list):
        return [closed(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: closed(one) for key, one in schema.items()}
    return found | {"additionalProperties": False} if "required" in schema and "properties" in schema else found


CLOSED = closed(SCHEMA)


def check(finding):
    """Returns the content of verdict.json after a check against the schema."""
    figures = json.loads(json.dumps(verdict_json(finding), allow_nan=False))
    faults = [f"{one.json_path}: {one.message}" for one in Draft202012Validator(CLOSED).iter_errors(figures)]
    assert faults == []
    return figures
