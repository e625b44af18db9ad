"""A good data set, and a table of ways to spoil it. Each row also says what place the error message must name.

Each row makes one fault. `marker` is a text or a line number. The faulty line is the last line of the spoilt file that
contains the text, or the line with this number.
"""

# ruff: noqa: E501 - one row of the table a line

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

GOOD_TOML = """\
name     = "bench-7"
vehicle  = "diff_drive"
frame    = "FLU"
csv      = { delimiter = ",", header = true }

[signals]
time           = { column = "t_s", unit = "s" }
voltage_left   = { column = "v_left_V", unit = "V" }
voltage_right  = { column = "v_right_V", unit = "V" }
accel_surge    = { column = "a_surge_mps2", unit = "m/s^2", noise_sd = 0.025, resolution = 0.0383, range = [-19.62, 19.62] }
yaw_rate       = { column = "yaw_rate_radps", unit = "rad/s", noise_sd = 0.014 }

[nominal]
mass = 0.6
wheel_radius = { value = 0.028, sd = 0.0003 }

[nominal.effects]
gyro_bias = { bias = { value = 0.0, sd = 0.02 } }

[[runs]]
name = "straight"
file = "straight.csv"
role = "fit"

[[runs]]
name = "spin"
file = "spin.csv"
"""

GOOD_CSV = """\
t_s,v_left_V,v_right_V,a_surge_mps2,yaw_rate_radps
0.000,4.5,4.5,0.01,0.001
0.003,4.5,4.5,0.31,0.002
0.006,,4.5,0.42,0.003
0.009,4.5,4.5,0.51,
"""


def write_good(folder: Path) -> Path:
    """Writes the good data set into `folder` and returns `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(GOOD_TOML, encoding="utf-8")
    (folder / "straight.csv").write_text(GOOD_CSV, encoding="utf-8")
    (folder / "spin.csv").write_text(GOOD_CSV, encoding="utf-8")
    return folder


@dataclass(frozen=True)
class Bad:
    """A way to spoil the good data set, and the error message that must follow.

    Attributes:
        spoil: changes the data set in a folder.
        file: the file that the message names.
        marker: text in the line that the message names, or its number; None: the message names no line.
        field: the field that the message names; None: the message names no field.
        says: text that the message contains.
    """

    name: str
    spoil: Callable[[Path], None]
    file: str
    marker: str | int | None
    field: str | None
    says: str

    def write(self, folder: Path) -> Path:
        """Writes the spoilt data set into `folder` and returns `folder`."""
        self.spoil(write_good(folder))
        return folder

    def place(self, folder: Path) -> str:
        """Returns the text with which the message must begin: file, line and field."""
        path = folder / self.file
        line = self.marker
        if isinstance(line, str):
            text = path.read_text(encoding="utf-8")
            hits = [number for number, content in enumerate(text.splitlines(), 1) if line in content]
            assert hits, f"{self.name}: no line has {line!r}"
            line = hits[-1]
        place = f"{path}:" if line is None else f"{path}:{line}:"
        return place if self.field is None else f"{place} {self.field}:"


def _edit(file: str, old: str, new: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        text = (folder / file).read_text(encoding="utf-8")
        assert old in text, f"{old!r} is not in {file}"
        (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")

    return spoil


def _toml(name: str, old: str, new: str, marker: str | int | None, field: str | None, says: str) -> Bad:
    return Bad(name, _edit("dataset.toml", old, new), "dataset.toml", marker, field, says)


def _csv(name: str, old: str, new: str, marker: str | int | None, field: str | None, says: str) -> Bad:
    return Bad(name, _edit("straight.csv", old, new), "straight.csv", marker, field, says)


def _bytes(file: str, content: bytes) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        (folder / file).write_bytes(content)

    return spoil


def _outside_link(folder: Path) -> None:
    outside = folder.parent / f"{folder.name}-outside.csv"
    outside.write_text(GOOD_CSV, encoding="utf-8")
    (folder / "straight.csv").unlink()
    (folder / "straight.csv").symlink_to(outside)


def _blank_outputs(folder: Path) -> None:
    header, *rows = GOOD_CSV.splitlines()
    blank = "\n".join([header, *(",".join([*row.split(",")[:3], "", ""]) for row in rows)])
    for file in ("straight.csv", "spin.csv"):
        (folder / file).write_text(blank, encoding="utf-8")


def _no_header(folder: Path) -> None:
    _edit("dataset.toml", "header = true", "header = false")(folder)
    text = (folder / "dataset.toml").read_text(encoding="utf-8")
    for number, column in enumerate(GOOD_CSV.splitlines()[0].split(",")):
        text = text.replace(f'"{column}"', str(number + (column == "yaw_rate_radps")))
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    for file in ("straight.csv", "spin.csv"):
        (folder / file).write_text(GOOD_CSV.split("\n", 1)[1], encoding="utf-8")


def _duty(left: str, right: str, text: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        _edit("dataset.toml", "voltage_left ", left + " ")(folder)
        _edit("dataset.toml", "voltage_right ", right + " ")(folder)
        _edit("dataset.toml", 'column = "v_left_V", unit = "V"', text)(folder)
        _edit("dataset.toml", '"v_right_V", unit = "V"', '"v_right_V", unit = "1"')(folder)

    return spoil


def make_motor(folder: Path) -> None:
    """Replaces dataset.toml by that of a motor with a current controller, which states its force per volt."""
    (folder / "dataset.toml").write_text(
        'name = "m"\nvehicle = "motor"\n[signals]\ntime = { column = "t_s", unit = "s" }\n'
        'voltage = { column = "v_left_V", unit = "V" }\nposition = { column = "a_surge_mps2", unit = "mm" }\n'
        '[nominal]\nforce_per_volt = 35.15\n[[runs]]\nname = "straight"\nfile = "straight.csv"\n',
        encoding="utf-8",
    )


def _motor_edit(old: str, new: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        make_motor(folder)
        _edit("dataset.toml", old, new)(folder)

    return spoil


_LINE = GOOD_TOML[: GOOD_TOML.index("[signals]")].count("\n") + 1  # line number of [signals] in the good data set
_SIGNALS = GOOD_TOML[GOOD_TOML.index("[signals]") : GOOD_TOML.index("[nominal]")]

BAD: list[Bad] = [
    # faults of the files in the folder
    Bad("no dataset.toml", lambda folder: (folder / "dataset.toml").unlink(), "dataset.toml", None, None, "no such data set"),
    Bad("toml not utf-8", _bytes("dataset.toml", b'name = "a"\n# \xff\xfe\n'), "dataset.toml", 2, None, "not UTF-8"),
    Bad("toml too large", _bytes("dataset.toml", b"#" * (2**20 + 1)), "dataset.toml", None, None, "larger than"),
    Bad("toml nested too deep", _bytes("dataset.toml", b"a = " + b"[" * 9000), "dataset.toml", None, None, "not TOML"),
    _toml("toml syntax", 'vehicle  = "diff_drive"', "vehicle  = diff_drive", "vehicle", None, "not TOML"),
    _toml("key twice", "mass = 0.6", "mass = 0.6\nmass = 0.7", "mass = 0.7", None, "not TOML"),
    # faults of the keys above the first table
    _toml("no name", 'name     = "bench-7"', "", None, "name", "missing"),
    _toml("name no text", '"bench-7"', "7", "name     =", "name", "text"),
    _toml("name empty", '"bench-7"', '" "', "name     =", "name", "text"),
    _toml("name a path", '"bench-7"', '"bench/7"', "name     =", "name", "file's name"),
    _toml("name the folder above", '"bench-7"', '".."', "name     =", "name", "file's name"),
    _toml("name a windows path", '"bench-7"', "'c:\\bench'", "name     =", "name", "file's name"),
    _toml("unknown key", "[signals]", 'author = "me"\n[signals]', "author", "author", "unknown key"),
    _toml("unknown vehicle", '"diff_drive"', '"tricycle"', "tricycle", "vehicle", "not one of"),
    _toml("unknown frame", '"FLU"', '"NED"', "NED", "frame", "not one of FLU, FRD"),
    _toml("csv key", "header = true }", 'header = true, quote = "x" }', "quote", "csv.quote", "unknown key"),
    _toml("delimiter", 'delimiter = ","', 'delimiter = ",,"', ",,", "csv.delimiter", "is not one of comma"),
    _toml("header no flag", "header = true", "header = 1", "header = 1", "csv.header", "neither"),
    _toml("gap negative", "[signals]", "gap_s = -1\n[signals]", "gap_s", "gap_s", "outside"),
    _toml("gap no number", "[signals]", 'gap_s = "1"\n[signals]', "gap_s", "gap_s", "not a number"),
    _toml("line separator in a comment", "[signals]", "# two\u2028lines\ngap_s = -1\n[signals]", _LINE + 1, "gap_s", "outside"),
    # signals
    _toml("unknown signal", "yaw_rate  ", "yaw_rat", "yaw_rat  ", "signals.yaw_rat", "unknown signal"),
    _toml("signal of a motor", "yaw_rate  ", "speed", "speed  ", "signals.speed", "vehicle diff_drive"),
    _toml("no time", 'time           = { column = "t_s", unit = "s" }', "", "[signals]", "signals", "time is missing"),
    _toml("signal no table", '{ column = "yaw_rate_radps", unit = "rad/s", noise_sd = 0.014 }', '"y"', '"y"', "signals.yaw_rate", "not a table"),
    _toml("signal key", "noise_sd = 0.014", "noise = 0.014", "noise =", "signals.yaw_rate.noise", "unknown key"),
    _toml("no unit", ', unit = "rad/s"', "", "yaw_rate  ", "signals.yaw_rate.unit", "is missing"),
    _toml("no column", 'column = "t_s", ', "", "time  ", "signals.time.column", "is missing"),
    _toml("unknown unit", '"rad/s"', '"furlong"', "furlong", "signals.yaw_rate.unit", "unknown unit"),
    _toml("unit of another kind", '"rad/s"', '"m/s"', '"m/s"', "signals.yaw_rate.unit", "another kind"),
    _toml("gram for gravity", '"m/s^2"', '"g"', '"g"', "signals.accel_surge.unit", "g0"),
    _toml("hertz for a turn rate", '"rad/s"', '"Hz"', "Hz", "signals.yaw_rate.unit", "rotation/s"),
    _toml("unit a computation", '"rad/s"', '"9**9**9"', "9**9", "signals.yaw_rate.unit", "not a unit"),
    _toml("unit no text", '"rad/s"', "1", "unit = 1", "signals.yaw_rate.unit", "text"),
    _toml("scale zero", "noise_sd = 0.014", "scale = 0", "scale", "signals.yaw_rate.scale", "cannot scale"),
    _toml("scale infinite", "noise_sd = 0.014", "scale = inf", "scale", "signals.yaw_rate.scale", "outside"),
    _toml("offset no number", "noise_sd = 0.014", "offset = true", "offset", "signals.yaw_rate.offset", "not a number"),
    _toml("time backward", 'unit = "s"', 'unit = "s", scale = -1', "scale", "signals.time.scale", "cannot scale"),
    _toml("noise negative", "noise_sd = 0.014", "noise_sd = -1", "-1", "signals.yaw_rate.noise_sd", "above zero"),
    _toml("noise below any", "noise_sd = 0.014", "noise_sd = 1e-300", "1e-300", "signals.yaw_rate.noise_sd", "outside what is physical"),
    _toml("noise above any", "noise_sd = 0.014", "noise_sd = 1e11", "1e11", "signals.yaw_rate.noise_sd", "outside what is physical"),
    _toml("resolution below any", "resolution = 0.0383", "resolution = 1e-200", "1e-200", "signals.accel_surge.resolution", "outside what is physical"),
    _toml("resolution zero", "resolution = 0.0383", "resolution = 0", "accel_surge", "signals.accel_surge.resolution", "above zero"),
    _toml("range reversed", "[-19.62, 19.62]", "[2, 1]", "accel_surge", "signals.accel_surge.range", "below"),
    _toml("range of one", "[-19.62, 19.62]", "[2]", "accel_surge", "signals.accel_surge.range", "lowest, highest"),
    _toml("column no text", '"yaw_rate_radps"', "4", "yaw_rate  ", "signals.yaw_rate.column", "name of a column"),
    _toml("column twice", '"yaw_rate_radps"', '"a_surge_mps2"', "yaw_rate  ", "signals.yaw_rate.column", "accel_surge already"),
    _toml("input without its pair", 'voltage_right  = { column = "v_right_V", unit = "V" }', "", "voltage_left", "signals.voltage_left", "needs voltage_right"),
    _toml("inputs in conflict", "[nominal]", 'duty_left = { column = "d", unit = "1" }\n[nominal]', "duty_left", "signals.duty_left", "conflicts"),
    _toml("no output", GOOD_TOML[GOOD_TOML.index("accel_surge") : GOOD_TOML.index("\n[nominal]\n")], "", "[signals]", "signals", "no output"),
    Bad("no input", _edit("dataset.toml", GOOD_TOML[GOOD_TOML.index("voltage_left") : GOOD_TOML.index("accel_surge")], ""), "dataset.toml", "[signals]", "signals", "no input"),
    Bad("duty in percent", _duty("duty_left", "duty_right", 'column = "v_left_V", unit = "1"'), "straight.csv", None, "duty_left", "percent"),
    Bad("column beyond the file", _no_header, "straight.csv", 1, "yaw_rate", "no column 5"),
    Bad("column a name without header", _edit("dataset.toml", "header = true", "header = false"), "dataset.toml", "time  ", "signals.time.column", "column number"),
    # nominal
    _toml("unknown parameter", "mass =", "weight =", "weight", "nominal.weight", "unknown nominal"),
    _toml("mass negative", "mass = 0.6", "mass = -0.6", "mass", "nominal.mass", "outside"),
    _toml("mass not a number", "mass = 0.6", "mass = nan", "mass", "nominal.mass", "outside"),
    _toml("mass a text", "mass = 0.6", 'mass = "0.6"', "mass", "nominal.mass", "not a number"),
    _toml("mass an endless integer", "mass = 0.6", "mass = 0x" + "F" * 5000, "mass", "nominal.mass", "64 bits"),
    _toml("sd zero", "sd = 0.0003", "sd = 0.0", "wheel_radius", "nominal.wheel_radius.sd", "above zero"),
    _toml("sd below any", "sd = 0.0003", "sd = 1e-300", "wheel_radius", "nominal.wheel_radius.sd", "not a plausible"),
    _toml("sd above any", "sd = 0.0003", "sd = 1e11", "wheel_radius", "nominal.wheel_radius.sd", "not a plausible"),
    _toml("effect sd below any", "sd = 0.02 }", "sd = 1e-300 }", "gyro_bias", "nominal.effects.gyro_bias.bias.sd", "not a plausible"),
    _toml("sd without value", "value = 0.028, ", "", "wheel_radius", "nominal.wheel_radius", "value is missing"),
    _toml("nominal key", "sd = 0.0003", "tol = 0.0003", "wheel_radius", "nominal.wheel_radius.tol", "unknown key"),
    _toml("force_per_volt on wheels", "mass = 0.6", "force_per_volt = 3", "force_per_volt", "nominal.force_per_volt", "motor"),
    _toml("unknown effect", "gyro_bias =", "gremlins =", "gremlins", "nominal.effects.gremlins", "unknown effect"),
    _toml("effect no table", "gyro_bias = { bias = { value = 0.0, sd = 0.02 } }", "gyro_bias = 1", "gyro_bias", "nominal.effects.gyro_bias", "table"),
    _toml("effect parameter", "gyro_bias = { bias", "coulomb_friction = { bias", "coulomb", "nominal.effects.coulomb_friction.bias", "unknown parameter"),
    _toml("nominal no table", GOOD_TOML[GOOD_TOML.index("[signals]") : GOOD_TOML.index("[[runs]]")], "nominal = 3\n" + _SIGNALS, "nominal", "nominal", "not a table"),
    Bad("force and torque", _motor_edit("force_per_volt = 35.15", "force_per_volt = 1\ntorque_per_volt = 1"), "dataset.toml", "torque_per_volt", "nominal.torque_per_volt", "conflicts"),
    Bad("force of nothing", _motor_edit("force_per_volt = 35.15", "force_per_volt = 0"), "dataset.toml", "force_per_volt", "nominal.force_per_volt", "is 0"),
    Bad("torque of nothing", _motor_edit("force_per_volt = 35.15", "torque_per_volt = { value = 0.0, sd = 0.1 }"), "dataset.toml", "torque_per_volt", "nominal.torque_per_volt", "is 0"),
    Bad("side input on a motor", _motor_edit("voltage =", "voltage_left ="), "dataset.toml", "voltage_left =", "signals.voltage_left", "vehicle motor"),
    # runs
    _toml("no runs", GOOD_TOML[GOOD_TOML.index("[[runs]]") :], "", None, "runs", "missing"),
    _toml("runs a table", GOOD_TOML[GOOD_TOML.index("[[runs]]") :], "[runs]\n", "[runs]", "runs", "at least one"),
    _toml("run key", 'role = "fit"', 'weight = "fit"', "weight", "runs[0].weight", "unknown key"),
    _toml("run without file", 'name = "spin"\nfile = "spin.csv"\n', 'name = "spin"\n', 25, "runs[1].file", "is missing"),
    _toml("unknown role", 'role = "fit"', 'role = "train"', "train", "runs[0].role", "not one of fit, held_out"),
    _toml("name twice", 'name = "spin"', 'name = "straight"', 'name = "straight"', "runs[1].name", "two runs"),
    _toml("run name a path", 'name = "spin"', 'name = "a/b"', "a/b", "runs[1].name", "file's name"),
    _toml("replicate unknown", 'file = "spin.csv"', 'file = "spin.csv"\nreplicate_of = "walk"', "walk", "runs[1].replicate_of", "not another run"),
    _toml("replicate of itself", 'file = "spin.csv"', 'file = "spin.csv"\nreplicate_of = "spin"', "replicate_of", "runs[1].replicate_of", "not another run"),
    _toml("initial key", 'role = "fit"', "initial = { speed = 1 }", "initial", "runs[0].initial.speed", "unknown key"),
    _toml("file missing", '"spin.csv"', '"spun.csv"', "spun", "runs[1].file", "no such file"),
    _toml("file above", '"spin.csv"', '"../spin.csv"', "../spin", "runs[1].file", "outside"),
    _toml("file absolute", '"spin.csv"', '"/etc/passwd"', "/etc", "runs[1].file", "outside"),
    _toml("file a folder", '"spin.csv"', '"."', 'file = "."', "runs[1].file", "no such file"),
    _toml("file no text", '"spin.csv"', "3", "file = 3", "runs[1].file", "text"),
    Bad("file a link outside", _outside_link, "dataset.toml", 'file = "straight.csv"', "runs[0].file", "outside"),
    # rows
    Bad("empty file", _bytes("straight.csv", b""), "straight.csv", None, None, "is empty"),
    Bad("header alone", _bytes("straight.csv", GOOD_CSV.splitlines()[0].encode()), "straight.csv", None, None, "no rows"),
    Bad("one sample", _bytes("straight.csv", "\n".join(GOOD_CSV.splitlines()[:2]).encode()), "straight.csv", 2, None, "at least two samples"),
    Bad("csv not utf-8", _bytes("straight.csv", GOOD_CSV.encode() + b"\xff\n"), "straight.csv", 6, None, "not UTF-8"),
    Bad("csv utf-16", _bytes("straight.csv", GOOD_CSV.encode("utf-16")), "straight.csv", 1, None, "not UTF-8"),
    _csv("open quote", "0.003,", '"0.003,', 5, None, "not a table"),
    _csv("column missing", "yaw_rate_radps", "yaw_rate", 1, "yaw_rate", "no column 'yaw_rate_radps'"),
    Bad("column with a line separator", _edit("straight.csv", "yaw_rate_radps", "yaw\u2028"), "straight.csv", 1, "yaw_rate", "no column"),
    _csv("column doubled", "v_right_V", "v_left_V", 1, "v_left_V", "more than once"),
    _csv("row short", "0.31,0.002", "0.31", "0.31", None, "has 4 cells"),
    _csv("row long", "0.31,0.002", "0.31,0.002,7", "0.31", None, "has 6 cells"),
    _csv("blank line", "0.003,", "\n0.003,", 3, None, "has 0 cells"),
    _csv("a word", "0.31", "fast", "fast", "accel_surge (column a_surge_mps2)", "'fast' is not a number"),
    _csv("nan", "0.31", "nan", "nan", "accel_surge (column a_surge_mps2)", "not a number"),
    _csv("inf", "0.31", "-inf", "inf", "accel_surge (column a_surge_mps2)", "not a number"),
    _csv("too large", "0.31", "1e999", "1e999", "accel_surge (column a_surge_mps2)", "too large for a number"),
    _csv("beyond what is physical", "0.31", "1e200", "1e200", "accel_surge (column a_surge_mps2)", "beyond what is physical"),
    _csv("input beyond what is physical", "0.003,4.5", "0.003,-1e200", "1e200", "voltage_left (column v_left_V)", "beyond what is physical"),
    _csv("time beyond what is physical", "0.009,", "1e200,", "1e200", "time (column t_s)", "beyond what is physical"),
    _csv("a run of weeks", "0.009,", "2e6,", "2e6", "time", "longer than"),
    Bad("nothing measured", _blank_outputs, "dataset.toml", None, "signals", "no output is measured"),
    _csv("underscore", "0.31", "1_0", "1_0", "accel_surge (column a_surge_mps2)", "not a number"),
    _csv("decimal comma quoted", "0.31", '"0,31"', "0,31", "accel_surge (column a_surge_mps2)", "not a number"),
    _csv("time blank", "0.003,", ",", 3, "time", "blank"),
    _csv("time twice", "0.006,", "0.003,", 4, "time", "does not increase"),
    _csv("time back", "0.006,", "0.002,", "0.002,", "time", "0.002 s after 0.003 s"),
]  # fmt: skip
