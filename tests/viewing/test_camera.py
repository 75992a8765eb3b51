import numpy as np

from surfsup.viewing.camera import ViewDirection, fit_camera

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


def test_the_camera_looks_from_the_direction_given():
    front = fit_camera((1, 1, 2), BOUNDS, None, (960, 720), ViewDirection(-90, 5))
    assert abs(front.eye[0]) < 1e-6 and front.eye[1] < -1
    near = fit_camera((1, 1, 2), BOUNDS, None, (960, 720), ViewDirection(-90, 5, zoom=2))
    distances = [np.linalg.norm(camera.eye - camera.target) for camera in (front, near)]
    assert distances[0] == 2 * distances[1]


def test_nothing_leaves_the_picture_of_a_turntable():
    camera = fit_camera((1, 1, 2), BOUNDS, None, (960, 720), turntable=True)
    floor = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    for degrees in range(0, 360, 20):
        pixels, _ = camera.turned(degrees).project(np.vstack([floor, BOUNDS]))
        assert (pixels > 0).all() and (pixels < [960, 720]).all()
    np.testing.assert_allclose(camera.turned(360).eye, camera.eye)


def test_rays_of_samples_lie_around_those_of_their_pixel():
    camera = fit_camera((1, 1, 2), BOUNDS, None, (64, 48))
    fine = camera.rays(2).reshape(48, 2, 64, 2, 3)
    np.testing.assert_allclose(fine.mean((1, 3)), camera.rays(), atol=1e-6)
