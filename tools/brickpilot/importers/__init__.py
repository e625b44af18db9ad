"""Logs of other tools turned into data sets. Each importer writes a new folder whole, or nothing.

To add an importer, write one file in this folder and one row in `IMPORTERS`. `brickpilot import` makes its choices, its
help and its checks of options from these rows.
"""

from __future__ import annotations

from brickpilot.importers.registry import Importer, Option

MAP = Option(
    "mapping",
    "--map",
    "The place of a signal: a MATLAB variable, NAME[INDEX] for a column of a matrix, a column's name, or a column's "
    "number from 0. The unit is SI unless UNIT is given; repeatable.",
    metavar="SIGNAL=NAME[:UNIT]",
    repeatable=True,
)
VEHICLE = Option("vehicle", "--vehicle", "The kind of vehicle.", choices=("diff_drive", "motor"), required=True)
FRAME = Option("frame", "--frame", "The frame of sway and yaw.", choices=("FRD", "FLU"), default="FRD")
DELIMITER = Option("delimiter", "--delimiter", "The character between two columns.", metavar="TEXT", default=",")
HEADER = Option("header", "--header", "The first line names the columns.", default=False)

IMPORTERS = (
    Importer(
        kind="wpilib",
        function="brickpilot.importers.wpilib:import_wpilib",
        help="JSON files of WPILib SysId and of the older frc-characterization.",
        example="wpilib linear.json angular.json --out drivetrain",
    ),
    Importer(
        kind="matlab",
        function="brickpilot.importers.matlab:import_matlab",
        help="MATLAB .mat files, v4 to v7.3.",
        example="matlab DATA.mat --vehicle motor --map time=t --map voltage=vir --map position=qm --out axis",
        options=(MAP, VEHICLE, FRAME),
    ),
    Importer(
        kind="table",
        function="brickpilot.importers.table:import_table",
        help="Plain tables of numbers.",
        example="table log.txt --vehicle motor --map time=0:ms --map duty=1 --map speed=2:rpm --out bench",
        options=(MAP, VEHICLE, FRAME, DELIMITER, HEADER),
    ),
    Importer(
        kind="rcx",
        function="brickpilot.importers.rcx:import_rcx",
        help="The recording that an RCX holds, through the tower at a serial port.",
        example="rcx /dev/ttyUSB0 --out bench",
        reports_progress=True,
    ),
)
