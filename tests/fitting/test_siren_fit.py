import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactSurface
from surfsup.fitting.fit import run_fit
from surfsup.fitting.point_cloud import PointCloud
from surfsup.fitting.siren_fit import SirenConfig, SirenFit, SirenTarget
from surfsup.fitting.siren_result import measure_errors
from surfsup.optim.config import parse_config, parse_overrides
from surfsup.optim.run import Diverged
from surfsup.sdf import Sphere
from tests.fitting.conftest import SMALL


def fit_of(target, folder, **options):
    return SirenFit(SirenConfig(**{**SMALL, "learning_rate": 2e-3, **options}), target, folder)


def test_the_published_weights_are_the_defaults():
    config = SirenConfig()
    assert (config.surface, config.normal, config.eikonal, config.off_surface) == (3000, 100, 50, 100)


def test_a_sphere_is_fitted_in_seconds(ball_siren):
    errors = measure_errors(ball_siren, ball_siren.to_mesh(64), ExactSurface(Sphere(0.25)), seed=0)
    assert errors.distance < 0.01
    assert errors.angle_on_surface < 4
    assert errors.chamfer < 0.04  # two draws of the points on one sphere are 0.02 apart
    assert errors.parts == 1
    assert "degrees" in errors.text()


def test_the_input_is_scaled_into_a_cube_of_side_2(ball_target):
    assert ball_target.normalization.scale == pytest.approx(4)
    radius = torch.linalg.vector_norm(ball_target.surface.points, dim=-1)
    torch.testing.assert_close(radius, torch.ones_like(radius), atol=3e-3, rtol=0)


def test_a_resumed_fit_has_the_weights_of_an_uninterrupted_one(ball_target, tmp_path):
    straight = fit_of(ball_target, tmp_path / "straight", steps=12, validate_every=4)
    run_fit(straight)
    halted = fit_of(ball_target, tmp_path / "halted", steps=12, validate_every=4)
    run_fit(halted, stop=lambda: halted.step == 6)
    resumed = fit_of(ball_target, tmp_path / "halted", steps=12, validate_every=4)
    resumed.resume()
    assert resumed.step == 6
    run_fit(resumed)
    for one, other in zip(straight.model.parameters(), resumed.model.parameters(), strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize(
    "damaged",
    [torch.zeros(0, 48), torch.ones(48, dtype=torch.bool), torch.full((48,), 1e300, dtype=torch.float64)],
)
def test_best_weights_that_the_network_cannot_have_are_refused(ball_target, tmp_path, damaged):
    fit = fit_of(ball_target, tmp_path, steps=8, validate_every=2)
    tensors, counters = fit_of(ball_target, tmp_path, steps=4, validate_every=2).state()
    tensors |= {f"best.{name}": value for name, value in fit.model.state_dict().items()}
    with pytest.raises(ValueError, match=r"its tensor 'biases\.0'"):
        fit.load_state({**tensors, "best.biases.0": damaged}, counters)


def test_a_fit_with_other_options_is_not_resumed(ball_target, tmp_path):
    run_fit(fit_of(ball_target, tmp_path, steps=2))
    with pytest.raises(InputError, match="belongs to a run of another configuration"):
        fit_of(ball_target, tmp_path, steps=3, learning_rate=1e-4).resume()


def test_a_finished_fit_can_be_resumed_with_more_steps(ball_target, tmp_path):
    run_fit(fit_of(ball_target, tmp_path, steps=4))
    longer = fit_of(ball_target, tmp_path, steps=6)
    longer.resume()
    run_fit(longer)
    assert longer.step == 6


def test_a_diverged_fit_stops_with_a_message_and_keeps_the_best_weights(ball_target, tmp_path):
    fit = fit_of(ball_target, tmp_path, steps=400, learning_rate=1e-3, validate_every=10)
    run_fit(fit, stop=lambda: fit.step == 60)
    least, best = fit.best_score, {name: value.clone() for name, value in fit.best.items()}
    fit.config = fit.config.model_copy(update={"learning_rate": 30.0, "clip": 1e9, "averaging": 0.0})
    with pytest.raises(Diverged, match=r"diverged at step \d+ .*is kept; start again with a lower learning_rate="):
        run_fit(fit)
    assert fit.best_score <= least
    assert all(torch.isfinite(value).all() for value in fit.best.values())
    assert best.keys() == fit.best.keys()


def test_a_loss_that_is_not_a_number_changes_no_weight(ball_target, tmp_path):
    fit = fit_of(ball_target, tmp_path)
    fit.take_step(fit.generator(0))
    before = [parameter.detach().clone() for parameter in fit.model.parameters()]
    fit.config = fit.config.model_copy(update={"surface": float("nan")})
    with pytest.raises(Diverged, match="nothing is kept"):
        run_fit(fit)
    assert all(torch.equal(one, two) for one, two in zip(before, fit.model.parameters(), strict=True))


def test_a_cloud_without_distances_is_fitted_by_the_published_loss(tmp_path):
    normals = np.random.default_rng(0).normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    target = SirenTarget.of_cloud(PointCloud(5.0 + 2.0 * normals, normals), seed=0)
    assert target.around is None
    assert len(target.held_out.points) == 200
    fit = fit_of(target, tmp_path, steps=150)
    run_fit(fit)
    assert fit.best_score < 0.02


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("widht=3", "did you mean 'width'"),
        ("width=0", "width: Input should be greater than or equal to 1"),
        ("width", "not of the form key=value"),
        ("eikonal=.nan", "eikonal"),
    ],
)
def test_a_wrong_option_is_named(override, complaint):
    with pytest.raises(InputError, match=complaint):
        parse_config(SirenConfig, parse_overrides([override]), "options")
