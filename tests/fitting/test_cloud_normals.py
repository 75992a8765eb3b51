"""Normals that cannot be normals are refused before the fit, and inward ones are said."""

import warnings

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.cloud_normals import CloudWarning, check_normals

RANDOM = np.random.default_rng(0)
TORUS = trimesh.creation.torus(0.5, 0.2)
POINTS, FACES = trimesh.sample.sample_surface(TORUS, 3000, seed=1)
NORMALS = TORUS.face_normals[FACES]


def check(vectors, points=POINTS):
    check_normals(np.asarray(points), np.asarray(vectors), "cloud.ply", "estimate them")


def refusal(vectors) -> str:
    with pytest.raises(InputError) as error:
        check(vectors)
    assert str(error.value).startswith("cloud.ply: ")
    assert str(error.value).endswith("estimate them")
    return str(error.value)


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e9])
def test_outward_normals_of_any_length_pass_with_some_noise(scale):
    noise = RANDOM.normal(0, 0.2, NORMALS.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(3 * (NORMALS + noise), scale * POINTS)


def test_inward_normals_are_said():
    with pytest.warns(CloudWarning, match="point inward as a whole, so the solid is everything around"):
        check(-NORMALS)


def test_random_directions_random_signs_and_colors_are_refused():
    assert "mean cosine to the normal of the points around is 0.5" in refusal(RANDOM.normal(size=NORMALS.shape))
    signs = RANDOM.choice([-1, 1], (len(NORMALS), 1))
    assert "of neighboring normals point to opposite sides" in refusal(signs * NORMALS)
    assert "as colors have" in refusal(RANDOM.uniform(0, 255, NORMALS.shape))
