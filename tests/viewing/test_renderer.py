import numpy as np
import pytest

from surfsup.viewing.renderer import FrameRenderer
from surfsup.viewing.water import reconstruct_surface

RADIUS = 0.015
BLOCK = np.stack(np.meshgrid(*[np.arange(-0.135, 0.15, 0.03)] * 3, indexing="ij"), -1).reshape(-1, 3)
HANGING = (BLOCK + np.array([0, 0, 0.75])).astype(np.float32)


@pytest.fixture
def renderer(ball, off_screen):
    renderer = FrameRenderer(ball, (1, 1, 2), RADIUS, focus=HANGING, size=(240, 180))
    yield renderer
    renderer.close()


def blueness(picture):
    return picture[..., 2].astype(float) - picture[..., 0]


def patch(renderer, picture, point):
    """The pixels around a point of the scene."""
    x, y = renderer._camera.project(np.array([point]))[0][0] / 2  # the camera is supersampled
    return picture[int(y) - 4 : int(y) + 4, int(x) - 4 : int(x) + 4]


def test_only_pixels_of_water_are_blue(renderer):
    dry, wet = renderer.render(np.empty((0, 3))), renderer.render(HANGING)
    assert dry.shape == wet.shape == (180, 240, 3) and wet.dtype == np.uint8
    assert blueness(patch(renderer, wet, [0, 0, 0.75])).mean() > 60
    assert blueness(patch(renderer, dry, [0, 0, 0.75])).mean() < 40
    ball_wet, ball_dry = (patch(renderer, p, [0, 0, 0.2]).astype(float) for p in (wet, dry))
    assert blueness(ball_dry).mean() < -40, "the solid is warm"
    assert np.abs(ball_wet - ball_dry).mean() < 25, "water above the solid only casts a soft shadow"


def test_a_picture_does_not_depend_on_the_frame_before(renderer):
    first = renderer.render(HANGING)
    renderer.render(HANGING - [0, 0, 0.4])
    # equal up to rounding: several threads reconstruct the surface
    again = renderer.render(HANGING).astype(int)
    assert np.abs(again - first).mean() < 0.1


def test_water_behind_the_solid_is_hidden(renderer):
    behind = (BLOCK * 0.5 + [-0.2, 0.35, 0.1]).astype(np.float32)
    center = patch(renderer, renderer.render(behind), [0, 0, 0.25])
    assert blueness(center).mean() < -30


def test_a_scene_without_solid_and_a_diverged_rollout_are_rendered(off_screen):
    renderer = FrameRenderer(None, (1, 1, 1), RADIUS, size=(120, 90))
    diverged = np.vstack([HANGING, np.full((3, 3), np.nan, np.float32)])
    assert renderer.render(diverged).std() > 5
    renderer.close()


def test_the_surface_encloses_the_volume_of_the_water(off_screen):
    surface = reconstruct_surface(HANGING, RADIUS)
    assert surface.volume == pytest.approx(len(HANGING) * 0.03**3, rel=0.2)
    outwards = np.einsum("ij,ij->i", surface.point_data["Normals"], surface.points - [0, 0, 0.75])
    assert (outwards > 0).mean() > 0.99
