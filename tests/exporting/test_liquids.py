"""Several liquids: the number of each particle's in every format that has particles, and a surface for each."""

import ast
import io
from dataclasses import replace

import numpy as np
import pytest
import pyvista
import trimesh

from surfsup.errors import InputError
from surfsup.exporting import bgeo, legacy_vtk, npz, ply, vtu
from surfsup.exporting.export import export
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.scene.liquid import LIQUIDS
from surfsup.simulation import Simulation
from surfsup.viewing.liquid_look import DISPLAY_COLOR
from tests.exporting.conftest import cloud
from tests.exporting.test_bgeo import read as read_bgeo
from tests.exporting.test_ply import elements

FRAME = replace(cloud(30), liquids=np.arange(30, dtype=np.int32) % 3)


def test_ply_bgeo_and_npz_have_the_liquid():
    np.testing.assert_array_equal(elements(ply.particles(FRAME))["liquid"], FRAME.liquids)
    np.testing.assert_array_equal(read_bgeo(bgeo.particles(FRAME))["liquid"].ravel(), FRAME.liquids)
    np.testing.assert_array_equal(np.load(io.BytesIO(npz.particles(FRAME)))["liquids"], FRAME.liquids)


@pytest.mark.parametrize(("form", "suffix"), [(legacy_vtk, ".vtk"), (vtu, ".vtu")])
def test_vtk_has_the_liquid(form, suffix, tmp_path):
    path = tmp_path / f"frame{suffix}"
    path.write_bytes(form.particles(FRAME))
    np.testing.assert_array_equal(pyvista.read(path).point_data["liquid"], FRAME.liquids)


def test_usd_has_the_liquid_as_a_primvar(tmp_path):
    pxr = pytest.importorskip("pxr", reason="needs the extra 'export'")
    from pxr import Usd, UsdGeom

    from surfsup.exporting.usd import UsdWriter

    assert pxr is not None
    colors = ((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.7, 0.8, 0.9))
    writer = UsdWriter(tmp_path / "water.usdc", 24, "z", overwrite=False, colors=colors)
    writer.particles(FRAME)
    writer.finish()
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    points = stage.GetPrimAtPath("/Water/Particles")
    np.testing.assert_array_equal(UsdGeom.PrimvarsAPI(points).GetPrimvar("liquid").Get(1), FRAME.liquids)
    shown = UsdGeom.Points(points).GetDisplayColorAttr().Get(1)
    np.testing.assert_allclose(shown, np.float32(colors)[FRAME.liquids])


@pytest.fixture(scope="module")
def two_liquids(tmp_path_factory):
    """A frame of a block of water, with oil 0.5 m beside it from the second frame on."""
    scene = Scene.from_yaml(
        "fluid:\n- block: {min: [-0.3, -0.1, 0.1], max: [-0.1, 0.1, 0.3]}\n"
        "- {block: {min: [0.2, -0.1, 0.1], max: [0.4, 0.1, 0.3]}, liquid: oil}\nframes: 2",
        "test",
    )
    start = Simulation(scene).frame
    still, path = np.zeros_like(start.positions), tmp_path_factory.mktemp("liquids") / "trajectory.h5"
    with TrajectoryWriter(path, scene, Provenance("test"), len(still)) as writer:
        water = start.ids[start.liquids == 0]
        writer.append(start.positions[water], still[water], ids=water, liquids=start.liquids[water])
        writer.append(start.positions, still, ids=start.ids, liquids=start.liquids)
    return path


def test_each_liquid_has_a_surface_which_is_empty_before_the_liquid_comes(two_liquids, tmp_path):
    done = export(two_liquids, "ply", tmp_path, fps=200, what="surface")
    assert [file.name for file in done.files] == ["surface-0.0001.ply", "surface-1.0001.ply"]
    empty, water, oil = (trimesh.load(tmp_path / f"surface-{name}.ply") for name in ("1.0001", "0.0002", "1.0002"))
    assert empty.is_empty
    np.testing.assert_allclose(water.centroid, [-0.2, 0, 0.2], atol=0.02)
    np.testing.assert_allclose(oil.centroid, [0.3, 0, 0.2], atol=0.02)
    assert water.is_watertight and oil.is_watertight


def test_an_older_export_of_several_surfaces_is_replaced_as_a_whole(two_liquids, tmp_path):
    export(two_liquids, "obj", tmp_path, fps=200)
    with pytest.raises(InputError, match=r"surface-0\.0001\.obj: exists already"):
        export(two_liquids, "obj", tmp_path, fps=200)
    export(two_liquids, "obj", tmp_path, fps=150, overwrite=True)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["surface-0.0001.obj", "surface-1.0001.obj"]


def test_usd_has_a_mesh_for_each_liquid_in_its_color(two_liquids, tmp_path):
    pytest.importorskip("pxr", reason="needs the extra 'export'")
    from pxr import Usd, UsdGeom

    export(two_liquids, "usd", tmp_path, fps=200)
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    water, oil = (UsdGeom.Mesh(stage.GetPrimAtPath(f"/Water/Surface_{number}")) for number in (0, 1))
    assert not stage.GetPrimAtPath("/Water/Surface")
    assert len(oil.GetPointsAttr().Get(1)) == 0 < len(oil.GetPointsAttr().Get(2))
    np.testing.assert_allclose(np.mean(water.GetExtentAttr().Get(2), axis=0), [-0.2, 0, 0.2], atol=0.02)
    np.testing.assert_allclose(water.GetDisplayColorAttr().Get()[0], DISPLAY_COLOR)
    np.testing.assert_allclose(oil.GetDisplayColorAttr().Get()[0], np.power(LIQUIDS["oil"].color, 2.2), atol=1e-4)


def test_the_script_for_blender_tints_each_liquid(two_liquids, tmp_path):
    pytest.importorskip("pxr", reason="needs the extra 'export'")
    export(two_liquids, "blender", tmp_path, fps=200)
    script = (tmp_path / "open_in_blender.py").read_text()
    tints = next(line for line in script.splitlines() if line.startswith("TINTS = ")).partition("  #")[0]
    tint = ast.literal_eval(tints.removeprefix("TINTS = "))
    assert list(tint) == ["Surface_0", "Surface_1"] and tint["Surface_0"] == (0.6, 0.85, 1.0)
    assert tint["Surface_1"][0] == 1.0 > tint["Surface_1"][1] > tint["Surface_1"][2]
