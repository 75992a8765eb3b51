import json
import struct

import numpy as np
import pytest
import trimesh

from surfsup.reference.job import particle_file, solver_scene, write_job


def test_the_solver_is_asked_for_what_the_paper_used():
    scene = solver_scene((1.0, 1.0, 2.0), (0.0, 0.0, -9.81), ["a.bgeo"], [(0.0, 0.0, 0.0)], "s.obj")
    settings = scene["Configuration"]
    assert settings["particleRadius"] == 0.015
    assert settings["timeStepSize"] == 0.001
    assert settings["cflMethod"] == 0
    assert settings["simulationMethod"] == 4
    assert settings["boundaryHandlingMethod"] == 2
    container, solid = scene["RigidBodies"]
    assert container["isWall"] and container["mapInvert"]
    assert container["translation"] == [0, 0, 1]
    assert container["mapResolution"] == [20, 20, 40]
    assert not solid["isWall"] and not solid["mapInvert"]


def test_every_block_has_a_file_and_a_velocity(tmp_path):
    blocks = [np.zeros((2, 3), np.float32), np.ones((3, 3), np.float32)]
    path = write_job(tmp_path, (1, 1, 1), (0, 0, -1), blocks, [(0, 0, 0), (1, 2, 3)], trimesh.creation.box())
    scene = json.loads(path.read_text())
    assert [model["initialVelocity"] for model in scene["FluidModels"]] == [[0, 0, 0], [1, 2, 3]]
    for model, block in zip(scene["FluidModels"], blocks, strict=True):
        assert (path.parent / model["particleFile"]).read_bytes() == particle_file(block)
    for body in scene["RigidBodies"]:
        assert (path.parent / body["geometryFile"]).exists()


def test_no_solid_no_second_body(tmp_path):
    path = write_job(tmp_path, (1, 1, 1), (0, 0, -1), [np.zeros((1, 3))], [(0, 0, 0)], None)
    assert len(json.loads(path.read_text())["RigidBodies"]) == 1


@pytest.mark.parametrize("count", [1, 5])
def test_the_particle_file_is_houdinis_format(count):
    positions = np.arange(3 * count, dtype=np.float32).reshape(-1, 3)
    data = particle_file(positions)
    assert data[:5] == b"BgeoV"
    assert struct.unpack(">2i", data[5:13]) == (5, count)
    points = np.frombuffer(data[41:-2], dtype=">f4").reshape(count, 4)
    np.testing.assert_array_equal(points[:, :3], positions)
    assert (points[:, 3] == 1).all()
    assert data[-2:] == b"\x00\xff"
