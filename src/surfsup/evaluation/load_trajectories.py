"""Find the reference trajectories of data sets, with their floors, and report which files are not valid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.units import UnitMismatchError, check_same_units, check_simulator_frames
from surfsup.errors import InputError
from surfsup.evaluation.floor import floor_files
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_files
from surfsup.scene import Scene
from surfsup.scene.liquid import Liquid
from surfsup.scene.taps import Tap

FRAMES_PER_READ = 64


@dataclass(frozen=True)
class SkippedFile:
    """A file that is not valid, and why."""

    file: Path
    reason: str


@dataclass(frozen=True)
class ReferenceTrajectory:
    """A trajectory of the reference solver, and its repeats.

    Attributes:
        data_set: name of its data set.
        path: its file.
        scene: the simulated scene.
        frames: number of frames to evaluate.
        floors: files of its repeats.
    """

    data_set: str
    path: Path
    scene: Scene
    frames: int
    floors: list[Path]


@dataclass(frozen=True)
class DataSet:
    """A folder of trajectories: its name in the report, and the files to evaluate."""

    name: str
    folder: Path
    paths: list[Path]


def find_data_sets(folders: Sequence[Path], first: int | None = None) -> list[DataSet]:
    """The trajectory files of ``folders``, each folder under a unique name.

    Args:
        folders: folders of trajectory files.
        first: number of files to take from each folder; None takes all.

    Raises:
        InputError: a folder has no trajectories, or is given twice.
    """
    resolved = [folder.resolve() for folder in folders]
    for number, folder in enumerate(resolved):
        if folder in resolved[:number]:
            raise InputError(f"{folders[number]}: is given twice")
    parts = 1
    while len({folder.parts[-parts:] for folder in resolved}) < len(resolved):
        parts += 1
    sets = []
    for given, folder in zip(folders, resolved, strict=True):
        name = "-".join(part.strip("/") for part in folder.parts[-parts:])
        sets.append(DataSet(name, given, trajectory_files(given)[:first]))
    return sets


def load_references(
    sets: Sequence[DataSet],
    progress: Callable[[int, int], None] = lambda done, total: None,
    frames: int | None = None,
) -> tuple[list[ReferenceTrajectory], list[SkippedFile]]:
    """Every valid reference trajectory with its valid repeats, and all files that are not valid.

    Args:
        sets: the data sets.
        progress: called with the numbers of finished and of all files.
        frames: number of frames to evaluate of each trajectory; None takes all.

    Raises:
        InputError: no reference trajectory is valid.
        UnitMismatchError: the frames of one are not those of the simulators, or they differ in particle radius.
    """
    references: list[ReferenceTrajectory] = []
    skipped: list[SkippedFile] = []
    count, done = sum(len(one.paths) for one in sets), 0
    for one in sets:
        for path in one.paths:
            try:
                scene, length = check_reference(path)
                evaluated = min(length, frames or length)
                floors, damaged = load_floors(path, scene, evaluated)
                references.append(ReferenceTrajectory(one.name, path, scene, evaluated, floors))
                skipped += damaged
            except UnitMismatchError:
                raise
            except InputError as error:
                skipped.append(skipped_file(path, error))
            done += 1
            progress(done, count)
    if different := [one for one in references if one.scene.units != references[0].scene.units]:
        raise UnitMismatchError(
            f"{different[0].path}: has particles of radius {different[0].scene.particle_radius:g} m, but "
            f"{references[0].path} of {references[0].scene.particle_radius:g} m; evaluate them one after the other"
        )
    if not references:
        first = skipped[0]
        raise InputError(f"none of the {count} trajectories is valid; {first.file}: {first.reason}")
    return references, skipped


def check_reference(path: Path) -> tuple[Scene, int]:
    """The scene and the number of frames of the reference trajectory in ``path``.

    Raises:
        InputError: it is not a trajectory, is cut off or damaged, has other units, or its solid cannot be built.
    """
    with Trajectory(path) as reference:
        check_simulator_frames(path, reference)
        if len(reference) < reference.scene.frames:
            raise InputError(f"{path}: was cut off: it has {len(reference)} of its {reference.scene.frames} frames")
        check_finite(path, reference)
        reference.scene.build_surface()
        return reference.scene, len(reference)


def load_floors(reference: Path, scene: Scene, frames: int) -> tuple[list[Path], list[SkippedFile]]:
    """The valid repeats of ``reference``, and the repeats that are not valid."""
    valid, skipped = [], []
    for path in floor_files(reference):
        try:
            with Trajectory(reference) as original, Trajectory(path) as repeat:
                check_same_units((reference, path), (original, repeat))
                if len(repeat) < frames:
                    raise InputError(f"{path}: was cut off: it has {len(repeat)} of {frames} frames")
                if (difference := scene_difference(repeat.scene, scene)) is not None:
                    raise InputError(f"{path}: is of another scene than {reference.name}: their {difference} differ")
                check_finite(path, repeat)
            valid.append(path)
        except InputError as error:
            skipped.append(skipped_file(path, error))
    return valid, skipped


def check_finite(path: Path, trajectory: Trajectory) -> None:
    """Read all of ``trajectory`` once.

    Raises:
        InputError: it cannot be read to its end, or has values that are not finite.
    """
    for first in range(0, len(trajectory), FRAMES_PER_READ):
        try:
            parts = [data[first : first + FRAMES_PER_READ] for data in (trajectory.positions, trajectory.velocities)]
        except OSError:
            raise InputError(f"{path}: is damaged in the frames from {first} on") from None
        there = present(trajectory, first, len(parts[0]))
        if not all(np.isfinite(part[there]).all() for part in parts):
            raise InputError(f"{path}: has values that are not finite in the frames from {first} on")


def present(trajectory: Trajectory, first: int, count: int) -> np.ndarray:
    """Which particles (count, N) are in the scene in ``count`` frames from number ``first``."""
    there = np.zeros((count, trajectory.positions.shape[1]), bool)
    for row in range(count):
        there[row, trajectory.ids(first + row)] = True
    return there


def scene_difference(one: Scene, other: Scene) -> str | None:
    """Which part of two scenes differs; None if they are the same scene.

    The blocks of fluid and the taps may be up to one particle spacing apart, as those of the floor's repeats are.
    """
    root = Path("/")
    here, there = one.with_paths_relative_to(root), other.with_paths_relative_to(root)
    if here.container != there.container:
        return "containers"
    if (here.surface, here.surfaces) != (there.surface, there.surfaces):
        return "surfaces"
    if one.gravity != other.gravity:
        return "gravities"
    if physics_of(one.liquid) != physics_of(other.liquid):
        return "liquids"
    if len(here.taps) != len(there.taps) or not all(
        same_tap(*pair, other.spacing) for pair in zip(here.taps, there.taps, strict=True)
    ):
        return "taps"
    if here.drains != there.drains:
        return "drains"
    if len(here.fluid) != len(there.fluid):
        return "blocks of fluid"
    for mine, other_entry in zip(here.fluid, there.fluid, strict=True):
        if mine.block is None or other_entry.block is None:
            if mine != other_entry:
                return "blocks of fluid"
            continue
        corners = [np.array([entry.min, entry.max]) for entry in (mine.block, other_entry.block)]
        if np.abs(corners[0] - corners[1]).max() > other.spacing:
            return "blocks of fluid"
    return None


def physics_of(liquid: Liquid | None) -> Liquid | None:
    """A liquid without its color."""
    return None if liquid is None else liquid.physics


def same_tap(one: Tap, other: Tap, distance: float) -> bool:
    """Whether two taps are the same, up to ``distance`` in meters, as those of the floor's repeats are."""
    near = bool(np.abs(np.subtract(one.at, other.at)).max() <= distance)
    return near and one.model_copy(update={"at": other.at}) == other


def skipped_file(path: Path, error: InputError) -> SkippedFile:
    """The file with its error message, without the file's name in front of it."""
    return SkippedFile(path, str(error).removeprefix(f"{path}: "))
