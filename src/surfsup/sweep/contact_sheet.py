"""The contact sheet of a sweep: a small picture of every case, with its varied values below."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory
from surfsup.sweep.case import Case
from surfsup.viewing.label import label
from surfsup.viewing.shadow_maps import FULL_LIGHT
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

SIZE = (320, 240)  # pixels of a picture
COLUMNS = 5
MOMENT = 0.5  # of the duration
PICTURE = "picture.png"
WHITE = 255


def write_contact_sheet(
    folder: Path, cases: Sequence[Case], progress: Callable[[int, int], None] = lambda done, total: None
) -> Path:
    """Draw the water of every finished case at half of its time; returns the path of the sheet.

    A picture that is there already is used again.

    Raises:
        InputError: this machine cannot render off screen.
    """
    tiles = []
    for number, case in enumerate(cases, start=1):
        tiles.append(label(picture_of(folder / case.name), caption(case)))
        progress(number, len(cases))
    columns = min(COLUMNS, len(tiles))
    blank = np.full_like(tiles[0], WHITE)
    tiles += [blank] * (math.ceil(len(tiles) / columns) * columns - len(tiles))
    rows = [np.hstack(tiles[first : first + columns]) for first in range(0, len(tiles), columns)]
    sheet = folder / "contact-sheet.png"
    with atomic_file(sheet) as partial:
        Image.fromarray(np.vstack(rows)).save(partial, format="PNG")
    return sheet


def picture_of(folder: Path) -> np.ndarray:
    """The picture (height, width, 3) uint8 of a case."""
    picture = folder / PICTURE
    if picture.exists():
        return np.asarray(Image.open(picture).convert("RGB"))
    with Trajectory(folder / "trajectory.h5") as trajectory:
        renderer = TrajectoryRenderer(trajectory, SIZE)
        image = renderer.render(round(MOMENT * (len(trajectory) - 1)), light=FULL_LIGHT)
        renderer.close()
    with atomic_file(picture) as partial:
        Image.fromarray(image).save(partial, format="PNG")
    return image


def caption(case: Case) -> str:
    """The varied values of a case, keys shortened to their last word."""
    values = [
        f"{short(key)} {value:.4g}" if isinstance(value, float) else f"{short(key)} {value}"
        for key, value in case.values.items()
    ]
    return ", ".join(values) or case.name


def short(key: str) -> str:
    """The last word of a key with the numbers that follow it: ``gravity.2`` stays, ``fluid.0.block`` is ``block``."""
    steps = key.split(".")
    words = [number for number, step in enumerate(steps) if not step.isdecimal()]
    return ".".join(steps[words[-1] :]) if words else key
