"""`brickpilot`: registers the commands and turns each error into one line and an exit status.

Exit status: 0 done; 1 the work failed; 2 bad usage or bad input.
"""

from __future__ import annotations

import inspect
import io
import sys

import click
from click.exceptions import NoArgsIsHelpError

from brickpilot import __version__
from brickpilot.cli.ask import ask
from brickpilot.cli.bench import bench
from brickpilot.cli.calibrate import calibrate
from brickpilot.cli.campaign import campaign
from brickpilot.cli.changed import changed
from brickpilot.cli.compare import compare
from brickpilot.cli.discover import check, discover
from brickpilot.cli.effects import effects
from brickpilot.cli.export import export
from brickpilot.cli.firmware import firmware
from brickpilot.cli.flash import flash
from brickpilot.cli.hil import brick, hil
from brickpilot.cli.import_log import import_log
from brickpilot.cli.monitor import monitor
from brickpilot.cli.run import run
from brickpilot.cli.settings_table import settings
from brickpilot.cli.tune import tune
from brickpilot.cli.upload import upload
from brickpilot.cli.why import why
from brickpilot.errors import InputError, SimulationError, WorkFailedError


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="brickpilot")
def cli() -> None:
    """Autopilot, simulator and model discovery for a differential-drive robot of the LEGO RCX class."""


def whole_lines(command: click.Command) -> click.Command:
    """Makes lists of commands show the whole first sentence of a command's help; Click alone would cut it off."""
    text = inspect.cleandoc(command.help or "").partition("\n\n")[0].replace("\n", " ")
    command.short_help = command.short_help or text.split(". ")[0].rstrip(".") + "."
    if isinstance(command, click.Group):
        for below in command.commands.values():
            whole_lines(below)
    return command


COMMANDS = (
    run, upload, monitor, hil, brick, settings, firmware, tune, flash, import_log, check, why, changed, ask, compare,
    calibrate, discover, campaign, effects, export, bench,
)  # fmt: skip
for command in COMMANDS:
    cli.add_command(whole_lines(command))


LIBRARIES_OF_HIL = ("can", "cantools", "cobs", "intelhex", "msgpack", "serial")
"""The libraries that `flash` and all links to a brick need; the package's extra `hil` installs these libraries."""


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line and ends with its exit status."""
    run_to_exit(cli, arguments, "brickpilot")


def run_to_exit(command: click.Command, arguments: list[str] | None, program: str) -> None:
    """Runs a command and ends with its exit status; an error of the user becomes one line on stderr."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a console of Windows may lack a Greek letter
    try:
        command.main(arguments, prog_name=program, standalone_mode=False)
    except InputError as error:
        click.echo(f"{program}: {error}", err=True)
        sys.exit(2)
    except NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.UsageError as error:
        path = error.ctx.command_path if error.ctx else program
        click.echo(f"{path}: {' '.join(error.format_message().split())} (see {path} --help)", err=True)
        sys.exit(2)
    except (click.Abort, KeyboardInterrupt):
        click.echo(f"{program}: interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of stdout has closed the pipe, so nobody reads further output
        sys.exit(1)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in LIBRARIES_OF_HIL:
            raise
        click.echo(f"{program}: the library {library} is not installed: pip install 'brickpilot[hil]'", err=True)
        sys.exit(2)
    except (SimulationError, WorkFailedError, OSError) as error:
        click.echo(f"{program}: {' '.join(str(error).split())}", err=True)
        sys.exit(1)
