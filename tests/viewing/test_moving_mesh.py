import numpy as np
import trimesh

import surfsup as sf
from surfsup.scene import Scene, quaternion
from surfsup.scene.pose import Pose
from surfsup.viewing.moving_mesh import MovingMesh, at_frame, bounds_of, container_corners
from surfsup.viewing.trajectory_page import trajectory_meshes
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

QUARTER = Pose.of((1, 0, 0), quaternion.about_axis((0, 0, 1), np.pi / 2)).array


def test_a_mesh_is_drawn_where_its_pose_puts_it():
    bar = MovingMesh(trimesh.creation.box((2, 1, 1)), np.stack([Pose.of().array, QUARTER]))
    np.testing.assert_allclose(bar.at(1).bounds, [[0.5, -1, -0.5], [1.5, 1, 0.5]], atol=1e-9)
    np.testing.assert_allclose(bar.bounds(), [[-1, -1, -0.5], [1.5, 1, 0.5]], atol=1e-9)
    both = at_frame(trimesh.creation.box((6, 1, 1)), [bar], 1)
    np.testing.assert_allclose(both.bounds, [[-3, -1, -0.5], [3, 1, 0.5]], atol=1e-9)
    assert at_frame(None, [], 0) is None and bounds_of(None, []) is None


def test_the_corners_of_a_container_move_with_it():
    corners = container_corners((2, 2, 1), {"container": QUARTER[None]}, 0)
    np.testing.assert_allclose(corners.min(axis=0), (0, -1, 0), atol=1e-9)
    np.testing.assert_allclose(container_corners((2, 2, 1), {}, 0)[4], (-1, -1, 1))


def test_pictures_show_the_solid_where_it_is(tmp_path, off_screen):
    scene = Scene.from_yaml(
        "container: {size: [1, 1, 1]}\nframes: 30\n"
        "surfaces: {ball: {sphere: {radius: 0.15}, motion: {between: linear, keyframes: ["
        "{time: 0, position: [-0.3, 0, 0.2]}, {time: 0.15, position: [0.3, 0, 0.2]}]}}}\n"
        "fluid: [{block: {min: [-0.05, -0.05, 0.6], max: [0.05, 0.05, 0.7]}}]",
        "test",
    )
    sf.Simulation(scene).record(tmp_path / "t.h5")
    with sf.Trajectory(tmp_path / "t.h5") as trajectory:
        still, moving = trajectory_meshes(trajectory)
        assert still is None and len(moving) == 1
        renderer = TrajectoryRenderer(trajectory, (160, 120))
        first, last = renderer.render(0).astype(float), renderer.render(29).astype(float)
        renderer.close()
    red = [(picture[..., 0] - picture[..., 2] > 30) for picture in (first, last)]
    columns = [np.nonzero(mask)[1].mean() for mask in red]
    assert columns[1] > columns[0] + 30
