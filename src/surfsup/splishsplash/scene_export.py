"""A scene of ours as a scene file of SPlisHSPlasH (JSON), with its meshes and particles beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.solids import build_solids
from surfsup.sph.dfsph import VISCOSITY
from surfsup.sph.state import SUBSTEP_TIME
from surfsup.splishsplash.job_files import DFSPH, FIXED_STEP, STANDARD_VISCOSITY, VOLUME_MAPS, particle_file

RESOLUTION = 160  # cells of marching cubes along the longest side of a solid
MAP_CELL = 2.0  # particle radii, of the solver's own volume maps
MAX_MAP = 80  # nodes along a side
MAX_MODELS = 50  # fluid models in a file


def export_scene(scene: Scene, out: Path) -> list[str]:
    """Write ``scene`` to the file ``out``, and its meshes and particles into a folder beside it.

    Returns:
        What the scene has and the file does not, a phrase each.

    Raises:
        InputError: a file of the scene is unusable, or nothing can be written.
    """
    missing = []
    if scene.moves:
        missing.append("motions of solids, which SPlisHSPlasH takes from a script only")
    if scene.taps:
        missing.append("taps, whose layers the emitters of SPlisHSPlasH do not have")
    if scene.drains:
        missing.append("drains")
    units = scene.units
    solids = build_solids(scene)
    surface = solids.at_time(scene.start_time)
    particles = scene.initial_particles(surface)
    files = out.with_name(f"{out.stem}-files")
    try:
        files.mkdir(parents=True, exist_ok=True)
        bodies = []
        if not scene.container.open:
            trimesh.creation.box((1, 1, 1)).export(files / "box.obj")
            middle = [0.0, 0.0, scene.container.size[2] / 2]
            size = list(scene.container.size)
            bodies.append(rigid_body(f"{files.name}/box.obj", middle, size, walls=True, size=size, scene=scene))
        if surface is not None:
            mesh = surface.to_mesh(RESOLUTION)
            mesh.export(files / "solid.obj")
            extents = [float(side) for side in mesh.extents]
            bodies.append(rigid_body(f"{files.name}/solid.obj", [0, 0, 0], [1, 1, 1], False, extents, scene))
        models = []
        # The file has one velocity for each model, so particles of one velocity are one model.
        velocities, model_of = np.unique(particles.velocities, axis=0, return_inverse=True)
        if len(velocities) > MAX_MODELS:
            missing.append("velocities of single particles; all begin with the mean velocity")
            velocities = particles.velocities.mean(axis=0, keepdims=True)
            model_of = np.zeros(len(particles.positions), int)
        for number, velocity in enumerate(velocities):
            name = f"fluid-{number}.bgeo"
            (files / name).write_bytes(particle_file(particles.positions[model_of.ravel() == number]))
            models.append(
                {
                    "id": "Fluid",
                    "particleFile": f"{files.name}/{name}",
                    "translation": [0.0, 0.0, 0.0],
                    "scale": [1.0, 1.0, 1.0],
                    "initialVelocity": [float(value) for value in velocity],
                }
            )
        content = {
            "Configuration": {
                "particleRadius": scene.particle_radius,
                "timeStepSize": SUBSTEP_TIME * units.time,
                "cflMethod": FIXED_STEP,
                "gravitation": list(scene.gravity),
                "simulationMethod": DFSPH,
                "boundaryHandlingMethod": VOLUME_MAPS,
                "stopAt": scene.frames * scene.frame_time,
                "DFSPH": {"enableDivergenceSolver": True},
            },
            "Materials": [
                {
                    "id": "Fluid",
                    "density0": 1000,
                    "viscosityMethod": STANDARD_VISCOSITY,
                    "Standard viscosity": {"viscosity": VISCOSITY * units.viscosity, "viscosityBoundary": 0.0},
                }
            ],
            "FluidModels": models,
            "RigidBodies": bodies,
        }
        out.write_text(json.dumps(content, indent=1) + "\n")
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from None
    return missing


def rigid_body(
    file: str, place: list[float], scale: list[float], walls: bool, size: list[float], scene: Scene
) -> dict[str, object]:
    """A body that stands still; ``size`` (3,) in meters decides how fine its volume map is."""
    nodes = [min(MAX_MAP, max(10, round(side / (MAP_CELL * scene.particle_radius)))) for side in size]
    return {
        "geometryFile": file,
        "translation": place,
        "rotationAxis": [1, 0, 0],
        "rotationAngle": 0.0,
        "scale": scale,
        "isDynamic": False,
        "isWall": walls,
        "mapInvert": walls,
        "mapThickness": 0.0,
        "mapResolution": nodes,
    }
