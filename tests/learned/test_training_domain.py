import json
from dataclasses import asdict

import pytest

from surfsup.learned.training_domain import TrainingDomain
from surfsup.scene import Scene


def scene(container="[1, 1, 2]", gravity="[0, 0, -9.81]", velocity="[0, 0, 0]", surface="{sphere: {radius: 0.1}}"):
    return Scene.from_yaml(
        f"container: {{size: {container}}}\ngravity: {gravity}\nsurface: {surface}\n"
        f"fluid: [{{block: {{min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7], velocity: {velocity}}}}}]",
        "test",
    )


SEEN = TrainingDomain.of(scene(), 1000, 5.0).joined(
    TrainingDomain.of(scene("[1, 1.5, 2]", surface="{box: {size: [1, 1, 1]}}"), 3000, 4.0)
)


def test_ranges_hold_all_that_was_seen():
    assert SEEN.sides == (1, 1.5)
    assert SEEN.heights == (2, 2)
    assert SEEN.particles == (1000, 3000)
    assert SEEN.surfaces == ("box", "sphere")
    assert SEEN.gravity == (9.81, 9.81)
    assert (SEEN.tilt, SEEN.fastest) == (0, 5)
    assert SEEN.joined(SEEN) == SEEN


def test_it_survives_the_way_through_json():
    assert TrainingDomain.from_json(json.loads(json.dumps(asdict(SEEN)))) == SEEN


@pytest.mark.parametrize("like", [scene(), scene("[1.5, 1, 2]"), scene("[1.2, 1.3, 2]"), scene(velocity="[0, 4, -3]")])
def test_a_scene_like_those_seen_needs_no_warning(like):
    assert SEEN.warning(like) is None


@pytest.mark.parametrize(
    ("unlike", "said"),
    [
        (scene("[2, 1, 2]"), "a container of 2 x 1 x 2 m"),
        (scene("[1, 1, 1]"), "a container of 1 x 1 x 1 m"),
        (scene(gravity="[0, 0, -1.6]"), "gravity of 1.6 m/s²"),
        (scene(gravity="[6.94, 0, -6.94]"), "gravity of 9.81 m/s², 45° off straight down"),
        (scene(velocity="[0, 0, -8]"), "water at 8 m/s"),
    ],
)
def test_one_unlike_them_is_told_with_what_was_seen(unlike, said):
    warning = SEEN.warning(unlike)
    assert f"the weights were not trained for {said};" in warning
    assert "Training saw containers 1 to 1.5 m wide and 2 m high, 1000 to 3000 particles" in warning
    assert "\n" not in warning


def test_other_particles_than_those_seen_are_told():
    other = TrainingDomain(**{**asdict(SEEN), "radius": 0.01, "frame_time": 0.01})
    assert "particles of radius 0.015 m, frames of 0.005 s; expect" in other.warning(scene())


def test_a_solid_of_a_kind_that_was_not_seen_is_told_apart():
    cone = scene(surface="{cone: {height: 0.2, bottom_radius: 0.1}}")
    assert SEEN.unlike_solid(scene()) == []
    assert SEEN.unlike_solid(cone) == ["a solid of kind 'cone'"]
    assert SEEN.unlike_solid(scene(surface="null")) == ["a container without a solid"]
    assert SEEN.warning(cone) is None
