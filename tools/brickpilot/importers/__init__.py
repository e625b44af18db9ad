"""Turns logs of other tools into data sets. Each importer writes a complete new folder, or nothing.

To add an importer, write one file in this folder and one row in `IMPORTERS`. `brickpilot import` takes its choices, its
help and its checks of options from these rows.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brickpilot.constants import VEHICLES
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.importers.channels import Contents
    from brickpilot.importers.writer import Imported, NewDataset


@dataclass(frozen=True)
class Option:
    """An option of `brickpilot import` that only some importers take.

    Attributes:
        keyword: the argument's name in the importers' functions.
        flag: the option on the command line, e.g. ``--map``.
        help: one or two sentences for the user. The command appends the kinds of log that take the option.
        metavar: the name of the option's value in the help; empty for a choice or a switch.
        choices: the allowed values; empty: any text.
        default: the value if the user does not give the option. False: the option is a switch.
        repeatable: whether the importers get a tuple of all values given.
        required: whether the user must give the option to every importer that takes it.
        unless: the keyword of another option; if that option is given, this one is not required.
    """

    keyword: str
    flag: str
    help: str
    metavar: str = ""
    choices: tuple[str, ...] = ()
    default: str | bool | None = None
    repeatable: bool = False
    required: bool = False
    unless: str = ""


@dataclass(frozen=True)
class Importer:
    """One kind of log.

    Attributes:
        kind: name of the kind of log on the command line.
        help: the files that the importer reads, in one sentence.
        module: the importer's file in this folder; empty: the file has the name of the kind. The file has one of these
            functions, or both: ``read(file)`` returns a `channels.Log` for ``--list``; and
            ``import_KIND(files, **options)``, with one keyword for each of `options`, returns a `writer.NewDataset`. If
            there is no ``import_KIND``, `chosen.channels_dataset` makes a data set of the log.
        suffixes: the endings of the files, e.g. ``.csv``; or, if a log is a folder, the name of a file in it, e.g.
            ``metadata.yaml``.
        example: the arguments of one call, after ``brickpilot import``.
        options: the options that the importer takes besides ``--out``, ``--nominal`` and ``--name``.
        reports_progress: whether ``import_KIND`` also takes a function `progress`, called with (done, total, text).
    """

    kind: str
    help: str
    example: str
    options: tuple[Option, ...] = ()
    suffixes: tuple[str, ...] = ()
    module: str = ""
    reports_progress: bool = False

    def _functions(self) -> Any:
        """Imports the module, which loads the readers of this kind of log."""
        return importlib.import_module(f"brickpilot.importers.{self.module or self.kind}")

    def contents(self, file: Path) -> Contents:
        """Reads a whole file, and returns a list of its contents.

        Raises:
            InputError: the file cannot be read, or the importer cannot list this kind of log.
        """
        from brickpilot.importers.channels import contents

        module = self._functions()
        if not hasattr(module, "read"):
            raise InputError(f"does not work with {self.kind}", field="--list")
        return contents(module.read(file))

    def maker(self) -> Callable[..., NewDataset]:
        """Returns the function that makes a data set; its arguments are (files, **options)."""
        from brickpilot.importers.chosen import channels_dataset

        module = self._functions()
        own: Callable[..., NewDataset] | None = getattr(module, f"import_{self.kind}", None)
        return own or partial(channels_dataset, module.read)

    def import_files(
        self, files: Sequence[Path], out: Path, *, nominal: Mapping[str, float], name: str | None, **options: Any
    ) -> Imported:
        """Makes a data set of files, and writes it.

        Args:
            files: the logs.
            out: the new folder.
            nominal: parameter -> value in SI; this value replaces the importer's value.
            name: the data set's name; None: the name of the folder.
            options: the result of `options_taken`.

        Raises:
            InputError: the message names file, line and field, or the option. Nothing is written then.
        """
        from brickpilot.importers.writer import check_out, write

        check_out(out)
        new = self.maker()(files, **options)
        return write(replace(new, name=name or "", nominal={**new.nominal, **nominal}), out, files[0])


MAP = Option(
    "mapping",
    "--map",
    "The place of a signal: a channel's or column's name or its number from 0, a MATLAB variable, "
    "NAME[INDEX] for a column of a matrix, or a formula of them with + - * / and parentheses, as "
    "duty_left=pwmL*1/255 or wheel_angle_left=encL/960:rotation. The unit is SI unless UNIT is given; repeatable.",
    metavar="SIGNAL=FORMULA[:UNIT]",
    repeatable=True,
)
VEHICLE = Option("vehicle", "--vehicle", "The kind of vehicle.", choices=VEHICLES, required=True, unless="guessed")
FRAME = Option(
    "frame", "--frame", "The frame of sway and yaw; the default is the frame that wheels and yaw show, or else FRD.",
    choices=("FRD", "FLU"),
)  # fmt: skip
DELIMITER = Option(
    "delimiter", "--delimiter", "The character between two columns; by default the importer finds it.", metavar="TEXT"
)
HEADER = Option(
    "header", "--header", "The first line names the columns, even if it looks like numbers; by default the importer "
    "looks for a header.", default=False,
)  # fmt: skip
GUESS = Option(
    "guessed", "--guess", "Guesses, from the columns' names and values, the signals that --map does not name, with "
    "reasons; also guesses --vehicle.", default=False,
)  # fmt: skip
SPLIT = Option(
    "split", "--split", "Makes runs of one log: rests splits where the vehicle rests for 0.3 s; FROM,TO takes a span "
    "of the log's clock in s and is repeatable.", metavar="rests|FROM,TO", repeatable=True,
)  # fmt: skip
INPUTS = Option(
    "inputs", "--inputs", "A table of the inputs over time, for a log that is slower than its commands; it has the "
    "columns that --map names.", metavar="FILE",
)  # fmt: skip
INPUT_TIMING = Option(
    "input_timing", "--input-timing", "What an input does between two rows. If this is unknown, `check` and `discover` "
    "find out whether it is held or linear.", choices=("held", "linear", "unknown"), default="held",
)  # fmt: skip
AS_WIRED = Option(
    "as_wired", "--as-wired", "Leaves channels that look swapped, reversed or wrongly scaled unchanged; notes name "
    "these channels.", default=False,
)  # fmt: skip
RATE = Option(
    "rate", "--rate", "Rows per second; default: the rows are the samples of the fastest output.", metavar="HZ"
)
CUT = Option("cut", "--cut", "Read a file that ends inside a record, without that record.", default=False)
CHANNELS = (MAP, VEHICLE, FRAME, AS_WIRED, RATE, SPLIT, CUT)

IMPORTERS = (
    Importer(
        kind="wpilib",
        suffixes=(".json",),
        help="JSON files of WPILib SysId and of the older frc-characterization.",
        example="wpilib linear.json angular.json --out drivetrain",
    ),
    Importer(
        kind="matlab",
        suffixes=(".mat",),
        help="MATLAB .mat files, v4 to v7.3.",
        example="matlab DATA.mat --vehicle motor --map time=t --map voltage=vir --map position=qm --out axis",
        options=(MAP, VEHICLE, FRAME, AS_WIRED),
    ),
    Importer(
        kind="table",
        suffixes=(".csv", ".tsv", ".txt", ".log", ".dat"),
        help="Tables of numbers in text files: CSV, blanks, tabs, serial logs.",
        example="table log.csv --guess --split rests --out bench",
        options=(MAP, VEHICLE, FRAME, AS_WIRED, DELIMITER, HEADER, GUESS, SPLIT, INPUTS, INPUT_TIMING),
    ),
    Importer(
        kind="wpilog",
        suffixes=(".wpilog",),
        help="Logs of robots with WPILib.",
        example="wpilog FRC.wpilog --vehicle motor --map voltage=/arm/volts --map angle=/arm/angle:rotation --out arm",
        options=CHANNELS,
    ),
    Importer(
        kind="mcap",
        suffixes=(".mcap",),
        help="MCAP files with messages of ROS 2 or JSON.",
        example="mcap drive.mcap --vehicle motor --map duty=/duty.data --map speed=/joints.velocity[0] --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="rosbag",
        suffixes=(".bag", ".db3", "metadata.yaml"),
        help="Bags of ROS 2, a folder each, and of ROS 1.",
        example="rosbag rosbag2_drive --vehicle motor --map duty=/duty.data --map speed=/wheel.data --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="ulog",
        suffixes=(".ulg", ".ulog"),
        help="Logs of PX4.",
        example="ulog log.ulg --vehicle motor --map duty=actuator_motors.control[0] "
        "--map speed=esc_status.esc[0].esc_rpm:rpm --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="dataflash",
        suffixes=(".bin",),
        help="Dataflash logs of ArduPilot.",
        example="dataflash 12.BIN --vehicle motor --map 'duty=(RCOU.C1-1500)/400' --map speed=RPM.rpm1:rpm --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="parquet",
        suffixes=(".parquet", ".pq"),
        help="Tables in Parquet files.",
        example="parquet drive.parquet --vehicle motor --map time=t --map voltage=u --map speed=w:rpm --out bench",
        options=(MAP, VEHICLE, FRAME, AS_WIRED, SPLIT),
    ),
    Importer(
        kind="flight",
        module="flight_log",
        suffixes=("summary.json",),
        help="Run folders of `brickpilot run` and `hil`: the signals that a host can log, not the true state.",
        example="flight runs/square runs/slalom --out flown",
    ),
    Importer(
        kind="rcx",
        help="The recording that an RCX holds, through the tower at a serial port.",
        example="rcx /dev/ttyUSB0 --out bench",
        reports_progress=True,
    ),
)


def kind_of(file: Path, importers: Iterable[Importer]) -> str | None:
    """Returns the kind of log, from a file's ending or from the files in a folder; None: an unknown kind."""
    for row in importers:
        if file.suffix.lower() in row.suffixes or (
            file.is_dir() and any((file / suffix).is_file() for suffix in row.suffixes)
        ):
            return row.kind
    return None


def importer_and_files(
    words: Sequence[str], kind: str | None, importers: Sequence[Importer]
) -> tuple[Importer, list[Path]]:
    """Returns the importer and the files. The user names the kind of log, or the first file's ending shows the kind.

    Raises:
        InputError: the user names no kind of log and the ending shows none, or no file is given.
    """
    rows = {row.kind: row for row in importers}
    files = [Path(word) for word in words]
    if kind is None and words[0] in rows:
        kind, files = words[0], files[1:]
    if not files:
        raise InputError("no file to import", field="FILE")
    kind = kind or kind_of(files[0], importers)
    if kind is None:
        raise InputError(f"no kind of log is known by this ending; name one: {', '.join(rows)}", file=files[0])
    return rows[kind], files


def all_options(importers: Sequence[Importer]) -> list[Option]:
    return list(dict.fromkeys(option for row in importers for option in row.options))


def kinds_with(option: Option, importers: Iterable[Importer]) -> str:
    """Returns the kinds of log that take `option`, as words: "matlab and table"."""
    *most, last = [row.kind for row in importers if option in row.options]
    return f"{', '.join(most)} and {last}" if most else last


def options_taken(importer: Importer, importers: Sequence[Importer], given: Mapping[str, Any]) -> dict[str, Any]:
    """Returns keyword -> value, for the options that `importer` takes; options that are not given have their defaults.

    A given option that the importer does not take is refused if the option is a switch or has no default. Otherwise
    the option is ignored.

    Raises:
        InputError: a given option belongs to other kinds of log, a needed option is missing, or there is no such
            option.
    """
    known = {option.keyword for option in all_options(importers)}
    for keyword in given:
        if keyword not in known:
            raise InputError(f"is no option of an importer: {', '.join(sorted(known))}", field=keyword)
    asked: dict[str, Any] = {
        option.keyword: () if option.repeatable else option.default for option in all_options(importers)
    }
    asked.update(given)
    for option in all_options(importers):
        value = asked[option.keyword]
        if option not in importer.options and option.default in (None, False) and value:
            message = f"works only with {kinds_with(option, importers)}; a log of kind {importer.kind} describes itself"
            raise InputError(message, field=option.flag)
        spared = any(other.keyword == option.unless and asked[other.keyword] for other in importer.options)
        if option in importer.options and option.required and not value and not spared:
            raise InputError(f"is needed to import {importer.kind}", field=option.flag)
    return {option.keyword: asked[option.keyword] for option in importer.options}
