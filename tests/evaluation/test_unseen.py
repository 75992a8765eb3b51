from pathlib import Path

from surfsup.evaluation.load_trajectories import Truth
from surfsup.evaluation.unseen import unseen
from surfsup.learned.training_domain import TrainingDomain
from surfsup.scene import Container, Scene
from tests.evaluation.scenes import SCENE

SEEN = TrainingDomain.of(SCENE, 1000, 5.0)
EMPTY = SCENE.model_copy(update={"surface": None})


def in_container(x: float) -> Scene:
    return SCENE.model_copy(update={"container": Container(size=(x, 1, 2))})


def truths(data: str, *scenes: Scene) -> list[Truth]:
    return [Truth(data, Path(f"{number}.h5"), scene, 20, []) for number, scene in enumerate(scenes)]


def test_scenes_like_those_of_training_are_not_told_of():
    assert unseen(SEEN, truths("falls", SCENE, SCENE)) == {}


def test_nothing_can_be_told_where_training_is_not_known():
    assert unseen(None, truths("falls", in_container(3))) == {}


def test_a_data_set_is_one_line_that_says_how_many_scenes_and_what_training_saw():
    told = unseen(SEEN, [*truths("falls", SCENE), *truths("wide", in_container(3), EMPTY, in_container(3))])
    assert list(told) == ["wide"]
    assert told["wide"].startswith(
        "wide: the weights were not trained for a container of 3 x 1 x 2 m (2 of 3 scenes), "
    )
    assert "a container without a solid (1 of 3 scenes); expect errors. Training saw containers 1 m" in told["wide"]
    assert "solids: sphere" in told["wide"]
    assert "\n" not in told["wide"]


def test_of_many_kinds_the_commonest_are_named():
    told = unseen(SEEN, truths("wide", *map(in_container, (2, 3, 4, 5, 6, 6))))["wide"]
    assert told.startswith("wide: the weights were not trained for a container of 6 x 1 x 2 m (2 of 6 scenes), ")
    assert told.count("a container of") == 4
    assert "(1 of 6 scenes), 1 more such; expect errors" in told
