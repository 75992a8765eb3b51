"""`surfsup doctor`: check this machine."""

from __future__ import annotations

import json
from dataclasses import asdict

import typer

from surfsup.cli.options import AsJson


def doctor(as_json: AsJson = False) -> None:
    """Check what surfsup can use on this machine.

    It prints the commands that fix what is missing.

    Example: surfsup doctor
    """
    from surfsup.doctor import run_checks

    checks = run_checks()
    if as_json:
        typer.echo(json.dumps([asdict(check) for check in checks], indent=2))
        return
    for check in checks:
        typer.echo(f"{'ok     ' if check.passed else 'missing'}  {check.name}: {check.found}")
        if check.remedy:
            typer.echo(f"         fix: {check.remedy}")
