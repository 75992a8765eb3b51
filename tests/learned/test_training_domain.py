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


DOMAIN = TrainingDomain.from_scene(scene(), 1000, 5.0).union(
    TrainingDomain.from_scene(scene("[1, 1.5, 2]", surface="{box: {size: [1, 1, 1]}}"), 3000, 4.0)
)


def test_ranges_contain_all_training_data():
    assert DOMAIN.sides == (1, 1.5)
    assert DOMAIN.heights == (2, 2)
    assert DOMAIN.particles == (1000, 3000)
    assert DOMAIN.surfaces == ("box", "sphere")
    assert DOMAIN.gravity == (9.81, 9.81)
    assert (DOMAIN.max_tilt, DOMAIN.max_speed) == (0, 5)
    assert DOMAIN.union(DOMAIN) == DOMAIN


def test_json_restores_the_domain():
    assert TrainingDomain.from_json(json.loads(json.dumps(asdict(DOMAIN)))) == DOMAIN


@pytest.mark.parametrize(
    "similar", [scene(), scene("[1.5, 1, 2]"), scene("[1.2, 1.3, 2]"), scene(velocity="[0, 4, -3]")]
)
def test_a_scene_inside_the_domain_has_no_warning(similar):
    assert DOMAIN.warning(similar) is None


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (scene("[2, 1, 2]"), "a container of 2 x 1 x 2 m"),
        (scene("[1, 1, 1]"), "a container of 1 x 1 x 1 m"),
        (scene(gravity="[0, 0, -1.6]"), "gravity of 1.6 m/s²"),
        (scene(gravity="[6.94, 0, -6.94]"), "gravity of 9.81 m/s², 45° off straight down"),
        (scene(velocity="[0, 0, -8]"), "water at 8 m/s"),
    ],
)
def test_a_warning_names_the_difference_and_the_training_data(other, difference):
    warning = DOMAIN.warning(other)
    assert f"the weights were not trained for {difference};" in warning
    assert "Training data: containers 1 to 1.5 m wide and 2 m high, 1000 to 3000 particles" in warning
    assert "\n" not in warning


def test_a_warning_names_other_particles_and_frame_times():
    other = TrainingDomain(**{**asdict(DOMAIN), "radius": 0.01, "frame_time": 0.01})
    assert "particles of radius 0.015 m, frames of 0.005 s; expect" in other.warning(scene())


def test_a_surface_of_an_unknown_kind_is_reported_separately():
    cone = scene(surface="{cone: {height: 0.2, bottom_radius: 0.1}}")
    assert DOMAIN.unknown_surface(scene()) == []
    assert DOMAIN.unknown_surface(cone) == ["a surface of kind 'cone'"]
    assert DOMAIN.unknown_surface(scene(surface="null")) == ["a container without a surface"]
    assert DOMAIN.warning(cone) is None
