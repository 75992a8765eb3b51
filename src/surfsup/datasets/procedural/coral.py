"""A branching coral with thin fingers, new_nodes by space colonization."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from surfsup.datasets.procedural.sculpting import SculptureGrid

if TYPE_CHECKING:
    import trimesh

CELL = 0.015  # meters
STEP = 0.05  # meters that a branch grows per step
ATTRACTION_RADIUS = 0.45  # meters within which an attractor affects a branch
KILL_RADIUS = 0.125  # meters at which an attractor is removed: the distance between fingers
TIP_RADIUS = 0.018  # meters: radius of the finest fingers
MAX_RADIUS = 0.055
BRANCHING_EXPONENT = 2.6  # the radius of a branch to this power is the sum over its child branches
HALF_AXES = np.array([1.03, 1.03, 1.0])  # of the dome of attractors, meters
ATTRACTORS = 620


def coral(seed: int = 0) -> trimesh.Trimesh:
    """The coral as closed triangles in meters, about 1.9 across, standing on z = 0."""
    random = np.random.default_rng(seed)
    nodes, parents = grow(random)
    radii = branch_radii(parents)
    sculpture = SculptureGrid((-1.05, -1.05, 0.0), (1.05, 1.05, 1.5), CELL)
    foot(sculpture, random)
    for node, parent in enumerate(parents):
        if parent >= 0:
            sculpture.add_tube([tuple(nodes[parent]), tuple(nodes[node])], [radii[parent], radii[node]], blend=0.025)
    lower, upper = np.array([-1.1, -1.1, -0.1]), np.array([1.1, 1.1, 1.6])
    sculpture.displace(lambda x, y, z: 0.0025 * np.sin(95 * x) * np.sin(95 * y) * np.sin(95 * z), lower, upper)
    sculpture.subtract(lambda x, y, z: z + 0 * x + 0 * y, lower, np.array([1.1, 1.1, 0.0]))
    return sculpture.to_mesh()


def grow(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Grow branches towards attractors (Runions et al., "Modeling trees with a space colonization algorithm", 2007).

    Returns:
        Nodes (N, 3) in meters, and the index (N,) of each node's parent, -1 for the first.
    """
    attractors = random.normal(size=(ATTRACTORS, 3))
    attractors *= (random.uniform(0.05, 1.0, size=ATTRACTORS) ** 0.45 / np.linalg.norm(attractors, axis=1))[:, None]
    attractors[:, 2] = np.abs(attractors[:, 2])
    attractors = attractors * HALF_AXES + [0.0, 0.0, 0.32]
    nodes, parents = [np.array([0.0, 0.0, 0.0])], [-1]
    while nodes[-1][2] < 0.12:
        nodes.append(nodes[-1] + [0.0, 0.0, STEP])
        parents.append(len(nodes) - 2)
    while len(attractors):
        tree = cKDTree(np.array(nodes))
        found = tree.query(attractors, distance_upper_bound=ATTRACTION_RADIUS)
        distance, nearest = np.asarray(found[0]), np.asarray(found[1])
        new_nodes = []
        for node in np.unique(nearest[np.isfinite(distance)]):
            towards = attractors[nearest == node] - nodes[node]
            direction = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).sum(axis=0)
            direction = (
                direction / max(np.linalg.norm(direction), 1e-9) + random.normal(scale=0.12, size=3) + [0, 0, 0.2]
            )
            tip = nodes[node] + STEP * direction / np.linalg.norm(direction)
            if tree.query(tip)[0] > 0.7 * STEP:
                new_nodes.append((tip, node))
        if not new_nodes:
            break
        for tip, node in new_nodes:
            nodes.append(tip)
            parents.append(int(node))
        attractors = attractors[cKDTree(np.array(nodes)).query(attractors)[0] > KILL_RADIUS]
    return np.array(nodes), np.array(parents)


def branch_radii(parents: np.ndarray) -> np.ndarray:
    """The radius (N,) at each node in meters: thin at the tips, thicker with more branches above."""
    total = np.zeros(len(parents))
    for node in range(len(parents) - 1, -1, -1):  # children come after their parents
        total[node] = max(total[node], TIP_RADIUS**BRANCHING_EXPONENT)
        if parents[node] >= 0:
            total[parents[node]] += total[node]
    return np.minimum(total ** (1 / BRANCHING_EXPONENT), MAX_RADIUS)


def foot(sculpture: SculptureGrid, random: np.random.Generator) -> None:
    """The rock below the coral: a heap of boulders."""
    sculpture.add_ellipsoid((0.0, 0.0, 0.0), (0.3, 0.28, 0.16))
    for angle in 2.4 * np.arange(26):  # the golden angle spreads the boulders
        away = 0.36 * np.sqrt(angle / 62.4)
        center = (away * np.cos(angle), away * np.sin(angle), random.uniform(0.0, 0.14) * (1 - away / 0.4))
        sculpture.add_ellipsoid(center, tuple(random.uniform(0.06, 0.12, size=3)), blend=0.03)
