from pathlib import Path

import pytest

from surfsup import Block, InputError, Scene
from surfsup.sweep.case import cases_of
from surfsup.sweep.variation import Variation

DROP = Scene(fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=5)
EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.yaml"))


def test_every_scene_with_every_combination():
    moon = Scene(fluid=DROP.fluid, gravity=(0, 0, -1.62))
    cases = cases_of({"drop": DROP, "moon": moon}, [Variation("frames", (3, 4)), Variation("gravity.0", (0, 1, 2))])
    assert [case.name for case in cases] == [f"{name}-{number}" for name in ("drop", "moon") for number in range(6)]
    assert [(case.scene.frames, case.scene.gravity[0]) for case in cases[:6]] == [
        (3, 0), (3, 1), (3, 2), (4, 0), (4, 1), (4, 2),
    ]  # fmt: skip
    assert cases[7].values == {"frames": 3, "gravity.0": 1}
    assert cases[7].scene.gravity == (1, 0, -1.62)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_without_values_a_case_is_the_scene_itself(file):
    scene = Scene.load(file)
    (case,) = cases_of({"a": scene}, [])
    away = Path("/nonexistent")  # where paths are absolute
    assert case.scene.to_yaml() == scene.with_paths_relative_to(away).to_yaml()


def test_a_duration_can_be_varied_though_frames_follow_from_it():
    scene = Scene(fluid=DROP.fluid, duration=0.1)
    short, long = cases_of({"drop": scene}, [Variation("duration", (0.05, 0.2))])
    assert (short.scene.frames, long.scene.frames) == (10, 40)


def test_cases_differ_in_their_digest():
    cases = cases_of({"drop": DROP}, [Variation("frames", (3, 4))])
    assert cases[0].digest != cases[1].digest
    assert cases[0].digest == cases_of({"drop": DROP}, [Variation("frames", (3,))])[0].digest


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ([Variation("frmes", (3,))], "drop with frmes=3: unknown key 'frmes'; did you mean 'frames'?"),
        ([Variation("frames", (0,))], "drop with frames=0: frames: "),
        ([Variation("frames", (3,)), Variation("frames", (4,))], "frames: is given twice"),
        ([Variation("frames", tuple(range(1, 1001))), Variation("gravity.0", tuple(range(101)))], "makes 101000 cases"),
    ],
)
def test_a_key_or_value_that_cannot_be_is_refused_in_one_line(vary, message):
    with pytest.raises(InputError, match=message) as error:
        cases_of({"drop": DROP}, vary)
    assert "\n" not in str(error.value)
