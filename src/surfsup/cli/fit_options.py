"""The options that the verbs of `surfsup fit` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TimeLimit = Annotated[str, typer.Option("--time", help="Stop after so long: 90s, 30m, 2h.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from where the last one stopped.")]
Threads = Annotated[int, typer.Option(min=1, help="Threads of torch.")]
Overrides = Annotated[list[str] | None, typer.Argument(metavar="key=value")]
OutFile = Annotated[Path, typer.Option("-o", "--out", help="The file of the surface, .safetensors.")]
UpAxis = Annotated[str | None, typer.Option("--up", help="The input's own upward axis, y or z.")]
