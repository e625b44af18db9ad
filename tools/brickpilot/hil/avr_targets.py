"""The images of `firmware/targets/avr` that can be flown. Needs no library of a link, so that `bench` can list them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AvrTarget:
    """An image of `firmware/targets/avr` for a chip, as simavr names it, and the sensors that it flies with."""

    chip: str
    build: tuple[str, str]
    sensors: tuple[str, ...]


AVR_TARGETS = {
    "avr:328p-imu": AvrTarget("atmega328p", ("328p", "imu"), ("imu",)),
    "avr:328p-rotation": AvrTarget("atmega328p", ("328p", "rotation"), ("imu+encoders",)),
    "avr:328p-mpu6050": AvrTarget("atmega328p", ("328p", "imu-mpu6050"), ("imu",)),
    "avr:328p-lsm6ds": AvrTarget("atmega328p", ("328p", "imu-lsm6ds"), ("imu",)),
    "avr:2560": AvrTarget("atmega2560", ("2560", "all"), ("imu+encoders",)),
}
"""Target -> its image."""
