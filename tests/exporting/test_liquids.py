"""The liquid of each particle, in every format that has particles."""

import io
from dataclasses import replace

import numpy as np
import pytest
import pyvista

from surfsup.exporting import bgeo, legacy_vtk, npz, ply, vtu
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
    writer = UsdWriter(tmp_path / "water.usdc", 24, "z", overwrite=False)
    writer.particles(FRAME)
    writer.finish()
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    points = stage.GetPrimAtPath("/Water/Particles")
    np.testing.assert_array_equal(UsdGeom.PrimvarsAPI(points).GetPrimvar("liquid").Get(1), FRAME.liquids)
