import re

import h5py
import numpy as np
import pytest

from surfsup.datasets.units import OtherUnits
from surfsup.errors import InputError
from surfsup.evaluation.floor import floor_files
from surfsup.evaluation.load_trajectories import data_sets, difference, usable_truths
from surfsup.scene import Scene
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write


@pytest.fixture
def folder(tmp_path):
    """Two good truths; the first has two repeats."""
    here = tmp_path / "falls"
    for name in ("00000.h5", "00001.h5", "floor/00000-1.h5", "floor/00000-2.h5"):
        write(here / name, *free_fall())
    return here


def moved(**changes: object) -> Scene:
    return SCENE.model_copy(update=changes)


def test_a_folder_gives_its_trajectories_each_with_its_repeats(folder):
    truths, skipped = usable_truths(data_sets([folder]))
    assert [(truth.data, truth.path.name, truth.frames) for truth in truths] == [
        ("falls", "00000.h5", FRAMES),
        ("falls", "00001.h5", FRAMES),
    ]
    assert [[floor.name for floor in truth.floors] for truth in truths] == [["00000-1.h5", "00000-2.h5"], []]
    assert skipped == []


def test_repeats_of_another_scene_with_a_longer_name_are_not_mixed_up(tmp_path):
    for name in ("a.h5", "a-b.h5", "floor/a-1.h5", "floor/a-b-1.h5", "floor/a-b.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert [path.name for path in floor_files(tmp_path / "a.h5")] == ["a-1.h5"]
    assert [path.name for path in floor_files(tmp_path / "a-b.h5")] == ["a-b-1.h5"]


def cut_off(path):
    path.write_bytes(path.read_bytes()[:5000])


def stopped_early(path):
    write(path, *free_fall(7))


def foreign(path):
    with h5py.File(path, "w") as file:
        file["temperature"] = np.zeros(3)


def not_a_number(path):
    positions, velocities = free_fall()
    positions[4, 2] = np.nan
    write(path, positions, velocities)


def damaged(path):
    with h5py.File(path, "r+") as file:
        data = file["00000/position"]
        place = data.id.get_chunk_info(1)
    with path.open("r+b") as raw:
        raw.seek(place.byte_offset)
        raw.write(b"\xff" * place.size)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (cut_off, "is not a trajectory of surfsup, or was cut off"),
        (stopped_early, "was cut off: it has 7 of its 20 frames"),
        (foreign, "is not a trajectory of surfsup"),
        (not_a_number, "holds values that are not numbers in the frames from 0 on"),
        (damaged, "is damaged in the frames from 0 on"),
    ],
)
@pytest.mark.parametrize("name", ["00001.h5", "floor/00000-1.h5"])
def test_a_file_that_cannot_be_used_is_skipped_by_name_and_with_its_reason(folder, name, spoil, reason):
    spoil(folder / name)
    truths, skipped = usable_truths(data_sets([folder]))
    assert [bad.file for bad in skipped] == [folder / name]
    assert re.search(reason.replace("its 20", "(its )?20"), skipped[0].reason)
    assert str(folder) not in skipped[0].reason
    kept = [truth.path.name for truth in truths], [floor.name for floor in truths[0].floors]
    expected = (
        (["00000.h5"], ["00000-1.h5", "00000-2.h5"])
        if name == "00001.h5"
        else (
            ["00000.h5", "00001.h5"],
            ["00000-2.h5"],
        )
    )
    assert kept == expected


def test_a_scene_whose_mesh_is_gone_is_skipped(folder):
    scene = Scene.from_yaml(
        "surface: {mesh: {file: gone.stl}}\nfluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\nframes: 20",
        "test",
    )
    write(folder / "00002.h5", *free_fall(), scene)
    _, skipped = usable_truths(data_sets([folder]))
    assert (skipped[0].file.name, "gone.stl" in skipped[0].reason) == ("00002.h5", True)


def test_a_repeat_of_another_scene_is_skipped(folder):
    write(folder / "floor/00000-2.h5", *free_fall(), moved(surface=None))
    _, skipped = usable_truths(data_sets([folder]))
    assert skipped[0].reason == "is of another scene than 00000.h5: their surfaces differ"


def test_nothing_usable_at_all_is_refused(folder):
    for path in folder.glob("*.h5"):
        cut_off(path)
    with pytest.raises(InputError, match=r"none of the 2 trajectories can be used; .*00000\.h5: is not a trajectory"):
        usable_truths(data_sets([folder]))


def test_a_folder_without_trajectories_or_given_twice_is_refused(folder, tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        data_sets([tmp_path])
    with pytest.raises(InputError, match="is given twice"):
        data_sets([folder, folder / ".." / "falls"])


def test_folders_of_one_name_get_longer_names(tmp_path):
    for name in ("a/test", "b/test"):
        write(tmp_path / name / "00000.h5", *free_fall(2))
    assert [one.name for one in data_sets([tmp_path / "a/test", tmp_path / "b/test"])] == ["a-test", "b-test"]
    assert [one.name for one in data_sets([tmp_path / "a/test"])] == ["test"]


def shifted(meters: float) -> list:
    block = SCENE.fluid[0].block
    corners = {name: tuple(value + meters for value in getattr(block, name)) for name in ("min", "max")}
    return [SCENE.fluid[0].model_copy(update={"block": block.model_copy(update=corners)})]


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, None),
        ({"frames": 3}, None),
        ({"fluid": shifted(0.001)}, None),
        ({"fluid": shifted(0.1)}, "blocks of fluid"),
        ({"fluid": SCENE.fluid * 2}, "blocks of fluid"),
        ({"surface": None}, "surfaces"),
        ({"gravity": (0.0, 0.0, -1.62)}, "gravities"),
        ({"container": SCENE.container.model_copy(update={"size": (2.0, 2.0, 3.0)})}, "containers"),
    ],
)
def test_what_two_scenes_differ_in(changes, found):
    assert difference(SCENE, moved(**changes)) == found


def of_other_particles(path):
    with h5py.File(path, "r+") as file:
        file.attrs["radius"] = 0.025


def test_a_truth_of_other_units_is_no_damage_but_the_wrong_data_and_is_refused(folder):
    of_other_particles(folder / "00001.h5")
    with pytest.raises(OtherUnits, match=r"00001\.h5: has a frame every 0\.005 s and particles of radius 0\.025 m; "):
        usable_truths(data_sets([folder]))


def test_a_repeat_of_other_units_is_skipped(folder):
    of_other_particles(folder / "floor/00000-1.h5")
    truths, skipped = usable_truths(data_sets([folder]))
    assert [floor.name for floor in truths[0].floors] == ["00000-2.h5"]
    assert "particles of radius 0.025 m" in skipped[0].reason


def test_the_first_trajectories_and_the_first_frames_of_each_are_enough_if_asked(folder):
    write(folder / "floor/00000-2.h5", *free_fall(7))
    truths, skipped = usable_truths(data_sets([folder], first=1), frames=7)
    assert [(truth.path.name, truth.frames, len(truth.floors)) for truth in truths] == [("00000.h5", 7, 2)]
    assert skipped == []
    truths, _ = usable_truths(data_sets([folder], first=9), frames=10**6)
    assert [truth.frames for truth in truths] == [FRAMES, FRAMES]
