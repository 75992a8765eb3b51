import json
import struct

import numpy as np
import pytest

from surfsup.scene import Liquid
from surfsup.sdf import Sphere
from surfsup.sph.boundary.volume_map import build_volume_map
from surfsup.sph.liquid import NO_SLIP, VISCOSITY_FACTOR, LiquidForces
from surfsup.splishsplash.job_files import material, particle_file, solver_scene, write_job


@pytest.fixture(scope="module")
def ball():
    return build_volume_map(Sphere(0.1), np.full(3, -0.2), np.full(3, 0.2), np.full(3, 0.05))


def test_the_settings_are_those_of_the_paper():
    scene = solver_scene((0.0, 0.0, -9.81), ["a.bgeo"], [(0.0, 0.0, 0.0)], ["walls.cdm", "solid.cdm"])
    settings = scene["Configuration"]
    assert settings["particleRadius"] == 0.015
    assert settings["timeStepSize"] == 0.001
    assert settings["cflMethod"] == 0
    assert settings["simulationMethod"] == 4
    assert settings["boundaryHandlingMethod"] == 2
    assert [body["mapFile"] for body in scene["RigidBodies"]] == ["walls.cdm", "solid.cdm"]


def test_each_block_has_a_file_and_a_velocity_and_each_boundary_a_map(tmp_path, ball):
    blocks = [np.zeros((2, 3), np.float32), np.ones((3, 3), np.float32)]
    path = write_job(tmp_path, (0, 0, -1), blocks, [(0, 0, 0), (1, 2, 3)], [ball, ball])
    scene = json.loads(path.read_text())
    assert [model["initialVelocity"] for model in scene["FluidModels"]] == [[0, 0, 0], [1, 2, 3]]
    for model, block in zip(scene["FluidModels"], blocks, strict=True):
        assert (path.parent / model["particleFile"]).read_bytes() == particle_file(block)
    assert len(scene["RigidBodies"]) == 2
    for body in scene["RigidBodies"]:
        assert (path.parent / body["geometryFile"]).exists()
        assert (path.parent / body["mapFile"]).stat().st_size > 10_000


@pytest.mark.parametrize("count", [1, 5])
def test_the_particle_file_has_houdinis_format(count):
    positions = np.arange(3 * count, dtype=np.float32).reshape(-1, 3)
    data = particle_file(positions)
    assert data[:5] == b"BgeoV"
    assert struct.unpack(">2i", data[5:13]) == (5, count)
    points = np.frombuffer(data[41:-2], dtype=">f4").reshape(count, 4)
    np.testing.assert_array_equal(points[:, :3], positions)
    assert (points[:, 3] == 1).all()
    assert data[-2:] == b"\x00\xff"


def test_a_liquid_has_the_viscosity_of_weiler_and_the_tension_of_akinci_with_our_coefficients():
    water = material(None)
    assert water["viscosityMethod"] == 1 and "surfaceTensionMethod" not in water
    forces = LiquidForces.of(Liquid(viscosity=0.1, friction=0.5, surface_tension=57.0, adhesion=2.2))
    honey = material(forces)
    assert honey["viscosityMethod"] == 6 and honey["surfaceTensionMethod"] == 2
    assert honey["Weiler et al. 2018"]["viscosity"] == pytest.approx(0.1 * VISCOSITY_FACTOR)
    assert honey["Weiler et al. 2018"]["viscosityBoundary"] == pytest.approx(0.1 * VISCOSITY_FACTOR * NO_SLIP / 2)
    assert honey["Akinci et al. 2013"] == pytest.approx({"surfaceTension": 1.0, "surfaceTensionBoundary": 1.0})


def test_tension_alone_keeps_the_solver_s_own_viscosity():
    values = material(LiquidForces.of(Liquid(surface_tension=10.0)))
    assert values["viscosityMethod"] == 1 and values["surfaceTensionMethod"] == 2
