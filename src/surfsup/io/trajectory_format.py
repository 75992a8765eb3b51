"""The layout of trajectory files: names of their groups and data sets, chunks, precision.

It is that of LagrangeBench (one group per trajectory with ``position`` and ``particle_type``) plus ``velocity``, in
HDF5, with HDF5's own shuffle and deflate filters, so every HDF5 program reads it.
"""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np

from surfsup import __version__
from surfsup.scene import Scene
from surfsup.scene.particle_file import LIQUIDS

GROUP = "00000"
# Group with a data set (frames, 7) for each solid that moves: x, y, z in meters, then w, x, y, z.
POSES = f"{GROUP}/pose"
# Data set (particles, 2) where water enters or leaves: first frame, frame after the last.
LIFETIMES = f"{GROUP}/lifetime"
# Groups with a data set (frames, 3) for each solid whose force is recorded: N, and N m about the solid's origin. NaN in
# the first frame, which has none.
FORCES, TORQUES = f"{GROUP}/forces", f"{GROUP}/torques"
FRAMES_PER_CHUNK = 2  # larger chunks compress better (8: 0.66 instead of 0.72), but windows then read unused frames
# Velocities are rounded to multiples of this, in m/s. It is finer than the velocities that positions resolve, which
# float32 stores to 6e-8 m; finer digits are noise that does not compress.
VELOCITY_STEP = 2.0**-16
FLUID_TYPE = 0


@dataclass(frozen=True)
class Provenance:
    """Where a trajectory comes from.

    Attributes:
        simulator: name of the simulator.
        seed: seed of its random numbers.
        version: version of surfsup.
    """

    simulator: str
    seed: int = 0
    version: str = __version__


def write_head(
    file: h5py.File, scene: Scene, text: str, provenance: Provenance, particles: int, start_time: float
) -> None:
    """Write all but the frames to a new file; the data sets of positions and velocities are empty.

    Args:
        file: the new file.
        scene: the simulated scene.
        text: the scene as YAML, with paths as the file shall have them.
        provenance: simulator, seed and version.
        particles: number of particles.
        start_time: seconds, of the first frame.
    """
    file.attrs.update(
        {
            "scene": text,
            "frame_time": scene.frame_time,
            "radius": scene.particle_radius,
            "model": provenance.simulator,
            "seed": provenance.seed,
            "version": provenance.version,
        }
    )
    if scene.restart is not None or start_time != 0:
        file.attrs["start_time"] = start_time
    group = file.create_group(GROUP)
    for name in ("position", "velocity"):
        group.create_dataset(
            name,
            shape=(0, particles, 3),
            maxshape=(None, particles, 3),
            chunks=(FRAMES_PER_CHUNK, particles, 3),
            dtype=np.float32,
            shuffle=True,
            compression="gzip",
            compression_opts=1,
        )
    if scene.mixture:
        file[LIQUIDS] = np.zeros(particles, np.uint8)
        file[LIQUIDS].attrs["density"] = [liquid.density for liquid in scene.mixture]
    group["particle_type"] = np.full(particles, FLUID_TYPE, dtype=np.int64)
