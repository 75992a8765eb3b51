import numpy as np

from surfsup.viewing.camera import fit_camera

BOUNDS = np.array([[-0.3, -0.3, 0.0], [0.3, 0.3, 0.6]])


def test_projection_is_the_inverse_of_rays():
    camera = fit_camera((1, 1, 2), BOUNDS, None, (64, 48))
    rays = camera.rays()
    pixels, depth = camera.project(camera.eye + 2.5 * rays[[5, 40], [7, 60]])
    np.testing.assert_allclose(pixels, [[7.5, 5.5], [60.5, 40.5]], atol=1e-3)
    np.testing.assert_allclose(depth, 2.5, rtol=1e-5)


def test_floor_and_solid_are_inside_the_picture_and_fill_it():
    camera = fit_camera((1, 1, 2), BOUNDS, None, (960, 720))
    floor = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    pixels, _ = camera.project(np.vstack([floor, BOUNDS]))
    assert (pixels > 0).all() and (pixels < [960, 720]).all()
    assert np.ptp(pixels[:, 0]) > 0.6 * 960 or np.ptp(pixels[:, 1]) > 0.6 * 720


def test_the_camera_is_closer_to_a_low_scene_than_to_a_tall_one():
    def distance(focus):
        camera = fit_camera((1, 1, 2), BOUNDS, focus, (960, 720))
        return np.linalg.norm(camera.eye - camera.target)

    assert distance(None) < distance(np.array([[0.0, 0.0, 1.6]]))
