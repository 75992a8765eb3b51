"""The input files of one simulation by SPlisHSPlasH."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import numpy as np

from surfsup.scene import PARTICLE_RADIUS
from surfsup.scene.strict_model import Vector
from surfsup.sph.boundary.volume_map import VolumeMap
from surfsup.sph.dfsph import VISCOSITY
from surfsup.sph.liquid import REST_DENSITY, LiquidForces, Mixture
from surfsup.sph.state import SUBSTEP_TIME
from surfsup.splishsplash.child_process import DRAINS_FILE, ENTERING_FILE, VELOCITY_FILE
from surfsup.splishsplash.entering_water import EnteringWater
from surfsup.splishsplash.map_file import write_map
from surfsup.splishsplash.solid_motion import MOTION_FILE, SolidMotion, write_motions

BODY_FILE = "body.obj"  # the solver requires triangles for each body, but does not use them if there is a volume map

VOLUME_MAPS = 2
DFSPH = 4
FIXED_STEP = 0
STANDARD_VISCOSITY, WEILER_VISCOSITY = 1, 6
AKINCI_TENSION, AKINCI_NAME = 2, "Akinci et al. 2013"

VISCOSITY_ERROR = 1e-4  # of the conjugate gradients, relative to the velocities; by default 0.01


def explicit_viscosity(viscosity: float) -> dict[str, object]:
    """The keys of a material with the solver's standard viscosity in m²/s, and none at solids."""
    coefficients = {"viscosity": viscosity, "viscosityBoundary": 0.0}
    return {"viscosityMethod": STANDARD_VISCOSITY, "Standard viscosity": coefficients}


def implicit_viscosity(viscosity: float, at_solids: float) -> dict[str, object]:
    """The keys of a material whose viscosity in m²/s is that of Weiler et al. 2018."""
    coefficients = {"viscosity": viscosity, "viscosityBoundary": at_solids, "viscoMaxError": VISCOSITY_ERROR}
    return {"viscosityMethod": WEILER_VISCOSITY, "Weiler et al. 2018": coefficients}


def materials(liquid: LiquidForces | Mixture | None) -> list[dict[str, object]]:
    """The material of each liquid in the units of the solver; None for water as the solver has it."""
    if not isinstance(liquid, Mixture):
        return [material(liquid)]
    return [
        {**material(replaced(forces, 1 / mass)), "id": fluid_id(number), "density0": REST_DENSITY * mass}
        for number, (forces, mass) in enumerate(zip(liquid.forces, liquid.masses, strict=True))
    ]


def fluid_id(number: int) -> str:
    """The name of a liquid of a mixture. The solver sorts its fluids by their names."""
    return f"Fluid {number:03d}"


def replaced(forces: LiquidForces, factor: float) -> LiquidForces:
    """A liquid with other coefficients of tension and adhesion, which the solver multiplies by a particle's mass."""
    return replace(forces, surface_tension=factor * forces.surface_tension, adhesion=factor * forces.adhesion)


def material(liquid: LiquidForces | None) -> dict[str, object]:
    """The material of a liquid in the units of the solver; None for water as the solver has it."""
    values: dict[str, object] = {"id": "Fluid", "density0": 1000}
    if liquid is None or liquid.viscosity is None:
        values |= explicit_viscosity(VISCOSITY)
    else:
        values |= implicit_viscosity(liquid.viscosity, liquid.boundary_viscosity)
    return values if liquid is None else values | surface_tension(liquid)


def surface_tension(liquid: LiquidForces) -> dict[str, object]:
    """The keys of a material whose surface tension and adhesion are those of Akinci et al. 2013; none without both."""
    if not liquid.surface_tension and not liquid.adhesion:
        return {}
    coefficients = {"surfaceTension": liquid.surface_tension, "surfaceTensionBoundary": liquid.adhesion}
    return {"surfaceTensionMethod": AKINCI_TENSION, AKINCI_NAME: coefficients}


def solver_scene(
    gravity: tuple[float, float, float],
    fluid_files: list[str],
    velocities: list[tuple[float, float, float]],
    map_files: list[str],
    motions: Sequence[SolidMotion | None] = (),
    liquid: LiquidForces | Mixture | None = None,
) -> dict[str, object]:
    """The scene file of SPlisHSPlasH: DFSPH, a fixed time step, boundary volume maps.

    Args:
        gravity: m/s².
        fluid_files: particle files beside the scene file, one for each block of fluid.
        velocities: initial velocity of each block in m/s.
        map_files: volume maps beside the scene file, one for each boundary.
        motions: of each boundary, None for one that stands still.
        liquid: None for water as the solver has it; of a mixture every liquid has one block, in order.
    """
    bodies = [
        {
            "geometryFile": BODY_FILE,
            "isDynamic": False,
            "isWall": motion is None,
            "mapInvert": False,
            "mapFile": file,
            **({} if motion is None else motion.start),
        }
        for file, motion in zip_longest(map_files, motions)
    ]
    return {
        "Configuration": {
            "particleRadius": PARTICLE_RADIUS,
            "timeStepSize": SUBSTEP_TIME,
            "cflMethod": FIXED_STEP,
            "gravitation": list(gravity),
            "simulationMethod": DFSPH,
            "boundaryHandlingMethod": VOLUME_MAPS,
            "DFSPH": {"enableDivergenceSolver": True},
        },
        "Materials": materials(liquid),
        "FluidModels": [
            {
                "id": fluid_id(number) if isinstance(liquid, Mixture) else "Fluid",
                "particleFile": file,
                "translation": [0.0, 0.0, 0.0],
                "scale": [1.0, 1.0, 1.0],
                "initialVelocity": list(velocity),
            }
            for number, (file, velocity) in enumerate(zip(fluid_files, velocities, strict=True))
        ],
        "RigidBodies": bodies,
    }


def write_job(
    folder: Path,
    gravity: tuple[float, float, float],
    blocks: Sequence[np.ndarray],
    velocities: Sequence[Vector | np.ndarray],
    boundaries: Sequence[VolumeMap],
    motions: Sequence[SolidMotion | None] = (),
    entering: EnteringWater | None = None,
    liquid: LiquidForces | Mixture | None = None,
) -> Path:
    """Write the scene, the particles and the boundaries into ``folder``, which no other job uses.

    Args:
        folder: an empty folder.
        gravity: m/s².
        blocks: positions (N, 3) of each block of fluid, meters.
        velocities: of each block, or of each of its particles (N, 3), m/s.
        boundaries: volume maps, those of solids that move in their own frames.
        motions: of each boundary, None for one that stands still.
        entering: the water that enters and leaves.
        liquid: None for water as the solver has it; of a mixture every liquid has one block, in order.

    Returns:
        The scene file's path.
    """
    (folder / BODY_FILE).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    if entering is not None:
        np.save(folder / ENTERING_FILE, entering.table())
        if entering.passages.drains:
            (folder / DRAINS_FILE).touch()
        if len(entering.parked):
            blocks, velocities = [*blocks, entering.parked], [*velocities, (0.0, 0.0, 0.0)]
    fluid_files = [f"fluid-{number}.bgeo" for number in range(len(blocks))]
    for file, positions in zip(fluid_files, blocks, strict=True):
        (folder / file).write_bytes(particle_file(positions))
    map_files = [f"boundary-{number}.cdm" for number in range(len(boundaries))]
    for file, boundary in zip(map_files, boundaries, strict=True):
        write_map(folder / file, boundary)
    moving = {number: motion for number, motion in enumerate(motions) if motion is not None}
    if moving:
        write_motions(folder / MOTION_FILE, moving)
    if any(np.ndim(velocity) == 2 for velocity in velocities):
        each = [
            np.broadcast_to(np.asarray(velocity, np.float32), positions.shape)
            for velocity, positions in zip(velocities, blocks, strict=True)
        ]
        np.save(folder / VELOCITY_FILE, np.concatenate(each))
        velocities = [(0.0, 0.0, 0.0)] * len(blocks)
    common = [(float(x), float(y), float(z)) for x, y, z in velocities]
    path = folder / "scene.json"
    path.write_text(json.dumps(solver_scene(gravity, fluid_files, common, map_files, motions, liquid), indent=1))
    return path


def particle_file(positions: np.ndarray) -> bytes:
    """Positions (N, 3) in Houdini's classic binary geometry format, version 5, big-endian."""
    count = len(positions)
    header = b"BgeoV" + struct.pack(">9i", 5, count, 0, 0, 0, 0, 0, 0, 0)
    points = np.concatenate([positions, np.ones((count, 1))], axis=1).astype(">f4")
    return header + points.tobytes() + b"\x00\xff"
