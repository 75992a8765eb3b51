"""Which trajectory files can be judged, and why the others cannot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.units import OtherUnits, check_units
from surfsup.errors import InputError
from surfsup.evaluation.floor import floor_files
from surfsup.io.trajectory import Trajectory
from surfsup.scene import SPACING, Scene

FRAMES_AT_ONCE = 64


@dataclass(frozen=True)
class Skipped:
    """A file that cannot be used, and why."""

    file: Path
    reason: str


@dataclass(frozen=True)
class Truth:
    """A true trajectory and its repeats.

    Attributes:
        data: name of its data set.
        path: its file.
        scene: what it is of.
        frames: how many of it are judged.
        floors: the files of its repeats.
    """

    data: str
    path: Path
    scene: Scene
    frames: int
    floors: list[Path]


@dataclass(frozen=True)
class DataSet:
    """A folder of trajectories, those of them that are judged, and the name that the report gives it."""

    name: str
    folder: Path
    paths: list[Path]


def data_sets(folders: Sequence[Path], first: int | None = None) -> list[DataSet]:
    """The trajectory files of ``folders``, each folder under a name of its own; of each the ``first`` so many or all.

    Raises:
        InputError: a folder has none, or is given twice.
    """
    found = [folder.resolve() for folder in folders]
    for number, folder in enumerate(found):
        if folder in found[:number]:
            raise InputError(f"{folders[number]}: is given twice")
    parts = 1
    while len({folder.parts[-parts:] for folder in found}) < len(found):
        parts += 1
    sets = []
    for given, folder in zip(folders, found, strict=True):
        paths = sorted(given.glob("*.h5"))
        if not paths:
            raise InputError(f"{given}: has no trajectories (*.h5) to judge by; make some with 'surfsup generate'")
        sets.append(DataSet("-".join(part.strip("/") for part in folder.parts[-parts:]), given, paths[:first]))
    return sets


def usable_truths(
    sets: Sequence[DataSet],
    tell: Callable[[int, int], None] = lambda done, total: None,
    frames: int | None = None,
) -> tuple[list[Truth], list[Skipped]]:
    """Every true trajectory that can be judged by, with its usable repeats; and all files that cannot be used.

    Args:
        sets: where to look.
        tell: told how many files are read.
        frames: how many of each are judged; None takes all.

    Raises:
        InputError: there is not one truth.
        OtherUnits: one is of another frame time or particle radius: no damage, but the wrong data.
    """
    truths: list[Truth] = []
    skipped: list[Skipped] = []
    count, done = sum(len(one.paths) for one in sets), 0
    for one in sets:
        for path in one.paths:
            try:
                scene, length = checked_truth(path)
                judged = min(length, frames or length)
                floors = usable_floors(path, scene, judged, skipped)
                truths.append(Truth(one.name, path, scene, judged, floors))
            except OtherUnits:
                raise
            except InputError as error:
                skipped.append(Skipped(path, reason(path, error)))
            done += 1
            tell(done, count)
    if not truths:
        first = skipped[0]
        raise InputError(f"none of the {count} trajectories can be used; {first.file}: {first.reason}")
    return truths, skipped


def checked_truth(path: Path) -> tuple[Scene, int]:
    """The scene and the number of frames of the true trajectory in ``path``.

    Raises:
        InputError: it is not a trajectory, is cut off or damaged, of other units, or its solid cannot be built.
    """
    with Trajectory(path) as truth:
        check_units(path, truth)
        if len(truth) < truth.scene.frames:
            raise InputError(f"{path}: was cut off: it has {len(truth)} of its {truth.scene.frames} frames")
        check_numbers(path, truth)
        truth.scene.build_surface()
        return truth.scene, len(truth)


def usable_floors(truth: Path, scene: Scene, frames: int, skipped: list[Skipped]) -> list[Path]:
    """The repeats of ``truth`` that can be used; the others join ``skipped``."""
    usable = []
    for path in floor_files(truth):
        try:
            with Trajectory(path) as repeat:
                check_units(path, repeat)
                if len(repeat) < frames:
                    raise InputError(f"{path}: was cut off: it has {len(repeat)} of {frames} frames")
                if (differing := difference(repeat.scene, scene)) is not None:
                    raise InputError(f"{path}: is of another scene than {truth.name}: their {differing} differ")
                check_numbers(path, repeat)
            usable.append(path)
        except InputError as error:
            skipped.append(Skipped(path, reason(path, error)))
    return usable


def check_numbers(path: Path, trajectory: Trajectory) -> None:
    """Read all of ``trajectory``, once.

    Raises:
        InputError: it cannot be read to its end, or holds what is not a finite number.
    """
    for first in range(0, len(trajectory), FRAMES_AT_ONCE):
        try:
            parts = [data[first : first + FRAMES_AT_ONCE] for data in (trajectory.positions, trajectory.velocities)]
        except OSError:
            raise InputError(f"{path}: is damaged in the frames from {first} on") from None
        if not all(np.isfinite(part).all() for part in parts):
            raise InputError(f"{path}: holds values that are not numbers in the frames from {first} on")


def difference(one: Scene, other: Scene) -> str | None:
    """What two scenes differ in, None if they are one scene.

    The blocks of fluid may lie up to one particle spacing apart, as those of the floor's repeats do.
    """
    root = Path("/")
    if one.container != other.container:
        return "containers"
    if one.with_paths_relative_to(root).surface != other.with_paths_relative_to(root).surface:
        return "surfaces"
    if one.gravity != other.gravity:
        return "gravities"
    corners = [np.array([(entry.block.min, entry.block.max) for entry in scene.fluid]) for scene in (one, other)]
    if corners[0].shape != corners[1].shape or np.abs(corners[0] - corners[1]).max() > SPACING:
        return "blocks of fluid"
    return None


def reason(path: Path, error: InputError) -> str:
    """The complaint without the file's own name in front of it."""
    return str(error).removeprefix(f"{path}: ")
