"""`surfsup doctor`: what this machine has and lacks."""

from __future__ import annotations

import typer


def doctor() -> None:
    """Tell what this machine has and lacks, and the command that mends it.

    Example: surfsup doctor
    """
    from surfsup.doctor import examine

    for finding in examine():
        typer.echo(f"{'ok     ' if finding.fine else 'missing'}  {finding.what}: {finding.found}")
        if finding.remedy:
            typer.echo(f"         mend with: {finding.remedy}")
