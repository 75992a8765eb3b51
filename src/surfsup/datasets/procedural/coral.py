"""A branching coral with thin fingers, grown from a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from surfsup.datasets.procedural.sculpting import Clay

if TYPE_CHECKING:
    import trimesh

CELL = 0.015  # meters
STEP = 0.05  # meters that a branch grows at once
SEES = 0.45  # meters from which food attracts a branch
EATS = 0.125  # meters at which it is eaten, so how far fingers keep apart
TIP = 0.018  # meters: radius of the finest fingers
THICKEST = 0.055
BRANCHING = 2.6  # the radius of a branch to this power is the sum of those of its own branches
REACH = np.array([1.03, 1.03, 1.0])  # half axes of the dome that the food fills, meters
FOOD = 620


def coral(seed: int = 0) -> trimesh.Trimesh:
    """The coral as closed triangles in meters, about 1.9 across, standing on z = 0."""
    random = np.random.default_rng(seed)
    nodes, parents = grow(random)
    radii = thickness(parents)
    clay = Clay((-1.05, -1.05, 0.0), (1.05, 1.05, 1.5), CELL)
    foot(clay, random)
    for node, parent in enumerate(parents):
        if parent >= 0:
            clay.blob([tuple(nodes[parent]), tuple(nodes[node])], [radii[parent], radii[node]], blend=0.025)
    lower, upper = np.array([-1.1, -1.1, -0.1]), np.array([1.1, 1.1, 1.6])
    clay.carve(lambda x, y, z: 0.0025 * np.sin(95 * x) * np.sin(95 * y) * np.sin(95 * z), lower, upper)
    clay.cut(lambda x, y, z: z + 0 * x + 0 * y, lower, np.array([1.1, 1.1, 0.0]))
    return clay.mesh()


def grow(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Branches that grow towards food and eat it (Runions et al., "Modeling trees with space colonization", 2007).

    Returns:
        Places (N, 3) in meters, and for each the number of the one that it grew from (N,), -1 for the first.
    """
    food = random.normal(size=(FOOD, 3))
    food *= (random.uniform(0.05, 1.0, size=FOOD) ** 0.45 / np.linalg.norm(food, axis=1))[:, None]
    food[:, 2] = np.abs(food[:, 2])
    food = food * REACH + [0.0, 0.0, 0.32]
    nodes, parents = [np.array([0.0, 0.0, 0.0])], [-1]
    while nodes[-1][2] < 0.12:
        nodes.append(nodes[-1] + [0.0, 0.0, STEP])
        parents.append(len(nodes) - 2)
    while len(food):
        tree = cKDTree(np.array(nodes))
        distance, nearest = tree.query(food, distance_upper_bound=SEES)
        grown = []
        for node in np.unique(nearest[np.isfinite(distance)]):
            towards = food[nearest == node] - nodes[node]
            direction = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).sum(axis=0)
            direction = (
                direction / max(np.linalg.norm(direction), 1e-9) + random.normal(scale=0.12, size=3) + [0, 0, 0.2]
            )
            tip = nodes[node] + STEP * direction / np.linalg.norm(direction)
            if tree.query(tip)[0] > 0.7 * STEP:
                grown.append((tip, node))
        if not grown:
            break
        for tip, node in grown:
            nodes.append(tip)
            parents.append(int(node))
        food = food[cKDTree(np.array(nodes)).query(food)[0] > EATS]
    return np.array(nodes), np.array(parents)


def thickness(parents: np.ndarray) -> np.ndarray:
    """The radius (N,) of each place in meters: thin at the tips, thicker the more grows from it."""
    carried = np.zeros(len(parents))
    for node in range(len(parents) - 1, -1, -1):  # a branch comes after what it grew from
        carried[node] = max(carried[node], TIP**BRANCHING)
        if parents[node] >= 0:
            carried[parents[node]] += carried[node]
    return np.minimum(carried ** (1 / BRANCHING), THICKEST)


def foot(clay: Clay, random: np.random.Generator) -> None:
    """The rock that the coral stands on: a heap of boulders."""
    clay.ball((0.0, 0.0, 0.0), (0.3, 0.28, 0.16))
    for angle in 2.4 * np.arange(26):  # the golden angle, so that none hides another
        away = 0.36 * np.sqrt(angle / 62.4)
        center = (away * np.cos(angle), away * np.sin(angle), random.uniform(0.0, 0.14) * (1 - away / 0.4))
        clay.ball(center, tuple(random.uniform(0.06, 0.12, size=3)), blend=0.03)
