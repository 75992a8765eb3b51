"""What the page of a trajectory imports; its content is tested beside its features."""

import subprocess
import sys


def test_a_simulation_with_a_page_imports_nothing_that_only_pictures_need():
    code = (
        "import sys, surfsup.simulation, surfsup.continuation, surfsup.viewing.trajectory_page; "
        "print([m for m in ('av', 'pyvista', 'vtkmodules', 'igl', 'warp', 'pandas') if m in sys.modules])"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"
