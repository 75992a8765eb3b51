import pytest
import torch

from surfsup.fitting.deepsdf_fit import DeepSdfConfig, DeepSdfFit, fitted_shapes, sample_shapes
from surfsup.fitting.exact_shape import ExactShape, ExactSurface
from surfsup.fitting.fit import run_fit
from surfsup.fitting.shape_set import ShapeSet
from surfsup.fitting.siren_fit import SirenConfig, SirenFit, SirenTarget
from surfsup.fitting.siren_result import fitted_surface
from surfsup.sdf import Box, Sphere

SMALL = {"width": 48, "layers": 2, "frequency": 10.0, "batch": 256, "steps": 250, "warm_up": 20, "validate_every": 50}
SMALL_MANY = {
    "width": 48, "layers": 3, "code": 4, "octaves": 1, "shapes": 4, "points": 128, "steps": 1200, "validate_every": 300,
    "learning_rate": 5e-3,
}  # fmt: skip


class Balls(ShapeSet):
    """A ball and three bricks."""

    def __init__(self) -> None:
        self.names = ["ball", "cube", "brick", "plank"]

    def shape(self, name: str) -> ExactShape:
        solids = {
            "ball": Sphere(0.3),
            "cube": Box((0.5, 0.5, 0.5)),
            "brick": Box((0.6, 0.4, 0.5)),
            "plank": Box((0.6, 0.3, 0.3)),
        }
        return ExactSurface(solids[name])


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def ball_target() -> SirenTarget:
    return SirenTarget.of_shape(ExactSurface(Sphere(0.25)), samples=20_000, seed=0)


@pytest.fixture(scope="session")
def ball_siren(ball_target, tmp_path_factory):
    """A sphere of radius 0.25, fitted in seconds."""
    fit = SirenFit(SirenConfig(learning_rate=2e-3, **SMALL), ball_target, tmp_path_factory.mktemp("ball"))
    run_fit(fit)
    return fitted_surface(fit, {"input": "ball"}, resolution=48)[0]


@pytest.fixture(scope="session")
def few_shapes(tmp_path_factory):
    """Four shapes by one network, fitted in seconds."""
    samples = sample_shapes(Balls(), 0, lambda done, total: None)
    fit = DeepSdfFit(DeepSdfConfig(**SMALL_MANY), samples, tmp_path_factory.mktemp("few"))
    run_fit(fit)
    return fitted_shapes(fit, {"input": "four"})
