"""firmware/app/params_gen.h: the controller's constants for both profiles, in the firmware's formats.

The values of a user's robot are checked against the ranges of these formats. A coefficient of the model depends on
several values. If a coefficient does not fit, each value is changed alone until the constants can be made. The error
names the value that has to change least, and its valid range while all other values stay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NoReturn

from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.firmware.robot import Place, Robot, changed, entry
from brickpilot.text_template import render_text
from brickpilot.vehicle.coefficients import PROFILES, VOLTAGE_LIMIT, WHEEL_SPEED_LIMIT, body
from brickpilot.vehicle.combinations import Values, difference_inertia, loss, mean_inertia, wheel_speed_per_volt
from brickpilot.vehicle.compensation import HIGHEST_OWN
from brickpilot.vehicle.fixed_point import QuantisationError, initialiser, integer
from brickpilot.vehicle.settings import Setting, constants, default, plain, settings

INT16, UINT16 = 32767, 65535
LONGEST_STEP_MS = 20
"""The longest step in ms that firmware/app/loop.c integrates completely; a watchdog must not allow a longer step."""

MONITOR_BLOCK_S, MONITOR_SHARE = 0.096, 0.2
"""The block of firmware/monitor/monitor.h, and the size of causes that it looks for."""

TRAVEL_SCALE = "travel_scale_q15"
"""The only compensation without a field of its own: the constant of the travel per count includes it."""

GYRO_FULL = 0.98
"""Share of the gyro's range above which a reading counts as saturated; the rest is for noise and resolution."""

CURRENT_SHARES = (1.0, 4.0, 16.0, 64.0, 256.0, 0.25, 0.0625)
"""Ratios of the motor's current to the model's current, in the order in which the ratios are tried."""

PER_CURRENT = ("resistance", "inductance", "torque_constant")
PER_VOLTAGE = ("resistance", "inductance", "emf_constant")
PER_TURN = {"wheel_radius": 1, "emf_constant": 1, "torque_constant": 1, "viscous_friction": 2, "wheel_inertia": 2}
"""Parameter -> power n: for the same motion, the parameter is proportional to radius^n (eq. 12 to 14)."""

SMALLEST_WHEEL, LARGEST_WHEEL = 1 / 64, 1 / 16
"""Limits of the wheel's radius, m: between them, `surge_from_wheel` and `quarter_wheel_from_surge` are below 1."""

BATTERY_MOST = 29.0
"""Largest nominal voltage of a battery, V; the charged battery then has at most the voltage `HIGHEST_OWN`."""

MILLIVOLTS = round(HIGHEST_OWN * 1e3)

SPEED_Q17_PER_TRAVEL_Q5 = 1e3 * 2**17 / (1e6 * 2**5)


def _q15(share: float, name: str) -> int:
    return integer(share * 32767, 0, INT16, name)


def _heading(common: Values, gyro_range: float) -> dict[str, Any]:
    bits = math.log2(common["gyro_bias_blocks"])
    if not bits.is_integer():
        raise QuantisationError(f"gyro_bias_blocks: {common['gyro_bias_blocks']:g} is no power of two")
    return {
        "quiet_mrad_s": integer(common["gyro_quiet"] * 1e3, 1, INT16, "gyro_quiet"),
        "rest_speed_mm_s_q4": integer(common["rest_speed"] * 16e3, 0, INT16, "rest_speed"),
        "slowest_weight_bits": integer(bits, 0, 7, "gyro_bias_blocks"),
        "blind_ms": integer(common["blind_time"] * 1e3, 0, 65000, "blind_time"),
        "gyro_full_mrad_s": integer(GYRO_FULL * gyro_range * 1e3, 1, INT16, "gyro_range"),
    }


def _friction(profile: str, values: Values) -> dict[str, Any]:
    """Returns a `friction_config_t`. `paper` learns no friction: its wheels do not push the body."""
    pull = values["torque_constant"] * values["wheel_radius"]
    per_acceleration = values["resistance"] * mean_inertia(values) / pull  # V per m/s^2, both motors
    return {
        "mv_per_mm_s2_q10": min(round(per_acceleration * 2**10), INT16) if profile == "coupled" else 0,
        "half_track_m_q14": min(round(values["half_track"] * 2**14), INT16),
    }


def _monitor(profile: str, values: Values, limits: Values) -> dict[str, Any]:
    """Returns a `monitor_config_t`, with per_sd_q15 = 0 (off) in `paper`, and where 16 bits do not hold the voltages.

    A CUSUM of log likelihood ratios h has at least exp(h) blocks between false alarms (Lorden 1971, Annals of
    Mathematical Statistics 42(6)); each of 9 signatures has two.
    """
    battery, per_torque = values["battery_voltage"], values["resistance"] / values["torque_constant"]
    radius, half_track = values["wheel_radius"], values["half_track"]
    unit = 64e-6  # V s
    if profile != "coupled" or 1.1 * battery * 1.05 * MONITOR_BLOCK_S / unit > INT16:
        return {"per_sd_q15": 0}
    emf = values["emf_constant"] + per_torque * loss(values)
    per_sd = unit / (limits["innovation_sd"] * battery * MONITOR_BLOCK_S) * 64
    battery_per_sd = unit / (limits["battery_sd"] * battery * MONITOR_BLOCK_S) * 64
    numbers = {
        "per_sd_q15": per_sd * 2**15,
        "share_q15": MONITOR_SHARE * per_sd * 2**15,
        "friction_q6": limits["friction"] / limits["innovation_sd"] * 64,
        "friction_mv": limits["friction"] * battery * 1e3,
        "slowest": limits["slowest"] * battery * MONITOR_BLOCK_S / unit,
        "mv_per_mm_s_q10": emf / radius * 2**10,
        "surge_q10": per_torque * mean_inertia(values) / radius / 16e3 / unit * 2**10,
        "yaw_q10": per_torque * difference_inertia(values) * half_track / radius / 1e3 / unit * 2**10,
        "half_track_m_q14": half_track * 2**14,
        "battery_per_sd_q15": battery_per_sd * 2**15,
        "load_q15": MONITOR_SHARE * battery_per_sd * 2**30 * unit / (battery * MONITOR_BLOCK_S),
        "threshold_q5": math.log(18 * limits["false_alarm_time"] / MONITOR_BLOCK_S) * 2**5,
    }
    return {name: min(round(number), INT16) for name, number in numbers.items()}


def _speed(common: Values, own: Values, radius: float, counts: float, step: float) -> dict[str, Any]:
    """Returns a `speed_config_t`. The observer's gains, 2 b and b^2, give it a double pole at its bandwidth b."""
    bandwidth = own["observer_bandwidth"]
    return {
        "accel_gain_q15": _q15(own["accel_share"], "accel_share"),
        "slowest_weight_bits": integer(round(math.log2(common["accel_bias_time"] / step)), 0, 12, "accel_bias_time"),
        "count_travel_um_q2": integer(2 * math.pi * radius / counts * 4e6, 1, UINT16, "counts_per_turn"),
        "travel_gain_q15": _q15(2 * bandwidth * step, "observer_bandwidth"),
        "speed_gain_q15": _q15(bandwidth**2 * step * SPEED_Q17_PER_TRAVEL_Q5, "observer_bandwidth"),
        "accel_filter_q15": _q15(1 - math.exp(-step / common["accel_filter_time"]), "accel_filter_time"),
    }


def _check_unit(setting: Setting, profile: str, entries: Mapping[str, Any]) -> None:
    """Refuses a value of the vehicle file whose unit differs from the unit of the setting's format."""
    unit = entries.get(setting.name, {}).get("unit", setting.format.unit)
    if unit != setting.format.unit:
        raise QuantisationError(
            f"sim_host/models/rcx.toml: [controller.{profile}] {setting.name}: the unit {unit!r} should be "
            f"{setting.format.unit!r}, that of the setting's format"
        )


def _put(tree: dict[str, Any], path: Sequence[str], value: int | bool) -> None:
    """Puts a value into nested initialisers: `path` names the fields from outside in."""
    for name in path[:-1]:
        tree = tree.setdefault(name, {})
    tree[path[-1]] = value


def _loop(
    profile: str, vehicle: Mapping[str, Any], step: float, settings: Mapping[str, Setting], known: Mapping[str, int]
) -> dict[str, Any]:
    values, own = plain(vehicle["parameters"]), constants(vehicle, profile)
    common = plain(vehicle["estimator"])
    estimator, counts = plain(vehicle["estimator"][profile]), plain(vehicle["sensors"]["encoder"])["counts_per_turn"]
    effective_radius = values["wheel_radius"] * (1 + known.get(TRAVEL_SCALE, 0) / 2**15)
    config: dict[str, Any] = {
        "step": {
            "model": f"&MODEL_{profile.upper()}",
            "heading": _heading(common, plain(vehicle["sensors"]["imu"])["gyro_range"]),
            "speed": {
                **_speed(common, estimator, effective_radius, counts, step),
                "friction": _friction(profile, values),
            },
            "mixer": {
                "battery_floor_mv": integer(own["battery_floor"] * 1e3, 1000, MILLIVOLTS, "battery_floor"),
                "battery_nominal_mv": integer(values["battery_voltage"] * 1e3, 1000, MILLIVOLTS, "battery_voltage"),
            },
        },
        "watchdog_ms": integer(own["watchdog_time"] * 1e3, 3, LONGEST_STEP_MS, "watchdog_time"),
    }
    if own["creep"] > own["cruise"] or own["align"] > own["pivot"]:
        raise QuantisationError("creep may not pass cruise, nor align pivot")
    for setting in settings.values():
        _check_unit(setting, profile, vehicle["controller"][profile])
        raw = known.get(setting.compensation, 0) if setting.compensation else default(setting, own, profile)
        if not setting.compensation or (raw and setting.compensation != TRAVEL_SCALE):
            path = setting.field.removeprefix("config.").split(".")
            _put(config, path, bool(raw) if setting.is_switch else raw)
    return config


def _constants(
    profile: str,
    vehicle: Mapping[str, Any],
    step: float,
    settings: Mapping[str, Setting],
    known: Mapping[str, int],
    in_model: Values,
) -> dict[str, str]:
    """Returns the constants of a profile at a step of `step` s; `in_model`: parameters for the model's coefficients."""
    values = plain(vehicle["parameters"])
    of_hosts = plain(vehicle["rates"])["body_step"]  # only hosts compute the model's pose
    config = initialiser(_loop(profile, vehicle, step, settings, known), 0)
    model = f".model = &MODEL_{profile.upper()},"
    monitor = f"\n#ifndef MONITOR_OFF\n        .monitor = &MONITOR_{profile.upper()},\n#endif"
    return {
        "step_ms": f"{step * 1e3:g}",
        "model": initialiser(body(profile, in_model, step, with_pose=step == of_hosts), 0),
        "config": config.replace(model, model + monitor),
        "monitor": initialiser(_monitor(profile, values, plain(vehicle["monitor"])), 0),
    }


def render(vehicle: Mapping[str, Any], settings: Mapping[str, Setting]) -> str:
    """Returns the header's text for the packaged robot: both profiles, at the steps of the hosts and of the RCX.

    Args:
        vehicle: a vehicle file's tables.
        settings: the table of settings.

    Raises:
        QuantisationError: a value that the firmware's format cannot hold.
    """
    rates, values = plain(vehicle["rates"]), plain(vehicle["parameters"])
    steps = {"coupled": (rates["body_step"], rates["rcx_step"]), "paper": (rates["body_step"],)}
    profiles = {
        profile: [_constants(profile, vehicle, step, settings, {}, values) for step in steps[profile]]
        for profile in PROFILES
    }
    return render_text("firmware", "params_gen.h", profiles=profiles)


def voltage_bits(values: Values) -> int:
    """Returns MOTOR_VOLTAGE_BITS of firmware/model/limits.h: 1 if the battery's voltage exceeds its range, else 0."""
    return int(values["battery_voltage"] > VOLTAGE_LIMIT)


def with_room(values: Values, step: float) -> Values:
    """Returns the parameters of a vehicle that moves in the same way, and whose states fit the model's formats.

    The inputs of the model are voltages, and its outputs are speed and yaw rate of the body. The other states of the
    model may be scaled:

    - With wheels of n times the radius, and motors geared to them, a wheel turns at an n-th of the speed.
    - A motor of n times the resistance, inductance and torque per current has an n-th of the current (eq. 12).
    - With a half of the resistance, inductance and back EMF, half the voltage has the same effect.

    Unchanged wheels and currents are tried first.

    Raises:
        QuantisationError: no such vehicle fits.
    """
    bits = voltage_bits(values)
    volts = dict.fromkeys(PER_VOLTAGE, 0.5**bits)
    failed: QuantisationError | None = None
    for wheel in _wheels(values["wheel_radius"]):
        turns = {name: wheel**power for name, power in PER_TURN.items()}
        for current in CURRENT_SHARES:
            scaled = dict(values)
            for factors in (volts, turns, dict.fromkeys(PER_CURRENT, current)):
                scaled |= {name: scaled[name] * factor for name, factor in factors.items()}
            top = scaled["battery_voltage"] / 2**bits * wheel_speed_per_volt(scaled)
            try:
                if top > WHEEL_SPEED_LIMIT:
                    limit = f"{WHEEL_SPEED_LIMIT:g} is the most"
                    raise QuantisationError(f"a wheel turns at {top:.3g} rad/s at full voltage, and {limit}")
                PROFILES["coupled"](scaled, step)
            except QuantisationError as error:
                failed = error
                continue
            return scaled
    raise failed or QuantisationError("a wheel has no radius")


def _wheels(radius: float) -> list[float]:
    """Returns the powers of two that, as factors, bring the radius within its limits; 1 comes first if it does so."""
    middle = round(math.log2(math.sqrt(SMALLEST_WHEEL * LARGEST_WHEEL) / radius))
    factors = dict.fromkeys(2.0**power for power in (0, middle, middle + 1, middle - 1))
    return [factor for factor in factors if SMALLEST_WHEEL < radius * factor < LARGEST_WHEEL]


READING_MOST = 32.767  # m/s^2 or rad/s: the largest reading; hal.h has readings in mm/s^2 or mrad/s, with 16 bits
ROUNDING = 0.005  # largest relative rounding error of the travel per count
COUNT_UM_Q2 = 4e6  # units per m in the format of the travel per count
FLOOR = 1.0  # V: the least battery voltage that the mixer assumes
FLOOR_AT = ("controller", "coupled", "battery_floor")
_STEP, _FURTHEST = 2.0, 20  # factor by which a value is changed, and the number of such changes
_BISECTIONS = 12


def own_header(robot: Robot, step: float) -> str:
    """Returns the constants of a robot at a control step of `step` s, as C, for the profile coupled.

    Raises:
        InputError: a format cannot hold a value; the message names file, line, value and range.
    """
    _check_limits(robot)
    try:
        return _made(robot, step)
    except QuantisationError as error:
        _refuse(robot, step, str(error))


def _made(robot: Robot, step: float) -> str:
    if not robot.value("parameters", "torque_constant") > 0:
        raise QuantisationError("the motors have no torque")
    in_model = with_room(plain(robot.vehicle["parameters"]), step)
    constants = _constants("coupled", robot.vehicle, step, settings(), robot.known, in_model)
    return render_text("firmware", "params_gen.h", profiles={"coupled": [constants]})


def _check_limits(robot: Robot) -> None:
    """Refuses a value outside its own range."""

    def check(place: Place, low: float, high: float, unit: str, because: str, value: float | None = None) -> None:
        value = robot.value(*place) if value is None else value
        if not low <= value <= high:
            _out_of_range(robot, place, value, (low, high), unit, because)

    battery = ("parameters", "battery_voltage")
    least = FLOOR if FLOOR_AT in robot.stated else FLOOR * robot.value(*battery) / robot.value(*FLOOR_AT)
    battery_reason = f"charged it has a tenth more, voltages end at {HIGHEST_OWN:g} V, and battery_floor follows it"
    check(battery, least, BATTERY_MOST, "V", battery_reason)
    for name, unit in (("gyro_range", "rad/s"), ("accel_range", "m/s^2")):
        check(("sensors", "imu", name), 0.1, READING_MOST, unit, "a reading has 16 bits")
    turn = 2 * math.pi * robot.value("parameters", "wheel_radius") * COUNT_UM_Q2
    count_reason = f"a count is up to 16.4 mm, and rounded by {ROUNDING:.1%} of it at most"
    check(("sensors", "encoder", "counts_per_turn"), turn / UINT16, turn * 2 * ROUNDING, "", count_reason)
    own = constants(robot.vehicle, "coupled")
    for setting in settings().values():
        place = ("controller", "coupled", setting.name)
        if place in robot.stated:
            low, high = setting.value(setting.low), setting.value(setting.high)
            check(place, low, high, setting.format.unit, "its format ends there", own[setting.name])


def _out_of_range(
    robot: Robot, place: Place, value: float, range_: tuple[float, float], unit: str, because: str
) -> NoReturn:
    low, high = range_
    shown = "" if unit == "1" else unit
    robot.toml.refuse(place, f"{value:.4g} is outside {low:.3g}..{high:.3g} {shown}".rstrip() + f": {because}")


def _refuse(robot: Robot, step: float, reason: str) -> NoReturn:
    """Raises an InputError that names the value that has to change least before the constants can be made."""
    nearest = min(_ways_out(robot, step), key=lambda way: way[0], default=None)
    if nearest is None:
        raise InputError(f"this robot does not fit into the firmware's formats: {reason}", file=robot.toml.path)
    _, place, good = nearest
    value, unit = robot.value(*place), str(entry(robot.vehicle, place)["unit"])

    def fits(candidate: float) -> bool:
        return _fits(robot, step, place, candidate)

    low, high = sorted((_edge(fits, good, value), _far_edge(fits, good, good / value)))
    _out_of_range(robot, place, value, (low, high), unit, reason)


def _ways_out(robot: Robot, step: float) -> Iterator[tuple[int, Place, float]]:
    """Doubles or halves each stated value alone; yields (number of times, place, nearest value that has constants)."""
    used = {("parameters", name) for name in robot.vehicle["parameters"]}
    stated = [place for place in sorted(robot.stated) if place[0] in ("sensors", "robot") or place in used]
    for place in (place for place in stated if robot.value(*place) > 0):
        value = robot.value(*place)
        tries = ((n, v) for n in range(1, _FURTHEST) for v in (value * _STEP**n, value / _STEP**n))
        nearest = next(((n, v) for n, v in tries if _fits(robot, step, place, v)), None)
        if nearest is not None:
            yield nearest[0], place, nearest[1]


def _fits(robot: Robot, step: float, place: Place, value: float) -> bool:
    infos = [info for info in catalogue.parameters() if place == ("parameters", info.name)]
    if not all(info.minimum <= value <= info.maximum for info in infos):
        return False
    try:
        _made(changed(robot, {place: value}), step)
    except (QuantisationError, InputError, ArithmeticError, ValueError):
        return False
    return True


def _edge(fits: Callable[[float], bool], good: float, bad: float) -> float:
    """Returns the last value that fits, between `good`, which fits, and `bad`, which does not fit."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if fits(middle) else (good, middle)
    return good


def _far_edge(fits: Callable[[float], bool], good: float, away: float) -> float:
    """Returns the last value that fits, above `good` if `away` is above 1, otherwise below `good`."""
    factor = _STEP if away > 1 else 1 / _STEP
    for _ in range(4 * _FURTHEST):
        if not fits(good * factor):
            return _edge(fits, good, good * factor)
        good *= factor
    return good
