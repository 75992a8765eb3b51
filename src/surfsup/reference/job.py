"""What the solver is asked to do, as the files that SPlisHSPlasH reads."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import trimesh

PARTICLE_RADIUS = 0.015  # metres
SOLVER_STEP = 0.001  # seconds
STEPS_PER_FRAME = 5
SURFACE_MAP_CELLS = 40  # cells a side of the surface's volume map, which the solver pads by about 0.48 m
CONTAINER_MAP_CELL = 0.05  # metres; flat walls need no finer map

CONTAINER_FILE = "container.obj"

VOLUME_MAPS = 2
DFSPH = 4
FIXED_STEP = 0
STANDARD_VISCOSITY = 1


def solver_scene(
    container_size: tuple[float, float, float],
    gravity: tuple[float, float, float],
    fluid_files: list[str],
    velocities: list[tuple[float, float, float]],
    surface_file: str | None,
) -> dict[str, object]:
    """The scene file of SPlisHSPlasH: DFSPH, water, fixed step, volume-map boundaries.

    Args:
        container_size: sides in metres; x and y centred on 0, floor at z = 0.
        gravity: m/s².
        fluid_files: particle files beside the scene file, one a block of fluid.
        velocities: initial velocity of each block in m/s.
        surface_file: the solid's triangles in metres, beside the scene file.
    """
    bodies = [
        {
            "geometryFile": CONTAINER_FILE,
            "translation": [0.0, 0.0, container_size[2] / 2],
            "scale": list(container_size),
            "isDynamic": False,
            "isWall": True,
            "mapInvert": True,
            "mapThickness": 0.0,
            "mapResolution": [max(10, round(side / CONTAINER_MAP_CELL)) for side in container_size],
        }
    ]
    if surface_file is not None:
        bodies.append(
            {
                "geometryFile": surface_file,
                "isDynamic": False,
                "isWall": False,
                "mapInvert": False,
                "mapThickness": 0.0,
                "mapResolution": [SURFACE_MAP_CELLS] * 3,
            }
        )
    return {
        "Configuration": {
            "particleRadius": PARTICLE_RADIUS,
            "timeStepSize": SOLVER_STEP,
            "cflMethod": FIXED_STEP,
            "gravitation": list(gravity),
            "simulationMethod": DFSPH,
            "boundaryHandlingMethod": VOLUME_MAPS,
            "DFSPH": {"enableDivergenceSolver": True},
        },
        "Materials": [
            {
                "id": "Fluid",
                "density0": 1000,
                "viscosityMethod": STANDARD_VISCOSITY,
                "Standard viscosity": {"viscosity": 0.01, "viscosityBoundary": 0.0},
            }
        ],
        "FluidModels": [
            {
                "id": "Fluid",
                "particleFile": file,
                "translation": [0.0, 0.0, 0.0],
                "scale": [1.0, 1.0, 1.0],
                "initialVelocity": list(velocity),
            }
            for file, velocity in zip(fluid_files, velocities, strict=True)
        ],
        "RigidBodies": bodies,
    }


def write_job(
    folder: Path,
    container_size: tuple[float, float, float],
    gravity: tuple[float, float, float],
    blocks: list[np.ndarray],
    velocities: list[tuple[float, float, float]],
    solid: trimesh.Trimesh | None,
) -> Path:
    """Write scene, particles and triangles into ``folder``, which is this job's alone.

    Returns:
        The scene file's path.
    """
    unit_box = trimesh.creation.box(extents=(1.0, 1.0, 1.0))
    (folder / CONTAINER_FILE).write_text(trimesh.exchange.obj.export_obj(unit_box, include_normals=False))
    fluid_files = []
    for number, positions in enumerate(blocks):
        fluid_files.append(f"fluid-{number}.bgeo")
        (folder / fluid_files[-1]).write_bytes(particle_file(positions))
    surface_file = None
    if solid is not None:
        surface_file = "surface.obj"
        (folder / surface_file).write_text(trimesh.exchange.obj.export_obj(solid, include_normals=False))
    scene = solver_scene(container_size, gravity, fluid_files, velocities, surface_file)
    path = folder / "scene.json"
    path.write_text(json.dumps(scene, indent=1))
    return path


def particle_file(positions: np.ndarray) -> bytes:
    """Positions (N, 3) in Houdini's classic binary geometry format, version 5, big-endian."""
    count = len(positions)
    header = b"BgeoV" + struct.pack(">9i", 5, count, 0, 0, 0, 0, 0, 0, 0)
    points = np.concatenate([positions, np.ones((count, 1))], axis=1).astype(">f4")
    return header + points.tobytes() + b"\x00\xff"
