"""Newton's implicit MPM on the CPU for ``benchmarks/jug.py``: the same water and box, the jug a mesh that stands.

Settings are those of its own example of a water dam break but for lengths: eight particles to a cell, one step a frame.
"""

import sys

import newton
import numpy as np
import warp
from newton.solvers import SolverImplicitMPM
from report import report

given = np.load(sys.argv[1])
radius, size, step = float(given["particle_radius"]), given["container"], float(given["frame_time"])
count = len(given["positions"])
warp.config.quiet = True
warp.set_device("cpu")
builder = newton.ModelBuilder()
SolverImplicitMPM.register_custom_attributes(builder)
builder.add_particles(
    pos=[warp.vec3(*row) for row in given["positions"].tolist()],
    vel=[warp.vec3(*row) for row in given["velocities"].tolist()],
    mass=[1000 * 0.8 * (2 * radius) ** 3] * count,
    radius=[radius] * count,
)
smooth = newton.ModelBuilder.ShapeConfig(density=0.0, mu=0.0)
jug = newton.Mesh(given["vertices"], given["faces"].ravel(), compute_inertia=False, is_solid=False)
builder.add_shape_mesh(body=-1, mesh=jug, cfg=smooth)
builder.add_ground_plane(cfg=smooth)
for axis in (0, 1):
    for side in (-1.0, 1.0):
        normal = [0.0, 0.0, 0.0]
        normal[axis] = -side
        builder.add_shape_plane(plane=(*normal, float(size[axis]) / 2), body=-1, cfg=smooth)
model = builder.finalize()
model.set_gravity((0.0, 0.0, -9.81))
model.mpm.friction.fill_(0.0)
model.mpm.tensile_yield_ratio.fill_(1.0)
model.mpm.viscosity.fill_(0.0)
config = SolverImplicitMPM.Config()
config.voxel_size = 4 * radius
config.max_iterations, config.tolerance = 50, 1e-3
config.warmstart_mode, config.strain_basis, config.collider_basis, config.velocity_basis = (
    "particles",
    "P0",
    "pic",
    "Q1",
)
solver = SolverImplicitMPM(model, config=config)
states = [model.state(), model.state()]
states[0].mpm.particle_Jp.fill_(1.0)


def frame() -> None:
    """One step, and particles moved out of solids."""
    solver.step(states[0], states[1], None, None, step)
    solver.project_outside(states[1], states[1], step)
    states.reverse()


def positions() -> np.ndarray:
    """Of the particles."""
    return np.asarray(states[0].particle_q.numpy(), np.float64)


report(frame, positions, f"Newton {newton.__version__}, Warp {warp.__version__}")
