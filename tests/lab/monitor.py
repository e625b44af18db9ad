"""How soon the firmware's monitor finds causes that set in during a flight, and how often it finds one without need.

    nice .venv/bin/python tests/lab/monitor.py [--flights N] [--sensors imu+encoders]

Prints a table with N flights of the packaged mission for each of four causes at three sizes, and N without a cause.
Onsets are spread evenly over 8 to 20 s, and each flight has its own seed.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections import Counter

import numpy as np
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.flight_figures import CAUSES

MISSION = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=45.0)
CHANNELS = ("left", "right", "battery")
COLUMNS = ("time_s", "mode", *(f"{c}_{k}" for c in CHANNELS for k in ("cause", "cause_size", "cause_since_s")))
FIRST, LAST = 8.0, 20.0  # s: the onsets
RUNS = 1  # the mode in which the motors drive

CASES = {
    "friction": [("coulomb_friction", {"torque": t}, f"{1e3 * t:g} mN m") for t in (0.002, 0.005, 0.012)],
    "braking": [("viscous_loss", {"drag": d}, f"{1e3 * d:g} mN m s") for d in (2e-4, 4e-4, 1e-3)],
    "supply": [("battery_sag", {"resistance": r}, f"{r:g} ohm") for r in (2.0, 4.0, 8.0)],
    "slip": [("wheel_slip", {"creep": c, "friction": 0.8}, f"creep {c:g} m/(N s)") for c in (0.1, 0.2, 0.4)],
}
"""Cause -> effect, its parameters, and the size in words, for three sizes."""


@dataclasses.dataclass(frozen=True)
class Told:
    """What the monitor told in one flight; times in s, None: nothing.

    `first` is the first cause named (after the onset), `last` are the causes named at the end.
    """

    onset: float
    driven: float
    found_at: float | None
    first: str | None
    first_at: float | None
    last: tuple[str, ...]


def fly(cause: tuple[str, dict[str, float], str] | None, sensors: str, seed: int, onset: float) -> Told:
    """Flies the mission once."""
    effects = {} if cause is None else {cause[0]: cause[1]}
    mission = dataclasses.replace(MISSION, effects=effects, sets_in_at=onset if effects else 0.0)
    log = flight.fly(flight.plan(mission, profile="coupled", sensors=sensors, seed=seed), columns=COLUMNS).log
    codes = np.array([log[f"{channel}_cause"] for channel in CHANNELS]).astype(int)
    found, named = np.flatnonzero(codes.any(axis=0)), np.flatnonzero((codes > 1).any(axis=0))
    return Told(
        onset,
        float(np.count_nonzero(log["mode"] == RUNS) * (log["time_s"][1] - log["time_s"][0])),
        float(log["time_s"][found[0]]) if len(found) else None,
        CAUSES[int(codes[:, named[0]].max())] if len(named) else None,
        float(log["time_s"][named[0]]) if len(named) else None,
        tuple(CAUSES[code] for code in codes[:, -1] if code > 1),
    )


def row(name: str, size: str, told: list[Told]) -> str:
    """Returns a row of the table of one cause at one size."""
    found = [one for one in told if one.found_at is not None and one.found_at >= one.onset]
    early = sum(one.found_at is not None and one.found_at < one.onset for one in told)
    delays = [one.found_at - one.onset for one in found if one.found_at is not None]
    named = [one.first_at - one.onset for one in found if one.first_at is not None]
    right = sum(one.first == name for one in found)
    last = Counter(cause for one in found for cause in set(one.last))
    delay = f"{np.median(delays):.1f}, {np.percentile(delays, 95):.1f} s" if delays else "-"
    named_after = f"{np.median(named):.1f} s" if named else "-"
    share = 100 / max(len(found), 1)
    return (
        f"| {name} | {size} | {100 * len(found) / len(told):.0f} % | {early} | {delay} | {named_after} | "
        f"{share * right:.0f} % | {share * last[name]:.0f} % |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--sensors", default="imu+encoders", choices=scenario.SENSORS)
    chosen = parser.parse_args()
    onsets = np.linspace(FIRST, LAST, chosen.flights)
    sound = [fly(None, chosen.sensors, seed, 0.0) for seed in range(chosen.flights)]
    false, hours = sum(one.found_at is not None for one in sound), sum(one.driven for one in sound) / 3600
    print(f"{chosen.sensors}: {false} false alarms in {chosen.flights} flights, {hours:.1f} h of driving")
    print("| cause | size | found | before | delay, median and 95 % | named after | first name right | at the end |")
    print("|---|---|---|---|---|---|---|---|")
    for name, sizes in CASES.items():
        for number, case in enumerate(sizes):
            seeds = range(chosen.flights)
            told = [fly(case, chosen.sensors, seed + 10**6 * (number + 1), onsets[seed]) for seed in seeds]
            print(row(name, case[2], told), flush=True)


if __name__ == "__main__":
    main()
