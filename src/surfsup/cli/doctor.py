"""`surfsup doctor`: check this machine."""

from __future__ import annotations

import typer


def doctor() -> None:
    """Check what surfsup can use on this machine.

    It prints the commands that fix what is missing.

    Example: surfsup doctor
    """
    from surfsup.doctor import run_checks

    for check in run_checks():
        typer.echo(f"{'ok     ' if check.passed else 'missing'}  {check.name}: {check.found}")
        if check.remedy:
            typer.echo(f"         fix: {check.remedy}")
