"""Where a fit keeps what it needs to go on."""

from __future__ import annotations

from pathlib import Path

from surfsup.errors import InputError
from surfsup.optim.checkpoint import CheckpointFiles
from surfsup.sdf.neural.surface_file import ENDING


def fit_folder(out: Path, resume: bool) -> Path:
    """The folder beside the file ``out`` in which its fit keeps its checkpoints.

    Raises:
        InputError: ``out`` is of another kind, or a fit is there already that is not to be resumed.
    """
    if out.suffix != ENDING:
        raise InputError(f"{out}: a surface is written as {ENDING}; give -o {out.stem or 'surface'}{ENDING}")
    folder = out.with_suffix(".fit")
    if not resume and CheckpointFiles(folder).exist():
        raise InputError(f"{folder}: holds a fit already; go on with --resume, or give another -o")
    return folder
