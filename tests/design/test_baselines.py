from itertools import islice

import numpy as np
import pytest
import torch

from surfsup.design import bowl, funnel
from surfsup.design.baselines import UNDEFINED, UnitCube, cma_es, random_search, simulation_score


def test_the_unit_cube_maps_to_the_bounds_and_back():
    cube = UnitCube(bowl())
    point = cube.to_point({"r1": torch.tensor(0.07), "r2": torch.tensor(0.05)})
    values = {name: float(value) for name, value in cube.to_values(point).items()}
    assert values == pytest.approx({"r1": 0.07, "r2": 0.05}, rel=1e-4)
    assert float(cube.to_values(np.array([0.0, 1.0]))["r2"]) == pytest.approx(0.8 * 0.06)


@pytest.mark.parametrize("search", [cma_es, random_search])
def test_a_search_finds_the_maximum(search):
    def score(values):
        return -float((values["r1"] - 0.2) ** 2 + values["r2"] ** 2)

    evaluations = list(islice(search(bowl(), score, 0), 120))
    assert len(evaluations) == 120
    assert max(reward for _, reward in evaluations) > -1e-3


def test_a_design_without_a_reward_scores_worst(simulator):
    score = simulation_score(funnel(frames=3), simulator)
    assert score({"r1": torch.tensor(0.1), "r2": torch.tensor(0.09)}) == UNDEFINED
