"""Genesis' DFSPH on the CPU for ``benchmarks/jug.py``: the same water in the same box, the jug a mesh that stands.

Its time step is the solver's (five to a frame), its tolerances are its own, and so is its viscosity's form.
"""

import sys
import tempfile
from pathlib import Path

import genesis
import numpy as np
import trimesh
from report import report

SUBSTEPS = 5  # a frame
given = np.load(sys.argv[1])
size = given["container"]
genesis.init(backend=genesis.cpu, logging_level="error")
scene = genesis.Scene(
    sim_options=genesis.options.SimOptions(dt=float(given["frame_time"]), substeps=SUBSTEPS),
    sph_options=genesis.options.SPHOptions(
        particle_size=2 * float(given["particle_radius"]),
        pressure_solver="DFSPH",
        lower_bound=(-size[0] / 2, -size[1] / 2, 0),
        upper_bound=(size[0] / 2, size[1] / 2, size[2]),
    ),
    show_viewer=False,
)
count = len(given["positions"])
# Its stable step shrinks with the viscosity: this is the largest, but for a tenth, that it says is stable.
support, step = 4 * float(given["particle_radius"]), float(given["frame_time"]) / SUBSTEPS
liquid = scene.add_entity(
    morph=genesis.morphs.Nowhere(n_particles=count),
    material=genesis.materials.SPH.Liquid(mu=min(0.005, 0.9 * 0.01 * support**2 / step), gamma=0.0),
)
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "jug.obj"
    trimesh.Trimesh(given["vertices"], given["faces"], process=False).export(file)
    scene.add_entity(
        morph=genesis.morphs.Mesh(
            file=str(file), fixed=True, convexify=False, decimate=False, watertighten=None, align=False
        ),
        material=genesis.materials.Rigid(coup_friction=0.0, sdf_cell_size=0.005, sdf_max_res=128),
    )
    scene.build()
liquid.active = True
liquid.set_particles_active(genesis.ACTIVE)  # as its emitters do; activate() fails in version 1.4
liquid.set_particles_pos(given["positions"])
liquid.set_particles_vel(given["velocities"])


def positions() -> np.ndarray:
    """Of the particles."""
    return liquid.get_particles_pos().cpu().numpy().reshape(-1, 3).astype(np.float64)


report(scene.step, positions, f"Genesis {genesis.__version__}")
