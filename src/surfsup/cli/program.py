"""The program: its verbs by name, and its exit statuses.

Verbs import the libraries they need when they run, so that ``--help`` stays fast.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
import warnings
from contextlib import suppress
from typing import Annotated, NoReturn

import typer

from surfsup import __version__
from surfsup.activity import report_activities
from surfsup.cli.activity_lines import activity_lines
from surfsup.cli.compare import compare
from surfsup.cli.convert import convert
from surfsup.cli.design import design
from surfsup.cli.doctor import doctor
from surfsup.cli.evaluate import evaluate
from surfsup.cli.examples import examples
from surfsup.cli.export import export
from surfsup.cli.fit import fit
from surfsup.cli.forces import forces
from surfsup.cli.generate import floor, generate
from surfsup.cli.late_interrupts import interrupt_once_more
from surfsup.cli.live import live
from surfsup.cli.locks import held_locks
from surfsup.cli.missing import missing_parameters
from surfsup.cli.option_groups import expand_option_groups
from surfsup.cli.options import split_vectors
from surfsup.cli.reference import reference
from surfsup.cli.simulate import simulate
from surfsup.cli.status import BAD_INPUT, FAULT, INTERRUPTED
from surfsup.cli.sweep import sweep
from surfsup.cli.train import train
from surfsup.cli.view import render, view
from surfsup.cli.warning_lines import one_line_warnings
from surfsup.errors import InputError, Interrupted, SimulationError, printable

GARBAGE_THRESHOLD = 5_000  # new objects between two searches; Python's own is 700
NO_NUMBER = "Input should be a valid number, unable to parse string as a number"  # the words of typer's validation

app = typer.Typer(
    name="surfsup",
    help="Pour water on any surface.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

WATER = (simulate, examples, sweep, reference, compare, live, view, render, forces, export, convert)
LEARNING = (generate, floor, train, evaluate, design)
for verb in (*WATER, *LEARNING, doctor):
    app.command()(expand_option_groups(verb))
app.add_typer(fit, name="fit")


@app.callback(invoke_without_command=True)
def surfsup(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Pour water on any surface."""
    if version:
        typer.echo(__version__)
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line and exit: 0 done, 2 bad input or a full disk, 1 a failure of surfsup, 130 interrupted."""
    if sys.argv[1:] == ["--version"]:  # typer would import pydantic to convert the option
        typer.echo(__version__)
        sys.exit(0)
    collect_less_garbage()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: a line says what is kept
    warnings.showwarning = one_line_warnings()
    sys.unraisablehook = interrupt_once_more
    report_activities(activity_lines)
    try:
        with held_locks:
            status = app(args=split_vectors(sys.argv[1:]), standalone_mode=False)
        sys.stdout.flush()
    except (InputError, typer.TyperException) as error:
        message = str(error)
        if isinstance(error, typer.TyperException):
            message = missing_parameters(error) or error.format_message()
        message = message.replace(NO_NUMBER, "it must be a number, without a unit (lengths are in meters)")
        sys.stderr.write(f"surfsup: {printable(message)}\n")
        sys.exit(BAD_INPUT)
    except SimulationError as error:
        sys.stderr.write(f"surfsup: {printable(str(error))}\n")
        sys.exit(FAULT)
    except Interrupted as interrupt:
        exit_interrupted(str(interrupt))
    except (KeyboardInterrupt, typer.Abort):
        exit_interrupted("nothing was finished yet")
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("", "surfsup"):
            raise
        sys.stderr.write(f"surfsup: the library '{missing}' is missing; install surfsup again (docs/install.md)\n")
        sys.exit(BAD_INPUT)
    except MemoryError as error:
        sys.stderr.write(f"surfsup: there is too little memory ({printable(str(error))}); larger particles need less\n")
        sys.exit(BAD_INPUT)
    except BrokenPipeError:  # the reader of standard output has ended
        drop_output()
        sys.exit(FAULT)
    except OSError as error:
        drop_output()
        with suppress(OSError):
            sys.stderr.write(f"surfsup: {printable(environment_error(error))}\n")
        sys.exit(BAD_INPUT)
    if status == INTERRUPTED:  # typer's own answer to an interrupt
        exit_interrupted("nothing was finished yet")
    sys.exit(status if isinstance(status, int) else 0)


def collect_less_garbage() -> None:
    """Look for garbage less often: imports make many objects, but no garbage, and searching them takes 0.5 s.

    What is there when Python ends is not searched at all.
    """
    gc.set_threshold(GARBAGE_THRESHOLD)
    atexit.register(gc.freeze)


def environment_error(error: OSError) -> str:
    """The message about an error of the system that no other code explains, such as a full disk, in one line."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    reason = "the disk is full, or a limit is reached" if full else error.strerror or str(error)
    return " ".join((reason if error.filename is None else f"{error.filename}: {reason}").split())


def drop_output() -> None:
    """Send the rest of standard output nowhere, so that Python does not fail once more when it ends."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def exit_interrupted(kept: str) -> NoReturn:
    """Exit after an interrupt, and print what is ``kept``."""
    sys.stderr.write(f"surfsup: interrupted; {printable(kept)}\n")
    sys.exit(INTERRUPTED)
