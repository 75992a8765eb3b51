import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.fitting.exact import ExactSolid
from surfsup.fitting.fit import config_of
from surfsup.fitting.loop import Diverged, run
from surfsup.fitting.point_cloud import PointCloud
from surfsup.fitting.siren_fit import SirenConfig, SirenFit, SirenTarget
from surfsup.fitting.siren_result import errors_of
from surfsup.sdf import Sphere
from tests.fitting.conftest import SMALL


def fit_of(target, folder, **options):
    return SirenFit(SirenConfig(**{**SMALL, "learning_rate": 2e-3, **options}), target, folder)


def test_the_published_weights_are_the_defaults():
    config = SirenConfig()
    assert (config.surface, config.normal, config.eikonal, config.off_surface) == (3000, 100, 50, 100)


def test_a_sphere_is_fitted_in_seconds(ball_siren):
    errors = errors_of(ball_siren, ball_siren.to_mesh(64), ExactSolid(Sphere(0.25)), seed=0)
    assert errors.distance < 0.01
    assert errors.angle_on_surface < 4
    assert errors.chamfer < 0.04  # two draws of the points on one sphere are 0.02 apart
    assert errors.parts == 1
    assert "degrees" in errors.text()


def test_the_input_is_scaled_into_the_cube_of_side_2(ball_target):
    assert ball_target.cube.scale == pytest.approx(4)
    radius = torch.linalg.vector_norm(ball_target.surface.points, dim=-1)
    torch.testing.assert_close(radius, torch.ones_like(radius), atol=3e-3, rtol=0)


def test_the_same_seed_gives_the_same_weights_and_going_on_is_as_if_it_had_not_stopped(ball_target, tmp_path):
    straight = fit_of(ball_target, tmp_path / "straight", steps=12, judge_every=4)
    run(straight)
    halted = fit_of(ball_target, tmp_path / "halted", steps=12, judge_every=4)
    run(halted, stop=lambda: halted.step == 6)
    resumed = fit_of(ball_target, tmp_path / "halted", steps=12, judge_every=4)
    resumed.resume()
    assert resumed.step == 6
    run(resumed)
    for one, other in zip(straight.network.parameters(), resumed.network.parameters(), strict=True):
        assert torch.equal(one, other)


def test_another_fit_is_not_gone_on_with(ball_target, tmp_path):
    run(fit_of(ball_target, tmp_path, steps=2))
    with pytest.raises(InputError, match="belongs to a fit with other options"):
        fit_of(ball_target, tmp_path, steps=3, learning_rate=1e-4).resume()


def test_a_fit_that_is_done_goes_on_when_more_steps_are_asked_for(ball_target, tmp_path):
    run(fit_of(ball_target, tmp_path, steps=4))
    longer = fit_of(ball_target, tmp_path, steps=6)
    longer.resume()
    run(longer)
    assert longer.step == 6


def test_a_fit_that_diverges_stops_says_so_and_keeps_the_best(ball_target, tmp_path):
    fit = fit_of(ball_target, tmp_path, steps=400, learning_rate=1e-3, judge_every=10)
    run(fit, stop=lambda: fit.step == 60)
    least, best = fit.least, {name: value.clone() for name, value in fit.best.items()}
    fit.config = fit.config.model_copy(update={"learning_rate": 30.0, "clip": 1e9, "averaging": 0.0})
    with pytest.raises(Diverged, match=r"diverged at step \d+ .*is kept; start again with a lower learning_rate="):
        run(fit)
    assert fit.least <= least
    assert all(torch.isfinite(value).all() for value in fit.best.values())
    assert best.keys() == fit.best.keys()


def test_a_loss_that_is_no_number_changes_no_weight(ball_target, tmp_path):
    fit = fit_of(ball_target, tmp_path)
    fit.take_step()
    before = [parameter.detach().clone() for parameter in fit.network.parameters()]
    fit.options = fit.options.model_copy(update={"surface": float("nan")})
    with pytest.raises(Diverged, match="nothing had been measured before"):
        run(fit)
    assert all(torch.equal(one, two) for one, two in zip(before, fit.network.parameters(), strict=True))


def test_a_cloud_has_no_distances_and_is_fitted_by_the_published_loss_alone(tmp_path):
    normals = np.random.default_rng(0).normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    target = SirenTarget.of_cloud(PointCloud(5.0 + 2.0 * normals, normals), seed=0)
    assert target.around is None
    assert len(target.held_out.points) == 200
    fit = fit_of(target, tmp_path, steps=150)
    run(fit)
    assert fit.least < 0.02


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("widht=3", "did you mean 'width'"),
        ("width=0", "width: Input should be greater than or equal to 1"),
        ("width", "not of the form key=value"),
        ("eikonal=.nan", "eikonal"),
    ],
)
def test_an_option_that_is_none_is_told_of(override, complaint):
    with pytest.raises(InputError, match=complaint):
        config_of(SirenConfig, [override])
