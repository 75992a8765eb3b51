"""USD files, read by Pixar's library."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.exporting.export import export
from surfsup.io.trajectory import Trajectory
from tests.exporting.test_export import COARSE, names, no_file_above

pytest.importorskip("pxr", reason="needs the extra 'export'")
from pxr import Usd, UsdGeom

from surfsup.exporting.usd import UsdWriter
from tests.exporting.conftest import cloud, tetrahedron


def prim(stage, name):
    return stage.GetPrimAtPath(f"/Water/{name}")


def test_units_axis_and_rate_are_in_the_file(trajectory, tmp_path):
    done = export(trajectory, "usd", tmp_path, fps=25, what="particles")
    assert done.files == (tmp_path / "water.usdc",)
    stage = Usd.Stage.Open(str(done.files[0]))
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1.0, "Z")
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (25, 1, 8)
    assert stage.GetDefaultPrim().GetPath() == "/Water"


def test_particles_are_those_of_the_trajectory(trajectory, tmp_path):
    export(trajectory, "usd", tmp_path, fps=25, what="particles")
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    points = UsdGeom.Points(prim(stage, "Particles"))
    assert points.GetPointsAttr().GetTimeSamples() == list(range(1, 9))
    with Trajectory(trajectory) as file:
        for code in (1, 4, 8):
            frame = 8 * (code - 1)
            np.testing.assert_array_equal(points.GetPointsAttr().Get(code), file.positions[frame])
            np.testing.assert_array_equal(points.GetVelocitiesAttr().Get(code), file.velocities[frame])
        count = file.positions.shape[1]
    np.testing.assert_array_equal(points.GetIdsAttr().Get(1), np.arange(count))
    np.testing.assert_allclose(points.GetWidthsAttr().Get(1), np.full(count, 0.03))


def test_velocity_is_displacement_a_second(trajectory, tmp_path):
    """The positions that USD extrapolates from the velocities are those of the next frame, in free fall nearly."""
    export(trajectory, "usd", tmp_path, fps=200, what="particles")
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    points = UsdGeom.Points(prim(stage, "Particles"))
    extrapolated = np.array(points.ComputePointsAtTime(Usd.TimeCode(3.5), Usd.TimeCode(3)))
    ends = (np.array(points.GetPointsAttr().Get(code)) for code in (3, 4))
    np.testing.assert_allclose(extrapolated, sum(ends) / 2, atol=2e-4)


def test_y_is_up_on_request(trajectory, tmp_path):
    for up in ("z", "y"):
        export(trajectory, "usd", tmp_path / up, fps=10, what="particles", up=up)
    z, y = (Usd.Stage.Open(str(tmp_path / up / "water.usdc")) for up in ("z", "y"))
    assert UsdGeom.GetStageUpAxis(y) == "Y"
    at_z, at_y = (np.array(UsdGeom.Points(prim(stage, "Particles")).GetPointsAttr().Get(2)) for stage in (z, y))
    np.testing.assert_array_equal(at_y, np.stack([at_z[:, 0], at_z[:, 2], -at_z[:, 1]], axis=1))


def test_the_surface_is_a_mesh_of_its_own_in_every_frame_and_the_solid_is_one(trajectory, tmp_path):
    export(trajectory, "usd", tmp_path, fps=20, reconstruction=COARSE)
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    surface, solid = (UsdGeom.Mesh(prim(stage, name)) for name in ("Surface", "Solid"))
    for code in (1, 6):
        points, normals = (np.array(get(code)) for get in (surface.GetPointsAttr().Get, surface.GetNormalsAttr().Get))
        corners = np.array(surface.GetFaceVertexIndicesAttr().Get(code)).reshape(-1, 3)
        assert len(points) == len(normals) == len(surface.GetVelocitiesAttr().Get(code))
        assert len(surface.GetFaceVertexCountsAttr().Get(code)) == len(corners)
        a, b, c = (points[corners[:, k]] for k in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # the volume: triangles turn outwards
        lower, upper = surface.GetExtentAttr().Get(code)
        np.testing.assert_array_equal([lower, upper], [points.min(axis=0), points.max(axis=0)])
    assert surface.GetSubdivisionSchemeAttr().Get() == "none"
    assert not solid.GetPointsAttr().GetTimeSamples()
    distance = np.linalg.norm(np.array(solid.GetPointsAttr().Get()) - [0, 0, 0.2], axis=1)
    np.testing.assert_allclose(distance, 0.2, atol=1e-3)


def test_the_number_of_particles_and_triangles_may_change(tmp_path):
    writer = UsdWriter(tmp_path / "water.usdc", 24, "z", overwrite=False)
    for count in (3, 0, 20):
        writer.particles(cloud(count, count))
        writer.surface(tetrahedron())
    writer.finish()
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    points = UsdGeom.Points(prim(stage, "Particles"))
    for code, count in ((1, 3), (2, 0), (3, 20)):
        positions = np.array(points.GetPointsAttr().Get(code)).reshape(-1, 3)
        np.testing.assert_array_equal(positions, cloud(count, count).positions)
        np.testing.assert_array_equal(points.GetIdsAttr().Get(code), cloud(count, count).ids)


def test_an_existing_file_stays_unless_it_may_be_overwritten(trajectory, tmp_path):
    export(trajectory, "usd", tmp_path, fps=10, what="particles")
    before = (tmp_path / "water.usdc").read_bytes()
    with pytest.raises(InputError, match=r"exists already; .* --overwrite"):
        export(trajectory, "usd", tmp_path, fps=25, what="particles")
    assert (tmp_path / "water.usdc").read_bytes() == before
    assert export(trajectory, "usd", tmp_path, fps=25, what="particles", overwrite=True).frames == 8
    assert names(tmp_path) == ["water.usdc"]


def test_a_full_disk_leaves_no_incomplete_file(trajectory, tmp_path):
    with no_file_above(20_000), pytest.raises(InputError, match=r"water.usdc: cannot be written"):
        export(trajectory, "usd", tmp_path, fps=200, what="particles")
    assert names(tmp_path) == []


def test_an_interrupt_leaves_no_incomplete_file_and_a_later_export_succeeds(trajectory, tmp_path):
    def interrupt(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(trajectory, "usd", tmp_path, fps=10, what="particles", progress=interrupt)
    assert names(tmp_path) == []
    assert export(trajectory, "usd", tmp_path, fps=10, what="particles").frames == 4
