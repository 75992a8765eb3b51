"""Three balls that deflect falling water towards a target:  python examples/deflectors.py"""

import torch

from surfsup import Scene, Sphere, Surface, Transformed, Union
from surfsup.design import Outcome, Parameter, Task, optimize, verify

SCENE = "fluid: [{block: {min: [-0.15, -0.15, 0.55], max: [0.15, 0.15, 0.7]}}]\nframes: 81"
CENTERS = [[-0.05, 0.0, 0.4], [0.0, 0.12, 0.3], [0.0, -0.12, 0.3]]  # meters


def balls(centers: torch.Tensor) -> Surface:
    """Balls of radius 0.08 m at ``centers`` (3, 3), meters."""
    return Union(*(Transformed(Sphere(0.08), translation=center) for center in centers))


def reward(end: Outcome) -> torch.Tensor:
    """Minus the mean squared horizontal distance from the target, m²."""
    return -(end.positions[:, :2] - torch.tensor([0.25, 0.0])).square().sum(dim=-1).mean()


centers = Parameter(CENTERS, lower=[-0.3, -0.3, 0.15], upper=[0.3, 0.3, 0.42], step=0.03, unit="m")
task = Task("deflectors", balls, {"centers": centers}, Scene.from_yaml(SCENE, "scene"), reward, floor=0.06)
if __name__ == "__main__":
    run = optimize(task, "out/deflectors", iterations=60, resume=True)
    best = run.designs[run.best]["centers"].tolist()
    print(f"reward {run.rewards[0]:.4f} -> {run.rewards[run.best]:.4f} with balls at {best}")
    print(verify(run).text())
