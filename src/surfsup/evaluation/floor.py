"""The floor below which no simulator can go: the truth against itself, started one millimeter away.

``surfsup floor DIR`` makes the repeats. A model whose errors are not larger cannot be told from a second run
of the reference solver.
"""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = "floor"
HOW_TO_MAKE = "make it with 'surfsup floor {}'"


def floor_files(truth: Path) -> list[Path]:
    """The repeats of the trajectory file ``truth``: ``floor/<stem>-1.h5`` and so on beside it, if any."""
    name = re.compile(re.escape(truth.stem) + r"-\d+\.h5")
    return sorted(path for path in (truth.parent / FOLDER).glob("*.h5") if name.fullmatch(path.name))
