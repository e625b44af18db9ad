"""Guesses from a column's name and values which signal the column holds, and gives the reason.

The rules use the words in the name and the range of the values. A column to which no rule applies is left out, with a
note. In a log without a header, nothing is guessed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from brickpilot.data.audit.wiring import COUNTS_A_TURN
from brickpilot.data.signals import INPUT_SETS, SIGNALS, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector
from brickpilot.importers.mapping import Source
from brickpilot.importers.text_table import TextTable

_LOOKED_AT = 200_000  # number of first rows that are used, so that guessing is fast in a long log


@dataclass(frozen=True)
class Guess:
    """The guessed signals of a log's columns.

    Attributes:
        sources: signal -> its formula over columns, and the unit.
        vehicle: the vehicle, stated or guessed.
        reasons: signal -> the reason for the guess.
        notes: sentences for the user.
        guessed: assumed numbers that scale all speeds or voltages, such as "960 counts a turn"; the user did not state
            these numbers.
    """

    sources: dict[str, Source]
    vehicle: Vehicle
    reasons: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    guessed: tuple[str, ...] = ()


def guess(table: TextTable, stated: Mapping[str, Source], vehicle: Vehicle | None) -> Guess:
    """Returns the guessed signals of a table's columns.

    Args:
        table: a table with a header.
        stated: signal -> the source that ``--map`` states; these sources are kept.
        vehicle: the vehicle; None: diff_drive if the log has a left or right column or a cmd_vel, else motor.

    Raises:
        InputError: the table has no header, or no time, input or output is found.
    """
    if not table.header:
        raise InputError("needs a header that names the columns", file=table.file, field="--guess")
    columns = [column_of(name, _values(table, name)) for name in table.names if name]
    if vehicle is None:
        turns = any(column.words >= {"cmd", "vel"} for column in columns)  # cmd_vel is a set point for a vehicle
        vehicle = "diff_drive" if turns or any(column.side for column in columns) else "motor"
    sources, reasons = dict(stated), {signal: "stated by --map" for signal in stated}
    left_out: list[str] = []
    asked: list[str] = []
    driven = any(column.words & {"pwm", "duty"} for column in columns)
    for column in columns:
        taken = taken_for(column, columns, driven)
        problem = taken if isinstance(taken, str) else _problem(taken, sources, vehicle)
        if isinstance(taken, str) or problem:
            if not any(column.name in source.text for source in stated.values()):
                left_out.append(f"{column.name} is left out: {problem}")
                asked += [taken] if isinstance(taken, str) and "--map 'duty" in taken else []
            continue
        sources[taken.signal] = Source(taken.formula, taken.unit)
        reasons[taken.signal] = taken.reason
    left_out += _one_input_set(sources, reasons, vehicle)
    _check_found(table, sources, asked)
    notes = [
        f"guessed: {signal} is {source.text}, in {source.unit}: {reasons[signal]}" for signal, source in sources.items()
    ]
    bases, loud = _guessed_bases({signal: source for signal, source in sources.items() if signal not in stated})
    return Guess(sources, vehicle, reasons, (*notes, *loud, *left_out), tuple(bases))


def _guessed_bases(sources: Mapping[str, Source]) -> tuple[list[str], list[str]]:
    """Returns assumed numbers that scale all speeds or voltages, and a note in capitals on each number."""
    bases, notes = [], []
    for stems, base, meaning, quantity, form in (
        (("wheel_angle", "angle"), COUNTS_A_TURN, "how many counts a turn has", "speed", "COUNTS:rotation"),
        (("duty",), " as full drive", "which number is full drive", "voltage", "FULL"),
    ):
        scaled = [
            source.text.split("/") for name, source in sources.items() if name.startswith(stems) and "/" in source.text
        ]
        if scaled:
            columns, number = " and ".join(column for column, _ in scaled), scaled[0][1]
            bases.append(f"{number}{base}")
            notes.append(
                f"NOBODY SAID {meaning}: {number} IS A GUESS for {columns}, and an error of this number is an error of "
                f"every {quantity}; state it with --map SIGNAL=COLUMN/{form}"
            )
    return bases, notes


def _values(table: TextTable, name: str) -> Vector:
    """Returns the numbers of a column; an empty array if the column holds text."""
    try:
        return table.column(name, name)[0][:_LOOKED_AT]
    except InputError:
        return np.empty(0)


def _problem(taken: Taken, sources: Mapping[str, Source], vehicle: Vehicle) -> str | None:
    if taken.signal in sources:
        return f"{sources[taken.signal].text} is {taken.signal} already"
    if taken.signal not in SIGNALS or vehicle not in SIGNALS[taken.signal].vehicles:
        return f"a {vehicle} has no signal {taken.signal}"
    try:
        si_factor(taken.unit, SIGNALS[taken.signal].unit)
    except ValueError as error:
        return f"it looks like {taken.signal}, but {error}"
    return None


def _one_input_set(sources: dict[str, Source], reasons: dict[str, str], vehicle: Vehicle) -> list[str]:
    """Keeps one complete set of inputs in `sources`, removes others, and returns a note on each removed input."""
    sets = INPUT_SETS[vehicle]
    stated = {signal for signal in sources if SIGNALS[signal].kind == "input" and reasons[signal] == "stated by --map"}
    complete = [names for names in sets if all(name in sources for name in names)]
    complete.sort(key=lambda names: (not stated & set(names), not names[0].startswith("duty")))
    chosen = complete[0] if complete else ()
    others = [signal for signal in sources if SIGNALS[signal].kind == "input" and signal not in chosen]
    beside = f"{' and '.join(chosen)} is the input" if chosen else "the other side is not found"
    return [f"{sources.pop(signal).text} is left out: {beside}" for signal in others]


def _check_found(table: TextTable, sources: Mapping[str, Source], asked: Sequence[str]) -> None:
    """Refuses a log without time, input or output. `asked`: messages that ask the user for the motor commands."""
    known = ", ".join(table.names[:20])
    kinds = {SIGNALS[signal].kind for signal in sources}
    for kind, example in (("time", "time=COLUMN:ms"), ("input", "duty_left=COLUMN/255"), ("output", "yaw_rate=COLUMN")):
        if kind not in kinds:
            message = f"finds no {'time' if kind == 'time' else f'complete {kind}'} among {known}; add --map {example}"
            message = asked[0] if asked and kind == "input" else message
            raise InputError(message, file=table.file, line=table.first_line, field="--guess")


COUNTS_PER_TURN = 960
"""Assumed counts of an encoder per turn of the wheel, if the user does not state this number."""

_SIDES = {
    **dict.fromkeys(("l", "left", "lt", "lf", "links"), "left"),
    **dict.fromkeys(("r", "right", "rt", "rf", "rechts"), "right"),
}
_UNITS = {
    "ms": "ms", "millis": "ms", "us": "us", "micros": "us", "sec": "s", "seconds": "s", "s": "s",
    "mv": "mV", "volt": "V", "volts": "V", "ma": "mA", "amp": "A", "amps": "A",
    "rpm": "rpm", "dps": "deg/s", "degs": "deg/s", "degps": "deg/s", "rads": "rad/s",
    "radps": "rad/s", "rps": "rotation/s",
    "mps": "m/s", "mmps": "mm/s", "cmps": "cm/s", "deg": "deg", "degrees": "deg", "rad": "rad", "mm": "mm", "cm": "cm",
}  # fmt: skip
_SET_POINT = {"setpoint", "target", "ref", "reference", "desired", "demand", "goal"}
_RATES = {"deg/s", "rad/s", "rpm", "rotation/s"}
_TIME = {"t", "time", "millis", "micros", "timestamp", "clock", "uptime", "tms", "tus"}
_DUTY = {"pwm", "duty", "cmd", "command", "power", "throttle", "motor", "mot", "dutycycle"}
_ENCODER = {"enc", "encoder", "tick", "ticks", "count", "counts", "cnt", "odo", "pulses"}
_BATTERY = {"bat", "batt", "battery", "vbat", "vbatt", "supply", "vin", "vcc"}
_SPEED = {"speed", "spd", "vel", "velocity", "rpm", "omega", "w"}
_FULL_SCALES = (1.0, 100.0, 255.0, 1000.0, 1023.0, 4095.0, 32767.0)
_ODD_FULL = (300.0, 400.0)  # if the largest command lies between these limits, full drive may be 400 or 1000
_SERVO, _SERVO_REST = (800.0, 2200.0), 1500.0  # us: the range of servo pulses, and the pulse at rest
_TURN_RATE = 12.0  # rad/s: a larger yaw rate is taken to be in deg/s
_RAW_GYRO = 131.0  # counts per deg/s, of the most common gyro in its finest range
_GRAVITY = {"g0": 1.0, "m/s^2": 9.80665}


@dataclass(frozen=True)
class Taken:
    """The guessed signal of a column, and the reason for the guess."""

    signal: str
    formula: str
    unit: str
    reason: str


@dataclass(frozen=True, eq=False)
class Column:
    """A column: its name, the words in the name, its side, the unit in its name, and its values."""

    name: str
    words: frozenset[str]
    side: str
    unit: str | None
    values: Vector

    @property
    def largest(self) -> float:
        """The largest magnitude of the column's values."""
        return float(np.nanmax(np.abs(self.values), initial=0.0))

    @property
    def whole(self) -> bool:
        """Whether all values are whole numbers."""
        known = self.values[np.isfinite(self.values)]
        return bool(np.all(known == np.round(known)))

    def taken(self, signal: str, unit: str, reason: str = "") -> Taken:
        """Returns the guess that this column is `signal` in `unit`; the default reason is its name or range."""
        seen = "its name, with its unit" if unit == self.unit else f"its name; values up to {self.largest:.4g}"
        return Taken(signal, self.name, unit, reason or seen)


def column_of(name: str, values: Vector) -> Column:
    """Returns a column, from its name and values: "encL [deg]" has the words enc and l, side left and unit deg."""
    bracketed = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name)
    bare = name[: bracketed.start()] if bracketed else name
    parts = re.findall(r"[A-Z]{2,}(?![a-z])|[A-Z]?[a-z]+|[A-Z]|\d+", bare.replace("µ", "u"))
    words = [part.lower() for part in parts]
    if len(words) == 1 and (
        short := re.fullmatch(r"(left|right|[lr])?(pwm|enc|gyro|acc|vel|duty|motor)([lrxyz])?", words[0])
    ):
        words = [part for part in short.groups() if part]
    if len(words) == 1 and (short := re.fullmatch(r"(left|right)(\w+)|(\w+?)(left|right)", words[0])):
        words = [part for part in short.groups() if part]
    joined = re.search(r"(deg|rad|mm|cm|m|rev)(?:_per_|_p?|/)s(?:ec)?$", bare.lower())
    stated = {"deg": "deg/s", "rad": "rad/s", "mm": "mm/s", "cm": "cm/s", "m": "m/s", "rev": "rotation/s"}
    small = re.search(r"(?:[_ ]|(?<=[a-z]))(m[VAs]|us)$", bare)
    unit = bracketed[1].strip() if bracketed else stated[joined[1]] if joined else small[1] if small else None
    if unit is None and len(words) > 1:
        unit = "m/s^2" if re.search(r"m(?:ps|_?s)2$", bare.lower()) else _UNITS.get(words[-1])
        unit = (
            unit
            or ("m" if words[-1] == "m" else None)
            or ("V" if words[-1] == "v" else "A" if words[-1] == "a" else None)
        )
    sides = [_SIDES[word] for word in words if word in _SIDES]
    return Column(name, frozenset(words), sides[0] if sides else "", unit, values)


def taken_for(column: Column, columns: Sequence[Column], driven: bool) -> Taken | str:
    """Returns the guessed signal of a column, or the reason why the column is left out.

    Args:
        column: the column.
        columns: all columns of the log.
        driven: whether the log has a column of duty; with duty, a column named "v" is no commanded voltage.
    """
    if not np.isfinite(column.values).any():
        return "it holds no numbers"
    words = column.words
    if words & _TIME or (words <= {"ms", "us", "s"} and words):
        return _time(column)
    if words & _BATTERY:
        return _battery(column)
    if words >= {"cmd", "vel"} or (words & _SET_POINT and words & (_SPEED | {"yaw", "linear", "angular"})):
        return _set_point(column)
    if words & _DUTY and not words & _SPEED:
        return _duty(
            column, [other for other in columns if other.words & _DUTY and not other.words & _SPEED] or [column]
        )
    if words & _ENCODER:
        signal = f"wheel_angle_{column.side}" if column.side else "angle"
        reason = f"named like an encoder; {COUNTS_PER_TURN} counts per turn is a guess"
        return Taken(signal, f"{column.name}/{COUNTS_PER_TURN}", "rotation", reason)
    if words & {"gz", "gyroz", "wz", "yawrate"} or words >= {"gyro", "z"} or words >= {"yaw", "rate"}:
        return _yaw_rate(column)
    if words & {"gx", "gy", "wx", "wy"} or ("gyro" in words and words & {"x", "y"}):
        return "it is a turn rate about a horizontal axis, for which there is no signal"
    if words & {"ax", "ay", "accx", "accy"} or (words & {"acc", "accel"} and words & {"x", "y", "surge", "sway"}):
        return _acceleration(column, columns)
    if words & {"yaw", "heading"} and column.unit in _RATES:
        return _yaw_rate(column)
    if words & {"yaw", "heading"}:
        unit = column.unit or ("deg" if column.largest > 7.0 else "rad")
        return column.taken("yaw_angle", unit)
    return _wheel(column, driven)


def _set_point(column: Column) -> Taken | str:
    """Returns the guessed set point of a column: speed of a wheel or motor, or velocity or yaw rate of the body."""
    words, unit = column.words, column.unit
    if words & {"y"} or (words >= {"angular", "x"} or words >= {"linear", "z"}):
        return "no vehicle with two wheels can follow this demand"
    is_turn = bool(words & {"yaw", "angular", "z"} or (not column.side and words & {"omega", "w"}))
    is_ros = words >= {"cmd", "vel"}  # a Twist message of ROS is in SI
    signal = f"reference_wheel_speed_{column.side}" if column.side else "reference_speed"
    if is_turn:
        signal, unit = "reference_yaw_rate", unit or ("rad/s" if is_ros else None)
    elif not column.side and (unit in ("m/s", "mm/s", "cm/s") or (is_ros and unit is None)):
        signal, unit = "reference_velocity", unit or "m/s"
    if unit is None:
        return f"the unit of a demand is not stated; state it with --map {signal}={column.name}:UNIT"
    return column.taken(signal, unit, "named like a demand to a controller")


def _time(column: Column) -> Taken | str:
    steps = np.diff(column.values[np.isfinite(column.values)])
    if steps.size and np.mean(steps >= 0.0) < 0.9:
        return "named like a time, but it does not increase"
    if column.unit or "micros" in column.words or "millis" in column.words or column.words & set(_UNITS):
        word = next(
            (_UNITS[word] for word in ("micros", "us", "millis", "ms", "sec", "seconds") if word in column.words), "s"
        )
        return column.taken("time", column.unit or word, "its name")
    usual = float(np.median(steps)) if steps.size else 0.0
    unit = "s" if not column.whole or usual < 1.0 else "us" if usual >= 500.0 else "ms"
    return column.taken("time", unit, f"its name; a step is {usual:g}, so the unit is {unit}")


def _duty(column: Column, both: Sequence[Column]) -> Taken | str:
    """Returns the guessed duty of a column. `both`: all columns of duty, which share one value of full drive."""
    signal = f"duty_{column.side}" if column.side else "duty"
    largest = max(other.largest for other in both)
    if all(_is_servo(other) for other in both):
        return _asked(both, "look like servo pulses of 1000 to 2000 us with 1500 at rest", "({}-1500)/500")
    if _ODD_FULL[0] < largest <= _ODD_FULL[1]:
        return _asked(both, f"go up to {largest:g}, which is 400 of some drivers or 1000 of others", "{}/400")
    full = next((scale for scale in _FULL_SCALES if scale >= largest), largest)
    if "pwm" in column.words and all(other.whole for other in both) and full <= 255.0:
        full = 255.0
    reason = f"its name; values up to {largest:g}, so full drive is taken as {full:g}"
    return Taken(signal, column.name if full == 1.0 else f"{column.name}/{full:g}", "1", reason)


def _is_servo(column: Column) -> bool:
    """Whether each value is a servo pulse, or 0 for no pulse."""
    known = column.values[np.isfinite(column.values)]
    sent = known[known != 0.0]
    is_pulse = sent.size > 0 and _SERVO[0] <= sent.min() and sent.max() <= _SERVO[1]
    return bool(is_pulse and (sent.size == known.size or _SERVO_REST in sent))


def _asked(both: Sequence[Column], look: str, formula: str) -> str:
    """Returns a message for motor commands that cannot be guessed, with the options that state these commands."""
    maps = [f"--map 'duty{other.side and '_'}{other.side}={formula.format(other.name)}'" for other in both]
    return f"{' and '.join(other.name for other in both)} {look}: state it, as {' '.join(maps)}"


def _battery(column: Column) -> Taken | str:
    if column.unit in ("V", "mV"):
        return column.taken("battery_voltage", column.unit)
    if 60.0 < column.largest < 2000.0:
        scale = f"state it with --map battery_voltage={column.name}*SCALE"
        return f"values up to {column.largest:g} are neither V nor mV; {scale}"
    return column.taken("battery_voltage", "V" if column.largest <= 60.0 else "mV")


def _yaw_rate(column: Column) -> Taken:
    if column.unit:
        return column.taken("yaw_rate", column.unit)
    if column.whole and column.largest > 2500.0:
        reason = f"its name; raw counts up to {column.largest:g}, {_RAW_GYRO:g} per deg/s is a guess"
        return Taken("yaw_rate", f"{column.name}/{_RAW_GYRO:g}", "deg/s", reason)
    unit = "rad/s" if column.largest <= _TURN_RATE else "deg/s"
    reason = f"its name; values up to {column.largest:.4g}, so the unit is taken as {unit}"
    return column.taken("yaw_rate", unit, reason)


def _acceleration(column: Column, columns: Sequence[Column]) -> Taken | str:
    sway = bool(column.words & {"ay", "accy", "y", "sway"})
    signal = "accel_sway" if sway else "accel_surge"
    if column.unit:
        unit = "g0" if column.unit == "g" else column.unit
        return column.taken(signal, unit, "its name, with its unit; x is taken as forward")
    upright = next(
        (
            other
            for other in columns
            if other.words & {"az", "accz"} or ({"z"} <= other.words and other.words & {"acc", "accel"})
        ),
        None,
    )
    rest = abs(float(np.nanmedian(upright.values))) if upright is not None and upright.values.size else 0.0
    for unit, gravity in _GRAVITY.items():
        if abs(rest / gravity - 1.0) < 0.1:
            reason = f"its name; the upright axis shows {rest:.3g} at rest, so the unit is {unit}"
            return column.taken(signal, unit, reason)
    for counts in (16384.0, 8192.0, 4096.0, 2048.0):
        if abs(rest / counts - 1.0) < 0.1:
            reason = f"its name; the upright axis shows {rest:.0f} counts at rest"
            return Taken(signal, f"{column.name}/{counts:g}", "g0", reason)
    return f"its unit is not stated; state it with --map {signal}={column.name}:g0 or :m/s^2"


def _wheel(column: Column, driven: bool) -> Taken | str:
    """Returns the guessed signal of a column with a speed, an angle, a current or a voltage of a wheel."""
    words, unit, tail = column.words, column.unit, f"_{column.side}" if column.side else ""
    wheel = "wheel_" if column.side else ""
    if words & {"voltage", "volt", "volts", "u"} or (words & {"v"} and not driven and (column.side or words == {"v"})):
        unit = unit if unit in ("V", "mV") else "mV" if column.whole and column.largest > 60.0 else "V"
        return column.taken(f"voltage{tail}", unit)
    if words & {"current", "cur", "i"}:
        unit = unit if unit in ("A", "mA") else "mA" if column.whole and column.largest > 60.0 else "A"
        return column.taken(f"current{tail}", unit)
    if words & (_SPEED | {"v"}):
        if unit not in _RATES | {"m/s", "mm/s", "cm/s"}:
            return f"the unit of a speed is not stated; state it with --map {wheel}speed{tail}={column.name}:UNIT"
        kind = "speed" if unit in _RATES else "velocity"
        return column.taken(f"{wheel}{kind}{tail}", unit)
    if words & {"angle", "ang", "theta", "phi"}:
        unit = unit or ("deg" if column.largest > 50.0 else "rad")
        return column.taken(f"{wheel}angle{tail}", unit)
    if words & {"pos", "position", "dist", "distance", "travel"}:
        if unit not in ("m", "mm", "cm", "deg", "rad"):
            return f"the unit of a position is not stated; state it with --map SIGNAL={column.name}:UNIT"
        is_angle = unit in ("deg", "rad")
        signal = ("wheel_angle" if is_angle else "wheel_travel") + tail
        if not column.side:
            signal = "angle" if is_angle else "position"
        return column.taken(signal, unit)
    return "neither its name nor its values tell what it is"
