"""A scene of ours as a scene file of SPlisHSPlasH (JSON), with its meshes and particles beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from surfsup.scene import Scene
from surfsup.scene.solids import build_solids
from surfsup.sph.dfsph import VISCOSITY
from surfsup.sph.liquid import REST_DENSITY, LiquidForces
from surfsup.sph.state import SUBSTEP_TIME
from surfsup.splishsplash.converted_scene import ConvertedScene
from surfsup.splishsplash.emitters import FLOW_TOLERANCE, emitter_of
from surfsup.splishsplash.job_files import (
    DFSPH,
    FIXED_STEP,
    VOLUME_MAPS,
    explicit_viscosity,
    implicit_viscosity,
    particle_file,
    surface_tension,
)

RESOLUTION = 160  # cells of marching cubes along the longest side of a solid
MAP_CELL = 2.0  # particle radii, of the solver's own volume maps
MAX_MAP = 80  # nodes along a side
MAX_MODELS = 50  # fluid models in a file


def export_scene(scene: Scene, out: Path) -> ConvertedScene:
    """Convert ``scene`` to the content of the file ``out`` and of a folder beside it, without writing anything.

    Raises:
        InputError: a file of the scene is unusable.
    """
    folder = out.with_name(f"{out.stem}-files")
    files: dict[Path, trimesh.Trimesh | np.ndarray | bytes] = {}
    missing = missing_in_file(scene)
    surface = build_solids(scene).at_time(scene.start_time)
    bodies = []
    if not scene.container.open:
        files[folder / "box.obj"] = trimesh.creation.box((1, 1, 1))
        size = list(scene.container.size)
        bodies.append(rigid_body(f"{folder.name}/box.obj", [0.0, 0.0, size[2] / 2], size, True, size, scene))
    if surface is not None:
        mesh = files[folder / "solid.obj"] = surface.to_mesh(RESOLUTION)
        extents = [float(side) for side in mesh.extents]
        bodies.append(rigid_body(f"{folder.name}/solid.obj", [0, 0, 0], [1, 1, 1], False, extents, scene))
    particles = scene.initial_particles(surface)
    # The file has one velocity for each model, so particles of one velocity are one model.
    velocities, model_of = np.unique(particles.velocities, axis=0, return_inverse=True)
    if len(velocities) > MAX_MODELS:
        missing.append("velocities of single particles; all begin with the mean velocity")
        velocities = particles.velocities.mean(axis=0, keepdims=True)
        model_of = np.zeros(len(particles.positions), int)
    models = []
    for number, velocity in enumerate(velocities):
        file = folder / f"fluid-{number}.bgeo"
        files[file] = particle_file(particles.positions[model_of.ravel() == number])
        models.append(
            {
                "id": "Fluid",
                "particleFile": f"{folder.name}/{file.name}",
                "translation": [0.0, 0.0, 0.0],
                "scale": [1.0, 1.0, 1.0],
                "initialVelocity": [float(value) for value in velocity],
            }
        )
    material: dict[str, object] = {"id": "Fluid", "density0": scene.density, **liquid_of(scene)}
    content: dict[str, object] = {
        "Configuration": {
            "particleRadius": scene.particle_radius,
            "timeStepSize": SUBSTEP_TIME * scene.units.time,
            "cflMethod": FIXED_STEP,
            "gravitation": list(scene.gravity),
            "simulationMethod": DFSPH,
            "boundaryHandlingMethod": VOLUME_MAPS,
            "stopAt": scene.frames * scene.frame_time,
            "DFSPH": {"enableDivergenceSolver": True},
        },
        "Materials": [material],
        "FluidModels": models,
        "RigidBodies": bodies,
    }
    if scene.taps:
        content["Emitters"] = emitters(scene, missing)
        # Memory for them is taken at the start.
        material["maxEmitterParticles"] = 2 * sum(
            tap.nozzle(scene.spacing).count(0.0, scene.start_time + scene.frames * scene.frame_time)
            for tap in scene.taps
        )
    return ConvertedScene(json.dumps(content, indent=1) + "\n", missing, out, files)


def liquid_of(scene: Scene) -> dict[str, object]:
    """The keys of a material for the liquid of a scene, which its file has in the scene's own units."""
    factor = scene.units.viscosity
    liquid = LiquidForces.of(scene.units.liquid_to_solver(scene.liquid))
    if liquid is None:
        return explicit_viscosity(factor * VISCOSITY)
    # A coefficient is the same for particles of every size, but its force grows with the density.
    share = REST_DENSITY / scene.density
    tension = surface_tension(
        replace(liquid, surface_tension=share * liquid.surface_tension, adhesion=share * liquid.adhesion)
    )
    if liquid.viscosity is None:
        return explicit_viscosity(factor * VISCOSITY) | tension
    return implicit_viscosity(factor * liquid.viscosity, factor * liquid.boundary_viscosity) | tension


def missing_in_file(scene: Scene) -> list[str]:
    """What a scene has and a file of SPlisHSPlasH does not, a phrase each."""
    missing = []
    if any(getattr(entry, "rigid_body", None) is not None for entry in scene.surfaces.values()):
        missing.append("bodies that float; they stand still")
    if any(getattr(entry, "motion", None) is not None for entry in [scene.container, *scene.surfaces.values()]):
        missing.append("motions of solids, which SPlisHSPlasH takes from a script only")
    if scene.drains:
        missing.append("drains")
    return missing


def emitters(scene: Scene, missing: list[str]) -> list[dict[str, object]]:
    """The taps of a scene; adds to ``missing`` what emitters do not have."""
    converted: list[dict[str, object]] = []
    for number, tap in enumerate(scene.taps):
        if tap.carrier is not None:
            missing.append(f"tap {number}, which moves")
            continue
        if tap.recycle:
            missing.append(f"tap {number} gives only what drains have taken; here it always flows")
        emitter, share = emitter_of(tap, scene.spacing)
        if abs(share - 1) > FLOW_TOLERANCE:
            missing.append(
                f"the flow of tap {number}; that of its emitter, of whole particles, is {share:.2f} times it"
            )
        converted.append(emitter)
    return converted


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
