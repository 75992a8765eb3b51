"""The command of splashsurf reads the particles and their velocities in every format that it knows."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import pyvista

from surfsup.exporting.formats import FORMATS
from tests.exporting.conftest import cloud

COMMAND = "from pysplashsurf import run_pysplashsurf; run_pysplashsurf()"
VELOCITY = np.float32([1, -2, 3])


@pytest.mark.parametrize(
    ("name", "attribute"), [("vtk", "velocity"), ("vtu", "velocity"), ("bgeo", "v"), ("ply", None)]
)
def test_splashsurf_makes_a_surface_around_the_particles(name, attribute, tmp_path):
    frame = cloud(500)
    frame = replace(frame, velocities=np.tile(VELOCITY, (500, 1)))
    form = FORMATS[name]
    particles, surface = tmp_path / f"particles{form.suffix}", tmp_path / "surface.vtk"
    particles.write_bytes(form.load("particles")(frame))
    options = ["--particle-radius", "0.015", "--smoothing-length", "2", "--cube-size", "1", "--num-threads", "1"]
    options += ["--interpolate_attribute", attribute] if attribute else []
    command = [sys.executable, "-c", COMMAND, "reconstruct", particles, "--output-file", surface, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    mesh = pyvista.read(surface)
    lower, upper = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose(lower, frame.positions.min(axis=0), atol=0.04)
    np.testing.assert_allclose(upper, frame.positions.max(axis=0), atol=0.04)
    if attribute:
        np.testing.assert_allclose(mesh.point_data[attribute], np.tile(VELOCITY, (mesh.n_points, 1)), rtol=1e-4)
