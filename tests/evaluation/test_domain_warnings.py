from pathlib import Path

from surfsup.evaluation.domain_warnings import domain_warnings
from surfsup.evaluation.load_trajectories import ReferenceTrajectory
from surfsup.learned.training_domain import TrainingDomain
from surfsup.scene import Container, Scene
from tests.evaluation.scenes import SCENE

DOMAIN = TrainingDomain.from_scene(SCENE, 1000, 5.0)
EMPTY = SCENE.model_copy(update={"surface": None})


def in_container(x: float) -> Scene:
    return SCENE.model_copy(update={"container": Container(size=(x, 1, 2))})


def references(data_set: str, *scenes: Scene) -> list[ReferenceTrajectory]:
    return [ReferenceTrajectory(data_set, Path(f"{number}.h5"), scene, 20, []) for number, scene in enumerate(scenes)]


def test_scenes_inside_the_training_domain_give_no_warning():
    assert domain_warnings(DOMAIN, references("falls", SCENE, SCENE)) == {}


def test_an_unknown_training_domain_gives_no_warning():
    assert domain_warnings(None, references("falls", in_container(3))) == {}


def test_a_data_set_is_one_line_with_the_numbers_of_scenes_and_the_training_data():
    wide = references("wide", in_container(3), EMPTY, in_container(3))
    warnings = domain_warnings(DOMAIN, [*references("falls", SCENE), *wide])
    assert list(warnings) == ["wide"]
    warning = warnings["wide"]
    assert warning.startswith("wide: the weights were not trained for a container of 3 x 1 x 2 m (2 of 3 scenes), ")
    assert "a container without a surface (1 of 3 scenes); expect errors. Training data: containers 1 m" in warning
    assert "surfaces: sphere" in warning
    assert "\n" not in warning


def test_of_many_differences_the_most_common_are_named():
    warning = domain_warnings(DOMAIN, references("wide", *map(in_container, (2, 3, 4, 5, 6, 6))))["wide"]
    assert warning.startswith("wide: the weights were not trained for a container of 6 x 1 x 2 m (2 of 6 scenes), ")
    assert warning.count("a container of") == 4
    assert "(1 of 6 scenes), 1 more such; expect errors" in warning
