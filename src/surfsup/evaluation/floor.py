"""The reproducibility floor: the error of the reference solver against itself.

The reference solver runs each scene again with its water moved by 1 mm. Splashing water is chaotic, so these repeats
differ from the first run, and no simulator can be expected to come closer. ``surfsup floor DIR`` makes the repeats. A
simulator at the floor is indistinguishable from a second run of the reference solver.
"""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = "floor"
FLOOR_HINT = "make it with 'surfsup floor {}'"


def floor_files(reference: Path) -> list[Path]:
    """The repeats of the trajectory file ``reference``: ``floor/<stem>-1.h5`` and so on beside it, if any."""
    name = re.compile(re.escape(reference.stem) + r"-\d+\.h5")
    return sorted(path for path in (reference.parent / FOLDER).glob("*.h5") if name.fullmatch(path.name))
