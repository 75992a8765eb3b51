"""Pour water on any surface: a fast SPH solver and learned simulators around signed distance functions.

Examples:
    >>> import surfsup as sf
    >>> ball = sf.Transformed(sf.Sphere(0.2), translation=(0, 0, 0.2))
    >>> scene = sf.Scene(surface=ball, fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
    >>> simulation = sf.Simulation(scene)
    >>> frame = simulation.step()
    >>> frame.positions.shape, frame.velocities.dtype
    ((125, 3), dtype('float32'))
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"

if TYPE_CHECKING:
    from surfsup import datasets, design
    from surfsup.errors import InputError, SimulationError
    from surfsup.evaluation.pair import evaluate_pair as evaluate
    from surfsup.exporting.export import export
    from surfsup.io.trajectory import Trajectory
    from surfsup.scene import Block, Container, Drain, Fill, Fluid, Liquid, ParticleFile, Scene, Tap, load_mesh
    from surfsup.scene.pose import Pose
    from surfsup.scene.wrench import Wrench
    from surfsup.sdf import (
        Bowl,
        Box,
        CappedCone,
        Cylinder,
        Difference,
        Funnel,
        Heightfield,
        Intersection,
        Sphere,
        Surface,
        Torus,
        Transformed,
        Union,
    )
    from surfsup.simulation import Simulation
    from surfsup.simulation_state import Frame, SimulationState
    from surfsup.viewing.notebook import show
    from surfsup.worlds import Worlds

# The public names and their modules, which are imported when a name is first used: `import surfsup` alone is fast.
_MODULES = {
    "InputError": "errors",
    "SimulationError": "errors",
    "Trajectory": "io.trajectory",
    "export": "exporting.export",
    **dict.fromkeys(
        ("Block", "Container", "Drain", "Fill", "Fluid", "Liquid", "ParticleFile", "Scene", "Tap", "load_mesh"), "scene"
    ),
    "Pose": "scene.pose",
    "Wrench": "scene.wrench",
    **dict.fromkeys(("Bowl", "Box", "CappedCone", "Cylinder", "Difference", "Funnel", "Heightfield"), "sdf"),
    **dict.fromkeys(("Intersection", "Sphere", "Surface", "Torus", "Transformed", "Union"), "sdf"),
    "Simulation": "simulation",
    **dict.fromkeys(("Frame", "SimulationState"), "simulation_state"),
    "Worlds": "worlds",
    "show": "viewing.notebook",
}

__all__ = [
    "Block",
    "Bowl",
    "Box",
    "CappedCone",
    "Container",
    "Cylinder",
    "Difference",
    "Drain",
    "Fill",
    "Fluid",
    "Frame",
    "Funnel",
    "Heightfield",
    "InputError",
    "Intersection",
    "Liquid",
    "ParticleFile",
    "Pose",
    "Scene",
    "Simulation",
    "SimulationError",
    "SimulationState",
    "Sphere",
    "Surface",
    "Tap",
    "Torus",
    "Trajectory",
    "Transformed",
    "Union",
    "Worlds",
    "Wrench",
    "__version__",
    "datasets",
    "design",
    "evaluate",
    "export",
    "load_mesh",
    "show",
]


def __getattr__(name: str) -> object:
    """Import a public name from its module."""
    if name in ("datasets", "design"):
        return import_module(f"surfsup.{name}")
    if name == "evaluate":
        return import_module("surfsup.evaluation.pair").evaluate_pair
    if name not in _MODULES:
        raise AttributeError(f"module 'surfsup' has no attribute '{name}'")
    value = getattr(import_module(f"surfsup.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return __all__
