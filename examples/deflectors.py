"""Three balls, placed so that falling water lands around a target:  python examples/deflectors.py"""

import torch

from surfsup.design import Outcome, Parameter, Task, optimize, prove
from surfsup.scene import Scene
from surfsup.sdf import Sphere, Surface, Transformed, Union

SCENE = "fluid: [{block: {min: [-0.15, -0.15, 0.55], max: [0.15, 0.15, 0.7]}}]\nframes: 81"
PLACES = [[-0.05, 0.0, 0.4], [0.0, 0.12, 0.3], [0.0, -0.12, 0.3]]  # meters


def balls(places: torch.Tensor) -> Surface:
    """Balls of 0.08 m at ``places`` (3, 3), meters."""
    return Union(*(Transformed(Sphere(0.08), translation=place) for place in places))


def reward(end: Outcome) -> torch.Tensor:
    """Minus the mean squared distance from the target, m²."""
    return -(end.positions[:, :2] - torch.tensor([0.25, 0.0])).square().sum(dim=-1).mean()


places = Parameter(PLACES, lower=[-0.3, -0.3, 0.15], upper=[0.3, 0.3, 0.42], step=0.03)
task = Task("deflectors", balls, {"places": places}, Scene.from_yaml(SCENE, "scene"), reward, floor=0.06)
if __name__ == "__main__":
    run = optimize(task, "out/deflectors", iterations=60, resume=True)
    best = run.designs[run.best]["places"].tolist()
    print(f"{run.rewards[0]:.4f} became {run.rewards[run.best]:.4f} with balls at {best}")
    print(prove(run, tell=lambda done, total: None).text())
