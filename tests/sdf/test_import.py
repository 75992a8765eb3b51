"""Importing the package loads torch, and none of the heavy mesh libraries."""

import subprocess
import sys


def test_importing_sdf_loads_neither_libigl_nor_trimesh_nor_scipy():
    code = "import sys, surfsup.sdf; print([m for m in ('igl', 'trimesh', 'scipy') if m in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"
