"""The export of a trajectory: the one function behind ``surfsup export`` and ``sf.export``."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from surfsup.errors import InputError
from surfsup.exporting.formats import Format, What, Writer, check_export
from surfsup.exporting.frames import Interpolation, frame_count, resample
from surfsup.exporting.keyframes import KeyframeWriter
from surfsup.exporting.mesh_frame import liquid_surfaces
from surfsup.exporting.sequence import SequenceWriter
from surfsup.exporting.solids import SolidMeshes, pose_at
from surfsup.exporting.source import FrameSource
from surfsup.exporting.up_axis import UpAxis, with_up_axis
from surfsup.io.cut_off import open_readable
from surfsup.io.output_folder import writable_folder
from surfsup.io.scene_poses import scene_poses
from surfsup.io.trajectory import Trajectory
from surfsup.scene.solids import CONTAINER, Solids, build_solids
from surfsup.scene.units import Units
from surfsup.sph.environment import Environment
from surfsup.viewing.liquid_look import Rgb, display_colors
from surfsup.viewing.reconstruction import Reconstruction


@dataclass(frozen=True)
class Export:
    """What an export wrote.

    Attributes:
        frames: number of exported frames.
        files: the files to open in other programs: the first of a sequence, or the one with all frames.
        cut_off: whether the trajectory was cut off, so that frames are missing.
    """

    frames: int
    files: tuple[Path, ...]
    cut_off: bool


def export(
    trajectory: str | Path,
    format: str,
    out: str | Path,
    fps: float = 24,
    what: What | None = None,
    up: UpAxis | None = None,
    reconstruction: Reconstruction | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Export:
    """Write a trajectory in the format of another program, frame by frame.

    Frames between two of the trajectory are interpolated as by :meth:`Simulation.run`. Lengths are in meters, times in
    seconds, velocities in m/s.

    Args:
        trajectory: a trajectory file, or the folder with it. If it was cut off, the readable frames are exported, with
            a warning.
        format: its name, such as ``vtk``, ``bgeo`` or ``usd``; docs/export.md has the list.
        out: folder for the files; it is created.
        fps: frames per second.
        what: ``particles``, ``surface`` (of the water), ``solid`` or ``all``; by default particles, or the surface
            where the format has no particles. A format with one file for all frames gets everything.
        up: upward axis of the files, ``z`` or ``y``; by default the one the format requires, or z.
        reconstruction: parameters of the water's surface.
        overwrite: replace an older export in the folder.
        progress: called after each frame with the numbers of finished and of all frames.

    Raises:
        InputError: an argument is out of range, the trajectory is unreadable, a package is missing, or a file exists
            or cannot be written. No incomplete file is left.
        SimulationError: there is no surface around the particles of a frame.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=41)
        >>> sf.Simulation(scene).record("water.h5")
        >>> done = sf.export("water.h5", "bgeo", "houdini", fps=25)
        >>> done.frames, done.files[0].name
        (6, 'particles.0001.bgeo')
    """
    form = check_export(format, fps)
    contents, axis = form.contents(what), form.up_axis(up)
    with open_readable(Path(trajectory)) as opened:
        if 0 in opened.positions.shape:
            frames, particles, _ = opened.positions.shape
            raise InputError(
                f"{trajectory}: has {frames} frames of {particles} particles, so there is nothing to export"
            )
        folder = writable_folder(Path(out))
        colors = display_colors(opened.scene)
        with closing(open_writer(form, folder, fps, axis, overwrite, contents, colors)) as writer:
            return write(opened, writer, contents, fps, axis, reconstruction or Reconstruction(), progress)


def open_writer(
    form: Format,
    folder: Path,
    fps: float,
    up: UpAxis,
    overwrite: bool,
    contents: tuple[What, ...],
    colors: Sequence[Rgb],
) -> Writer:
    """The writer of a format, for liquids of these ``colors``.

    Raises:
        InputError: there is an older export, and ``overwrite`` is false.
    """
    if form.has_keyframes:
        return KeyframeWriter(folder, form, overwrite, contents)
    if form.suffix:
        return SequenceWriter(folder, form, overwrite, contents)
    return form.load("open_writer")(folder, fps, up, overwrite, colors)


def write(
    trajectory: Trajectory,
    writer: Writer,
    contents: tuple[What, ...],
    fps: float,
    up: UpAxis,
    reconstruction: Reconstruction,
    progress: Callable[[int, int], None],
) -> Export:
    """Write the contents of a trajectory; see :func:`export`."""
    solids = SolidMeshes(trajectory) if "solid" in contents else None
    if solids and not solids.move:
        if solids.still:
            writer.solid(with_up_axis(solids.still, up))
        elif len(contents) == 1:
            raise InputError("the scene of the trajectory has no solid, so there is nothing to export")
    source, done, liquids = FrameSource(trajectory), 0, len(trajectory.scene.mixture)
    if contents != ("solid",) or (solids and solids.move):
        total = frame_count(len(trajectory), trajectory.frame_time, fps)
        for frame in resample(source, trajectory.frame_time, fps, interpolation(trajectory)):
            if "particles" in contents:
                writer.particles(with_up_axis(frame, up))
            if solids and solids.move:
                writer.moving_solids(solids, frame.time, up)
            if "surface" in contents:
                for surface in liquid_surfaces(frame, liquids, reconstruction):
                    writer.surface(with_up_axis(surface, up))
            done += 1
            progress(done, total)
        if not done:
            raise InputError(f"{trajectory.path}: has no readable frame, so there is nothing to export")
    if source.cut_off:
        missing = f"only {source.read} of {len(trajectory)} frames are readable"
        warnings.warn(f"the trajectory was cut off: {missing}; these were exported", stacklevel=3)
    return Export(done, tuple(writer.finish()), source.cut_off)


def interpolation(trajectory: Trajectory) -> Interpolation:
    """The interpolation between frames, which knows the solid if its files are still there.

    It knows no walls that move: particles between two frames may be outside them by what a spline overshoots.
    """
    units, frame_time = Units(trajectory.radius), trajectory.frame_time
    try:
        solids = build_solids(trajectory.scene, list(trajectory.poses))
    except InputError as error:
        solids = Solids(None)
        warnings.warn(f"particles between two frames may enter the solid, which is missing: {error}", stacklevel=4)
    container = units.scene_to_solver(trajectory.scene).container
    if container.motion is not None or CONTAINER in trajectory.poses:
        container = container.model_copy(update={"open": True})
    corners = torch.tensor(container.lower), torch.tensor(container.upper)
    still = Environment(units.surface_to_solver(solids.still), *corners, torch.zeros(3))
    rows = scene_poses(trajectory) if solids.moving else {}

    def environment_at(time: float) -> Environment:
        if not solids.moving:
            return still
        place = (time - trajectory.start_time) / trajectory.frame_time
        poses = {solid.name: pose_at(rows[solid.name], place) for solid in solids.moving}
        return replace(still, surface=units.surface_to_solver(solids.at(poses)))

    return Interpolation(environment_at, units, frame_time)
