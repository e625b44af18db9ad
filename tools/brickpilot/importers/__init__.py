"""Turns logs of other tools into data sets. Each importer writes a complete new folder, or nothing.

To add an importer, write one file in this folder and one row in `IMPORTERS`. `brickpilot import` makes its choices, its
help and its checks of options from these rows.
"""

from __future__ import annotations

from brickpilot.constants import VEHICLES
from brickpilot.importers.registry import Importer, Option

MAP = Option(
    "mapping",
    "--map",
    "The place of a signal: a channel's or column's name or its number from 0, a MATLAB variable, "
    "NAME[INDEX] for a column of a matrix, or a formula of them with + - * / and parentheses, as "
    "duty_left=pwmL*1/255 or wheel_angle_left=encL/960:rotation. The unit is SI unless UNIT is given; repeatable.",
    metavar="SIGNAL=FORMULA[:UNIT]",
    repeatable=True,
)
VEHICLE = Option(
    "vehicle",
    "--vehicle",
    "The kind of vehicle.",
    choices=VEHICLES,
    required=True,
    unless="guessed",
)
FRAME = Option(
    "frame", "--frame", "The frame of sway and yaw; the default is the one that wheels and yaw show, or else FRD.",
    choices=("FRD", "FLU"),
)  # fmt: skip
DELIMITER = Option(
    "delimiter", "--delimiter", "The character between two columns; by default it is found.", metavar="TEXT"
)
HEADER = Option(
    "header", "--header", "The first line names the columns, even if it looks like numbers; by default a header is "
    "found.", default=False,
)  # fmt: skip
GUESS = Option(
    "guessed", "--guess", "Guesses the columns that --map does not name from their names and values, and says why; "
    "finds --vehicle, too.", default=False,
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
    "input_timing",
    "--input-timing",
    "The inputs between two rows; for unknown, check and discover find which of the two it is.",
    choices=("held", "linear", "unknown"),
    default="held",
)
AS_WIRED = Option(
    "as_wired", "--as-wired", "Keeps channels that look swapped, reversed or scaled wrongly: notes name them.",
    default=False,
)  # fmt: skip
RATE = Option(
    "rate", "--rate", "Rows per second; default: the rows are the samples of the fastest output.", metavar="HZ"
)
CUT = Option("cut", "--cut", "Read a file that ends inside a record, without that record.", default=False)
CHANNELS = (MAP, VEHICLE, FRAME, AS_WIRED, RATE, SPLIT, CUT)

IMPORTERS = (
    Importer(
        kind="wpilib",
        function="brickpilot.importers.wpilib:import_wpilib",
        reader="brickpilot.importers.wpilib:read",
        suffixes=(".json",),
        help="JSON files of WPILib SysId and of the older frc-characterization.",
        example="wpilib linear.json angular.json --out drivetrain",
    ),
    Importer(
        kind="matlab",
        function="brickpilot.importers.matlab:import_matlab",
        reader="brickpilot.importers.matlab:read",
        suffixes=(".mat",),
        help="MATLAB .mat files, v4 to v7.3.",
        example="matlab DATA.mat --vehicle motor --map time=t --map voltage=vir --map position=qm --out axis",
        options=(MAP, VEHICLE, FRAME, AS_WIRED),
    ),
    Importer(
        kind="table",
        function="brickpilot.importers.table:import_table",
        reader="brickpilot.importers.text_table:read_columns",
        suffixes=(".csv", ".tsv", ".txt", ".log", ".dat"),
        help="Tables of numbers in text files: CSV, blanks, tabs, serial logs.",
        example="table log.csv --guess --split rests --out bench",
        options=(MAP, VEHICLE, FRAME, AS_WIRED, DELIMITER, HEADER, GUESS, SPLIT, INPUTS, INPUT_TIMING),
    ),
    Importer(
        kind="wpilog",
        function="brickpilot.importers.wpilog:import_wpilog",
        reader="brickpilot.importers.wpilog:read",
        suffixes=(".wpilog",),
        help="Logs of robots with WPILib.",
        example="wpilog FRC.wpilog --vehicle motor --map voltage=/arm/volts --map angle=/arm/angle:rotation --out arm",
        options=CHANNELS,
    ),
    Importer(
        kind="mcap",
        function="brickpilot.importers.mcap:import_mcap",
        reader="brickpilot.importers.mcap:read",
        suffixes=(".mcap",),
        help="MCAP files with messages of ROS 2 or JSON.",
        example="mcap drive.mcap --vehicle motor --map duty=/duty.data --map speed=/joints.velocity[0] --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="rosbag",
        function="brickpilot.importers.rosbag:import_rosbag",
        reader="brickpilot.importers.rosbag:read",
        suffixes=(".bag", ".db3", "metadata.yaml"),
        help="Bags of ROS 2, a folder each, and of ROS 1.",
        example="rosbag rosbag2_drive --vehicle motor --map duty=/duty.data --map speed=/wheel.data --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="ulog",
        function="brickpilot.importers.ulog:import_ulog",
        reader="brickpilot.importers.ulog:read",
        suffixes=(".ulg", ".ulog"),
        help="Logs of PX4.",
        example="ulog log.ulg --vehicle motor --map duty=actuator_motors.control[0] "
        "--map speed=esc_status.esc[0].esc_rpm:rpm --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="dataflash",
        function="brickpilot.importers.dataflash:import_dataflash",
        reader="brickpilot.importers.dataflash:read",
        suffixes=(".bin",),
        help="Dataflash logs of ArduPilot.",
        example="dataflash 12.BIN --vehicle motor --map 'duty=(RCOU.C1-1500)/400' --map speed=RPM.rpm1:rpm --out wheel",
        options=CHANNELS,
    ),
    Importer(
        kind="parquet",
        function="brickpilot.importers.parquet:import_parquet",
        reader="brickpilot.importers.parquet:read",
        suffixes=(".parquet", ".pq"),
        help="Tables in Parquet files.",
        example="parquet drive.parquet --vehicle motor --map time=t --map voltage=u --map speed=w:rpm --out bench",
        options=(MAP, VEHICLE, FRAME, AS_WIRED, SPLIT),
    ),
    Importer(
        kind="flight",
        function="brickpilot.importers.flight_log:import_flight",
        suffixes=("summary.json",),
        help="Run folders of `brickpilot run` and `hil`: what a host sees of a flight, without the plant's own truth.",
        example="flight runs/square runs/slalom --out flown",
    ),
    Importer(
        kind="rcx",
        function="brickpilot.importers.rcx:import_rcx",
        help="The recording that an RCX holds, through the tower at a serial port.",
        example="rcx /dev/ttyUSB0 --out bench",
        reports_progress=True,
    ),
)
