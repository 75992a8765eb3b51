"""Particles from a file: NPY, CSV, PLY, VTK, BGEO, or a frame of a trajectory."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import field_validator

from surfsup.checked.hdf5 import check_written, stored_dataset
from surfsup.errors import InputError, single_line
from surfsup.scene.bgeo_points import read_bgeo
from surfsup.scene.strict_model import StrictModel, Vector

if TYPE_CHECKING:
    import h5py

VTK_SUFFIXES = (".vtk", ".vtp", ".vtu")
SUFFIXES = (".npy", ".csv", ".ply", *VTK_SUFFIXES, ".bgeo", ".h5")
VELOCITY_NAMES = ("velocity", "velocities", "v", "vel")
# Data set (particles,) in a trajectory of several liquids: the number of each, with their densities as an attribute.
LIQUIDS = "00000/liquid"


class ParticleFile(StrictModel):
    """The particles in ``file``.

    Attributes:
        file: positions in meters and, if it has them, velocities in m/s.
        frame: of a trajectory; by default the last one.
        velocity: in m/s, of all particles; None for the velocities of the file, or rest.
        settle: whether the water comes to rest before the scene begins.

    Examples:
        >>> import numpy as np, surfsup as sf
        >>> np.save("water.npy", [[0, 0, 1.00], [0, 0, 1.03]])
        >>> len(sf.Scene(fluid=[ParticleFile(file="water.npy")]).initial_particles(None).positions)
        2
    """

    file: Path
    frame: int | None = None
    velocity: Vector | None = None
    settle: bool = False

    @field_validator("file")
    @classmethod
    def check_kind(cls, file: Path) -> Path:
        """Refuse files of other kinds."""
        if file.suffix.lower() not in SUFFIXES:
            raise ValueError(f"particles are read from {', '.join(SUFFIXES)}")
        return file

    def read(self, folder: Path) -> FileParticles:
        """Read the file, whose relative path starts at ``folder``.

        Raises:
            InputError: it is missing or unreadable, or a value is not a finite number.
        """
        found = read_particles(folder / self.file, self.frame)
        if self.velocity is None:
            return found
        velocity = np.array(self.velocity, np.float32)
        return FileParticles(found.positions, np.broadcast_to(velocity, found.positions.shape), found.radius)


@dataclass(frozen=True)
class FileParticles:
    """Particles of a file.

    Attributes:
        positions: (N, 3) float32, meters.
        velocities: (N, 3) float32, m/s.
        radius: of the particles in meters, where the file says it.
        time: seconds since the start of a trajectory's scene.
        liquids: (N,) number of the liquid of each particle, in a trajectory of several.
        densities: (K,) of those liquids, kg/m³.
    """

    positions: np.ndarray
    velocities: np.ndarray
    radius: float | None = None
    time: float = 0.0
    liquids: np.ndarray | None = None
    densities: tuple[float, ...] = ()


def read_particles(path: Path, frame: int | None = None) -> FileParticles:
    """Read particles.

    Args:
        path: a NumPy array or text with the columns x, y, z and optionally three velocities; a PLY, VTK or BGEO file of
            points, optionally with velocities; or a trajectory.
        frame: of a trajectory; None for the last.

    Raises:
        InputError: the file is missing or unreadable, has other columns, no particles, or values that are not finite.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file of particles")
    suffix = path.suffix.lower()
    if frame is not None and suffix != ".h5":
        raise InputError(f"{path}: only a trajectory has frames; omit frame")
    try:
        found = read_trajectory(path, frame) if suffix == ".h5" else as_particles(path, READERS[suffix](path))
    except InputError:
        raise
    except Exception as error:  # each library has errors of its own for files that it cannot read
        raise InputError(f"{path}: cannot be read as particles ({single_line(error)[:200]})") from None
    if len(found.positions) == 0:
        raise InputError(f"{path}: has no particles")
    bad = ~(np.isfinite(found.positions).all(axis=1) & np.isfinite(found.velocities).all(axis=1))
    if bad.any():
        raise InputError(
            f"{path}: {bad.sum()} of its {len(bad)} particles have values that are not finite numbers, "
            f"the first is number {int(bad.argmax())}"
        )
    return found


def as_particles(path: Path, values: np.ndarray) -> FileParticles:
    """The particles in the columns (N, 3) or (N, 6) of an array."""
    values = np.asarray(values)
    if values.ndim != 2 or values.shape[1] not in (3, 6) or values.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: is an array of shape {values.shape}, but particles are (N, 3) for x, y, z in meters, or (N, 6) "
            "with velocities in m/s"
        )
    values = values.astype(np.float32)
    return FileParticles(values[:, :3], values[:, 3:] if values.shape[1] == 6 else np.zeros_like(values))


def read_npy(path: Path) -> np.ndarray:
    """An array without Python objects."""
    return np.load(path, allow_pickle=False)


def read_csv(path: Path) -> np.ndarray:
    """Comma-separated numbers; a first line that holds names is skipped."""
    with path.open(encoding="utf-8-sig") as file:
        first = file.readline()
    try:
        [float(value) for value in first.split(",")]
        skipped = 0
    except ValueError:
        skipped = 1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an empty file; a missing particle is an error of its own
        return np.loadtxt(path, delimiter=",", skiprows=skipped, ndmin=2, encoding="utf-8-sig").reshape(
            -1, len(first.split(","))
        )


def read_points(path: Path) -> np.ndarray:
    """The points of a PLY or VTK file, with their velocities if it has them."""
    import pyvista

    mesh = pyvista.read(path)
    points = np.asarray(mesh.points)
    name = next((name for name in mesh.point_data if name.lower() in VELOCITY_NAMES), None)
    return points if name is None else np.concatenate([points, np.asarray(mesh.point_data[name])], axis=1)


READERS = {
    ".npy": read_npy,
    ".csv": read_csv,
    ".ply": read_points,
    ".bgeo": read_bgeo,
    **dict.fromkeys(VTK_SUFFIXES, read_points),
}


def read_trajectory(path: Path, frame: int | None) -> FileParticles:
    """A frame of a trajectory, by default the last.

    Raises:
        InputError: it has no such frame.
    """
    import h5py

    with h5py.File(path, "r") as file:
        positions, velocities = (stored_dataset(file, f"00000/{name}") for name in ("position", "velocity"))
        if positions.ndim != 3 or positions.shape[2] != 3 or positions.shape != velocities.shape:
            raise ValueError(f"its positions have the shape {positions.shape}, its velocities {velocities.shape}")
        check_written(positions)
        check_written(velocities)
        count = len(positions)
        number = count - 1 if frame is None else frame
        if not 0 <= number < count:
            frames = f"the frames 0 to {count - 1}, not {number}" if count else "no frames"
            raise InputError(f"{path}: has {frames}")
        values = [data[number] for data in (positions, velocities)]
        liquids: np.ndarray | None = None
        densities: tuple[float, ...] = ()
        if LIQUIDS in file:
            liquids, densities = read_liquids(file, positions.shape[1])
        if "00000/lifetime" in file:  # the particles that are in the scene in this frame
            lifetimes = stored_dataset(file, "00000/lifetime", "iu")
            if lifetimes.shape != (positions.shape[1], 2):
                raise ValueError(f"its lifetimes have the shape {lifetimes.shape}")
            first, end = lifetimes[:].T
            there = (first <= number) & (number < end)
            values = [data[there] for data in values]
            liquids = None if liquids is None else liquids[there]
        time = float(file.attrs.get("start_time", 0.0)) + number * float(file.attrs["frame_time"])
        return FileParticles(values[0], values[1], float(file.attrs["radius"]), time, liquids, densities)


def read_liquids(file: h5py.File, particles: int) -> tuple[np.ndarray, tuple[float, ...]]:
    """The number of the liquid of each particle of a trajectory (N,) int32, and the density of each liquid, kg/m³."""
    data = stored_dataset(file, LIQUIDS, "iu")
    check_written(data)
    numbers, densities = data[:].astype(np.int32), tuple(map(float, np.atleast_1d(data.attrs["density"])))
    if numbers.shape != (particles,) or not len(densities) or (len(numbers) and numbers.max() >= len(densities)):
        raise ValueError(f"its liquids have the shape {numbers.shape} and {len(densities)} densities")
    return numbers, densities


def end_time(path: Path) -> float:
    """The time of the last frame of a trajectory, seconds since the start of its scene; 0 for a file without one."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            last = max(0, len(stored_dataset(file, "00000/position")) - 1)
            time = float(file.attrs.get("start_time", 0.0)) + last * float(file.attrs["frame_time"])
            return time if math.isfinite(time) else 0.0
    except (OSError, RuntimeError, KeyError, TypeError, ValueError):
        return 0.0  # reading the particles is what reports the file
