"""Odd effects, which are not in the library of Brickpilot. Each function adds one odd effect to a plant."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hidden.planar_plant import Plant, in_body

Parameters = Mapping[str, float]


def crosstalk(plant: Plant, p: Parameters) -> None:
    """Subtracts a share of the other side's voltage from each side's voltage."""
    mix = np.array([[1.0, -p["share"]], [-p["share"], 1.0]])

    def hook(plant: Plant) -> None:
        plant.voltage[:] = mix @ plant.voltage

    plant.drive.append(hook)


def voltage_gain(plant: Plant, p: Parameters) -> None:
    """Makes each drive give the voltage V (1 - loss |V|) instead of V."""

    def hook(plant: Plant) -> None:
        plant.voltage *= 1 - p["loss"] * np.abs(plant.voltage)

    plant.drive.append(hook)


def periodic_force(plant: Plant, p: Parameters) -> None:
    """Adds a longitudinal force that is a sine of the time since power-on."""

    def hook(plant: Plant) -> None:
        plant.force[0] += p["force"] * np.sin(2 * math.pi * p["frequency"] * (plant.age + plant.time))

    plant.loads.append(hook)


def friction_with_voltage(plant: Plant, p: Parameters) -> None:
    """Adds dry friction to each wheel that grows with the wheel's commanded voltage, N m/V."""

    def hook(plant: Plant) -> None:
        plant.bound += p["slope"] * np.abs(plant.command)

    plant.bounds.append(hook)


def drag_patch(plant: Plant, p: Parameters) -> None:
    """Adds linear drag, N s/m, to surge while x is between two values."""
    plant.needs_position = True

    def hook(plant: Plant) -> None:
        inside = (plant.position[0] >= p["from"]) & (plant.position[0] <= p["to"])
        plant.force[0] -= p["drag"] * plant.surge * inside

    plant.loads.append(hook)


def angle_brake(plant: Plant, p: Parameters) -> None:
    """Adds dry friction to each wheel with two maxima per turn of the wheel, N m."""

    def hook(plant: Plant) -> None:
        plant.bound += 0.5 * p["torque"] * (1 + np.cos(2 * plant.angle))

    plant.bounds.append(hook)


def cubic_drag(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[0] -= p["drag"] * plant.surge**3

    plant.loads.append(hook)


def yaw_by_speed(plant: Plant, p: Parameters) -> None:
    """Adds a clockwise moment proportional to the square of surge."""

    def hook(plant: Plant) -> None:
        plant.force[2] += p["moment"] * plant.surge**2

    plant.loads.append(hook)


def turn_force(plant: Plant, p: Parameters) -> None:
    """Adds the longitudinal force share * m u r: driving forward, it accelerates right turns and brakes left turns."""

    def hook(plant: Plant) -> None:
        plant.force[0] += p["share"] * plant.mass * plant.surge * plant.yaw

    plant.loads.append(hook)


def load_ramp(plant: Plant, p: Parameters) -> None:
    """Adds dry friction to the wheels that grows with the time since power-on, N m/s."""

    def hook(plant: Plant) -> None:
        plant.bound += p["rate"] * (plant.age + plant.time)

    plant.bounds.append(hook)


def heading_spring(plant: Plant, p: Parameters) -> None:
    """Adds a moment that turns the vehicle back to heading 0."""

    def hook(plant: Plant) -> None:
        plant.force[2] -= p["moment"] * np.sin(plant.heading)

    plant.loads.append(hook)


def tether(plant: Plant, p: Parameters) -> None:
    """Adds the force of a spring, N/m, between the vehicle and the start point of the run."""
    plant.needs_position = True

    def hook(plant: Plant) -> None:
        ahead, aside = in_body(plant, plant.position[0], plant.position[1])
        plant.force[0] -= p["stiffness"] * ahead
        plant.force[1] -= p["stiffness"] * aside

    plant.loads.append(hook)
