import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.solids import build_solids
from surfsup.scene.tap_checks import check_taps_and_drains

TAP = "disc: {radius: 0.05}, at: [0, 0, 0.8]"
ONE = f"taps: [{{{TAP}, speed: 1}}]"
POOL = "fluid: [{block: {min: [-0.2, -0.2, 0.1], max: [0.2, 0.2, 0.3]}}]\n"


def scene_of(text):
    return Scene.from_yaml(text, "scene.yaml")


def test_a_scene_of_taps_alone_needs_no_fluid():
    scene = scene_of(f"taps: [{{{TAP}, speed: 1}}]")
    assert scene.fluid == [] and scene.is_open
    assert scene.initial_particles(None).positions.shape == (0, 3)


def test_a_flow_in_liters_a_second_is_a_speed():
    tap = sf.Tap(rectangle={"size": (0.1, 0.2)}, at=(0, 0, 1), flow=5)
    assert tap.meters_per_second == pytest.approx(0.25)


def test_a_scene_with_taps_and_drains_is_written_as_it_was_read(tmp_path):
    text = (
        f"surfaces: {{arm: {{box: {{size: [0.1, 0.1, 0.1]}}}}}}\ntaps: [{{{TAP}, flow: 2, from: 0.5, until: 2}},"
        " {rectangle: {size: [0.1, 0.06]}, at: [0, 0, 0.4], direction: [1, 0, 0], turn: 30, speed: 2, carrier: arm,"
        " recycle: true}]\ndrains: [{box: {size: [1, 1, 0.1]}, from: 1}, {mesh: {file: sink.obj}}]"
    )
    scene = scene_of(text)
    again = scene_of(scene.to_yaml())
    assert again == scene and (scene.taps[0].start, scene.taps[0].until) == (0.5, 2)
    assert "from: 0.5" in scene.to_yaml()
    moved = scene.with_base_folder(tmp_path).with_paths_relative_to(tmp_path / "out", tmp_path)
    assert str(moved.drains[1].mesh.file) == "../sink.obj"
    assert scene.with_changes(frames=3).taps == scene.taps


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("taps: []", "fluid: is missing"),
        ("fluid: []", "fluid: is empty, and there are no taps; give water or a tap"),
        (f"taps: [{{{TAP}}}]", "taps.0: give either speed in m/s or flow in liters a second"),
        (f"taps: [{{{TAP}, speed: 1, flow: 1}}]", "taps.0: give either speed in m/s or flow"),
        (f"taps: [{{{TAP}, speed: 0}}]", "taps.0.speed: Input should be greater than 0 \\(found 0\\)"),
        (f"taps: [{{{TAP}, flow: -2}}]", "taps.0.flow: Input should be greater than 0 \\(found -2\\)"),
        (f"taps: [{{{TAP}, flow: 1.0e9}}]", "taps.0: a flow of 1e\\+09 liters a second through 0.00785 m² is .* m/s"),
        (f"taps: [{{{TAP}, speed: 1, from: 2, until: 1}}]", "taps.0: until 1 s must be after from 2 s"),
        (f"taps: [{{{TAP}, speed: 1, form: 2}}]", "unknown key 'taps.0.form'; did you mean 'from'?"),
        (f"taps: [{{{TAP}, speed: 1, direction: [0, 0, 0]}}]", "taps.0: direction must not be zero"),
        ("taps: [{at: [0, 0, 1], speed: 1}]", "taps.0: needs exactly one of disc and rectangle"),
        (
            f"taps: [{{{TAP}, speed: 1, carrier: arm}}]",
            "taps.0.carrier: there is no surface 'arm'; the scene's are none",
        ),
        (
            POOL + "surfaces: {cup: {sphere: {radius: 0.1}}}\ndrains: [{sphere: {radius: 0.1}, carrier: cub}]",
            "drains.0.carrier: there is no surface 'cub'; the scene's are cup",
        ),
        (
            "taps: [{disc: {radius: 0.01}, at: [0, 0, 1], speed: 1}]",
            "taps.0.disc: a radius of 0.01 m is less than that of a particle, 0.015 m",
        ),
        (
            "taps: [{rectangle: {size: [0.3, 0.02]}, at: [0, 0, 1], speed: 1}]",
            "taps.0.rectangle: a side of 0.02 m is less than the diameter of a particle, 0.03 m",
        ),
    ],
)
def test_a_mistake_in_a_scene_file_is_one_line(text, message):
    with pytest.raises(InputError, match=message) as error:
        scene_of(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "surface: {sphere: {radius: 0.1}, at: [0, 0, 0.8]}\n" + ONE,
            r"taps.0: its water would begin in a solid, .* \(18 of 18 particles",
        ),
        (
            "taps: [{disc: {radius: 0.05}, at: [0.47, 0, 0.8], speed: 1}]",
            "taps.0: its water would begin outside the container, or closer to a wall .* along x, in a container from "
            "-0.5 to 0.5 m",
        ),
        (
            ONE + "\ndrains: [{sphere: {radius: 0.2}, at: [0, 0, 0.9]}]",
            "drains.0: covers tap 0, whose water would leave at once",
        ),
        (POOL + "drains: [{box: {size: [3, 3, 5]}, at: [0, 0, 1]}]", "drains.0: covers the whole container"),
        (
            "surfaces: {arm: {box: {size: [0.1, 0.1, 0.1]}, at: [0, 0, 0.7]}}\n"
            "taps: [{disc: {radius: 0.03}, at: [0, 0, 0], speed: 1, carrier: arm}]",
            "taps.0: its water would begin in a solid",
        ),
    ],
)
def test_a_tap_or_drain_without_room_is_refused_when_the_simulation_is_made(text, message):
    scene = scene_of(text)
    with pytest.raises(InputError, match=message):
        check_taps_and_drains(scene, build_solids(scene))


def test_a_tap_on_a_surface_at_rest_is_in_the_frame_of_the_surface():
    scene = scene_of(
        "surfaces: {arm: {box: {size: [0.1, 0.1, 0.1]}, rotate: {axis: [0, 1, 0], degrees: 90}, at: [0, 0, 1]}}\n"
        "taps: [{rectangle: {size: [0.06, 0.06]}, at: [0, 0, 0.1], direction: [0, 0, 1], speed: 2, carrier: arm}]"
    )
    simulation = sf.Simulation(scene)
    for _ in range(3):
        frame = simulation.step()
    np.testing.assert_allclose(frame.velocities, np.broadcast_to([2.0, 0, 0], frame.velocities.shape), atol=1e-5)
    assert frame.positions[:, 0].min() > 0.1
    np.testing.assert_allclose(frame.positions[:, 2].mean(), 1.0, atol=1e-6)


def test_more_particles_than_memory_holds_are_refused_with_their_number():
    scene = scene_of("taps: [{rectangle: {size: [0.9, 0.9]}, at: [0, 0, 1], speed: 9000}]\nduration: 1000")
    with pytest.raises(InputError, match=r"gives [\d,]+ particles, 2[\d,]+ of them from taps, but this machine"):
        scene.initial_particles(None)


def test_learned_simulators_refuse_taps_in_one_line():
    with pytest.raises(InputError, match="does not know taps and drains; use the simulator dfsph"):
        sf.Simulation(scene_of(f"taps: [{{{TAP}, speed: 1}}]"), "surfsup")
