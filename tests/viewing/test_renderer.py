import numpy as np
import pytest

from surfsup.scene.liquid import LIQUIDS
from surfsup.viewing.liquid_look import WATER, look_of
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.renderer import FrameRenderer

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
    x, y = renderer._camera.project(np.array([point]))[0][0]
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


def test_each_liquid_has_its_own_color(off_screen):
    left = HANGING[:, 0] < 0
    looks = [WATER, look_of(LIQUIDS["honey"])]
    renderer = FrameRenderer(None, (1, 1, 2), RADIUS, HANGING, (240, 180), looks=looks, liquids=left.astype(np.int32))
    picture = renderer.render(HANGING)
    water, honey = (blueness(patch(renderer, picture, [x, x, 0.75])).mean() for x in (0.1, -0.1))
    renderer.close()
    assert water > 20 > -20 > honey


def test_the_first_frame_shows_all_of_the_water(off_screen):
    for height in (0.75, 1.6):
        block = HANGING + np.array([0, 0, height - 0.75], np.float32)
        renderer = FrameRenderer(None, (1, 1, 2), RADIUS, focus=block, size=(160, 120))
        pixels, _ = renderer._camera.project(block)
        renderer.close()
        assert (pixels > 0).all() and (pixels < [160, 120]).all()


def test_the_shadow_of_a_pool_has_no_pattern(off_screen):
    floor = np.stack(np.meshgrid(*[np.arange(-0.45, 0.46, 0.03)] * 2, [0.03, 0.06, 0.09]), -1).reshape(-1, 3)
    renderer = FrameRenderer(None, (1, 1, 1), RADIUS, size=(960, 720))
    view = renderer._dry.view
    shadow = renderer._dry.receiver.shade(floor.astype(np.float32), RADIUS)
    light = shadow.light_in(PixelBox.whole((960, 720)), 960)
    renderer.close()
    assert light.min() < 0.9
    curvature = np.abs(light[:, 2:] - 2 * light[:, 1:-1] + light[:, :-2])[np.isfinite(view.depth[:, 1:-1])]
    assert curvature.max() < 0.02


def test_drawing_a_part_gives_the_picture_of_the_whole(ball, off_screen, monkeypatch):
    def picture():
        renderer = FrameRenderer(ball, (1, 1, 2), RADIUS, focus=HANGING, size=(240, 180))
        image = renderer.render(HANGING - np.array([0, 0, 0.5], np.float32)).astype(int)
        renderer.close()
        return image

    part = picture()
    monkeypatch.setattr(PixelBox, "around", staticmethod(lambda pixels, margin, size: PixelBox.whole(size)))
    difference = np.abs(picture() - part)
    assert difference.mean() < 0.05 and (difference > 40).mean() < 1e-3  # several threads reconstruct the surface
