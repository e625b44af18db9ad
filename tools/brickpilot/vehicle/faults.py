"""The [[faults]] of a scenario: what fails between plant and controller, and when. hil/ makes them happen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.constants import STEP_S
from brickpilot.data.toml_file import TomlFile

MESSAGE_KINDS = ("drop", "delay", "duplicate", "reorder", "corrupt", "truncate", "flood", "disconnect")
SENSOR_KINDS = ("stuck_sensor", "missing_sensor")
END_KINDS = ("brown_out", "controller_restart", "plant_restart")
AVR_KINDS = ("main_held", "interrupt_stuck", "converter_stuck", "overrun", "encoder_noise")
"""Faults in an AVR and at its pins: only `hil --target avr` has them."""

KINDS = (*MESSAGE_KINDS, *SENSOR_KINDS, *END_KINDS, *AVR_KINDS)
RATED_KINDS = (*MESSAGE_KINDS, "overrun", "encoder_noise")
SENSORS = ("imu", "rotation", "battery", "reference")
DIRECTIONS = ("both", "to_brick", "from_brick")


@dataclass(frozen=True)
class Fault:
    """One fault, from ``from_s`` until ``to_s``.

    Attributes:
        kind: of KINDS.
        from_s, to_s: s of the flight; the restarts happen at ``from_s``.
        rate: share of the messages or bytes that are disturbed, or of the most possible pulses of noise, 0..1.
        direction: which messages, of DIRECTIONS.
        sensor: of SENSORS, for SENSOR_KINDS.
    """

    kind: str
    from_s: float
    to_s: float
    rate: float = 1.0
    direction: str = "both"
    sensor: str = ""

    def acts(self, step: int) -> bool:
        """Whether the fault acts at control step `step`."""
        return self.from_s - STEP_S / 2 <= step * STEP_S < self.to_s - STEP_S / 2

    def begins(self, step: int) -> bool:
        """Whether `step` is the fault's first."""
        return self.acts(step) and not self.acts(step - 1)

    def ends(self, step: int) -> bool:
        """Whether `step` is the first after the fault."""
        return self.acts(step - 1) and not self.acts(step)


def parse(toml: TomlFile, value: object, duration: float) -> tuple[Fault, ...]:
    """Reads the [[faults]] of a scenario.

    Raises:
        InputError: the message names file, line and key.
    """
    if not isinstance(value, list):
        toml.refuse(("faults",), "needs to be a list of tables, [[faults]]")
    return tuple(_fault(toml, ("faults", index), entry, duration) for index, entry in enumerate(value))


def _fault(toml: TomlFile, key: tuple[str, int], entry: object, duration: float) -> Fault:
    table: Mapping[str, Any] = toml.table(key, entry)
    toml.known_keys(key, table, {"kind", "from_s", "to_s", "rate", "direction", "sensor"})
    for name in ("kind", "from_s"):
        if name not in table:
            toml.refuse((*key, name), "is missing")
    kind = toml.choice((*key, "kind"), table["kind"], KINDS)
    begin = toml.number((*key, "from_s"), table["from_s"], 0.0, duration, "s")
    end = toml.number((*key, "to_s"), table.get("to_s", duration), begin, duration, "s")
    if kind in SENSOR_KINDS and "sensor" not in table:
        toml.refuse((*key, "sensor"), f"is missing: {', '.join(SENSORS)}")
    for name, kinds in (("sensor", SENSOR_KINDS), ("rate", RATED_KINDS), ("direction", MESSAGE_KINDS)):
        if name in table and kind not in kinds:
            toml.refuse((*key, name), f"cannot be used with {kind}")
    return Fault(
        kind,
        begin,
        end,
        toml.number((*key, "rate"), table.get("rate", 1.0), 0.0, 1.0),
        toml.choice((*key, "direction"), table.get("direction", "both"), DIRECTIONS),
        toml.choice((*key, "sensor"), table["sensor"], SENSORS) if "sensor" in table else "",
    )
