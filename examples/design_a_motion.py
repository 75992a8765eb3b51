"""Design a motion by gradient: how a piston must move so that the water it pushes ends up as far right as it can.

The piston may travel 6 cm in 40 frames. Its way in each eighth of the time is a parameter; gradients of the last frame
reach them through the poses (docs/moving-solids.md). Run: python examples/design_a_motion.py
"""

from itertools import pairwise

import torch

import surfsup as sf
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

SCENE = """
container: {size: [0.6, 0.2, 0.5]}
surfaces: {piston: {box: {size: [0.1, 0.2, 0.4]}, at: [-0.26, 0, 0.2], motion: {spin: {rate: 0}}}}
fluid: [{block: {min: [-0.18, -0.07, 0.02], max: [0.27, 0.07, 0.14]}}]
"""
FRAMES, PARTS, WAY = 40, 8, 0.06


def poses(ways: torch.Tensor) -> torch.Tensor:
    """The poses (FRAMES + 1, 7) of the piston: it goes the same distance in all frames of a part of the time."""
    x = -0.26 + torch.cat([ways.new_zeros(1), (ways.repeat_interleave(FRAMES // PARTS) * PARTS / FRAMES).cumsum(0)])
    still = torch.tensor([0.0, 0.2, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64).expand(len(x), 6)
    return torch.cat([x[:, None], still], dim=1)


def main() -> None:
    """Climb for 12 steps, and print what each gains."""
    scene = sf.Scene.from_yaml(SCENE, "piston")
    environment, solver = Environment.of(scene, None), DfsphSolver()
    moving = environment.moving
    assert moving is not None
    particles = scene.initial_particles(moving.solids.at_time(0.0))
    start = ParticleState(torch.from_numpy(particles.positions), torch.from_numpy(particles.velocities))

    def reached(weights: torch.Tensor) -> torch.Tensor:
        """Mean x of the water after the last frame, meters."""
        path, state = poses(WAY * weights.softmax(dim=0)), start
        for before, after in pairwise(path):
            motion = moving.between_tensors({"piston": torch.stack([before, after])})
            state, _ = solver.step(state, environment.moved(motion))
        return state.positions[:, 0].mean()

    weights = torch.zeros(PARTS, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.Adam([weights], lr=0.3)
    for number in range(13):
        optimizer.zero_grad()
        value = reached(weights)
        (-value).backward()
        ways = (1000 * WAY * weights.softmax(dim=0)).tolist()
        print(f"{number:2d}  mean x {1000 * value.item():7.2f} mm   ways in mm {[round(way, 1) for way in ways]}")
        optimizer.step()


if __name__ == "__main__":
    main()
