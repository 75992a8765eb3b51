"""Small scenes and simulators that the tests share."""

import torch

from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.sdf import Sphere, Surface, Transformed
from surfsup.sph.environment import Environment

MESSAGE_PASSING = [name for name, kind in LEARNED_SIMULATORS.items() if issubclass(kind, MessagePassingSimulator)]
GRAVITY = torch.tensor([0.0, 0.0, -9.81])
SIZES = {"width": 8, "layers": 2, "radius": 0.1}


def make_simulator(kind: str, seed: int = 0, dtype=torch.float32, **sizes) -> MessagePassingSimulator:
    torch.manual_seed(seed)
    simulator = LEARNED_SIMULATORS[kind]
    few = {"surface_particles": 150} if kind == "gns" else {}
    return simulator(simulator.architecture_type(**{**SIZES, **few, **sizes})).to(dtype)


def ball(dtype=torch.float32) -> Surface:
    return Transformed(Sphere(0.25), None, (0.1, 0.05, 0.25)).to(dtype)


def make_environment(surface: Surface | None = None, dtype=torch.float32) -> Environment:
    lower, upper = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
    return Environment(surface, lower.to(dtype), upper.to(dtype), GRAVITY.to(dtype))


def water(count: int = 40, seed: int = 0, dtype=torch.float32, low: float = 0.52) -> History:
    """Particles just above the ball, each with displacements of its own."""
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype) * 0.2 + torch.tensor([0, 0, low], dtype=dtype)
    velocities = torch.randn(count, 3, generator=random, dtype=dtype)
    displacements = 0.003 * torch.randn(count, HISTORY_LENGTH, 3, generator=random, dtype=dtype)
    return History(positions, velocities, displacements)
