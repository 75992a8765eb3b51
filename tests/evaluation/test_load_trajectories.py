import re

import h5py
import numpy as np
import pytest

from surfsup.datasets.units import UnitMismatchError
from surfsup.errors import InputError
from surfsup.evaluation.floor import floor_files
from surfsup.evaluation.load_trajectories import find_data_sets, load_references, scene_difference
from surfsup.scene import Scene
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write


@pytest.fixture
def folder(tmp_path):
    """Two valid references; the first has two repeats."""
    folder = tmp_path / "falls"
    for name in ("00000.h5", "00001.h5", "floor/00000-1.h5", "floor/00000-2.h5"):
        write(folder / name, *free_fall())
    return folder


def changed(**changes: object) -> Scene:
    return SCENE.model_copy(update=changes)


def test_a_folder_gives_its_trajectories_each_with_its_repeats(folder):
    references, skipped = load_references(find_data_sets([folder]))
    assert [(one.data_set, one.path.name, one.frames) for one in references] == [
        ("falls", "00000.h5", FRAMES),
        ("falls", "00001.h5", FRAMES),
    ]
    assert [[floor.name for floor in one.floors] for one in references] == [["00000-1.h5", "00000-2.h5"], []]
    assert skipped == []


def test_repeats_of_a_scene_with_a_longer_name_are_kept_apart(tmp_path):
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
    ("damage", "reason"),
    [
        (cut_off, "is not a trajectory of surfsup, or was cut off"),
        (stopped_early, "was cut off: it has 7 of its 20 frames"),
        (foreign, "is not a trajectory of surfsup"),
        (not_a_number, "has values that are not finite in the frames from 0 on"),
        (damaged, "is damaged in the frames from 0 on"),
    ],
)
@pytest.mark.parametrize("name", ["00001.h5", "floor/00000-1.h5"])
def test_an_invalid_file_is_skipped_with_its_name_and_the_reason(folder, name, damage, reason):
    damage(folder / name)
    references, skipped = load_references(find_data_sets([folder]))
    assert [bad.file for bad in skipped] == [folder / name]
    assert re.search(reason.replace("its 20", "(its )?20"), skipped[0].reason)
    assert str(folder) not in skipped[0].reason
    kept = [one.path.name for one in references], [floor.name for floor in references[0].floors]
    expected = (
        (["00000.h5"], ["00000-1.h5", "00000-2.h5"])
        if name == "00001.h5"
        else (
            ["00000.h5", "00001.h5"],
            ["00000-2.h5"],
        )
    )
    assert kept == expected


def test_a_scene_whose_mesh_file_is_missing_is_skipped(folder):
    scene = Scene.from_yaml(
        "surface: {mesh: {file: gone.stl}}\nfluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\nframes: 20",
        "test",
    )
    write(folder / "00002.h5", *free_fall(), scene)
    _, skipped = load_references(find_data_sets([folder]))
    assert (skipped[0].file.name, "gone.stl" in skipped[0].reason) == ("00002.h5", True)


def test_a_repeat_of_another_scene_is_skipped(folder):
    write(folder / "floor/00000-2.h5", *free_fall(), changed(surface=None))
    _, skipped = load_references(find_data_sets([folder]))
    assert skipped[0].reason == "is of another scene than 00000.h5: their surfaces differ"


def test_a_data_set_without_a_valid_reference_is_rejected(folder):
    for path in folder.glob("*.h5"):
        cut_off(path)
    with pytest.raises(InputError, match=r"none of the 2 trajectories is valid; .*00000\.h5: is not a trajectory"):
        load_references(find_data_sets([folder]))


def test_a_folder_without_trajectories_or_given_twice_is_rejected(folder, tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        find_data_sets([tmp_path])
    with pytest.raises(InputError, match="is given twice"):
        find_data_sets([folder, folder / ".." / "falls"])


def test_folders_of_the_same_name_get_longer_names(tmp_path):
    for name in ("a/test", "b/test"):
        write(tmp_path / name / "00000.h5", *free_fall(2))
    assert [one.name for one in find_data_sets([tmp_path / "a/test", tmp_path / "b/test"])] == ["a-test", "b-test"]
    assert [one.name for one in find_data_sets([tmp_path / "a/test"])] == ["test"]


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
def test_the_difference_of_two_scenes_is_named(changes, found):
    assert scene_difference(SCENE, changed(**changes)) == found


def test_a_container_that_moves_as_in_a_file_is_the_same_in_every_folder(tmp_path):
    text = (
        "container: {size: [1, 1, 2], motion: {file: shake.csv}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]"
    )
    scene = Scene.from_yaml(text, "test", tmp_path)
    assert scene_difference(scene.with_paths_relative_to(tmp_path / "floor", tmp_path), scene) is None
    assert scene_difference(Scene.from_yaml(text, "test", tmp_path / "floor"), scene) == "containers"


def of_other_particles(path):
    with h5py.File(path, "r+") as file:
        file.attrs["radius"] = 0.025


def test_a_reference_in_other_units_is_rejected_and_not_skipped(folder):
    of_other_particles(folder / "00001.h5")
    with pytest.raises(
        UnitMismatchError, match=r"00001\.h5: has a frame every 0\.005 s and particles of radius 0\.025 m; "
    ):
        load_references(find_data_sets([folder]))


def test_references_of_two_particle_sizes_are_evaluated_one_after_the_other(folder):
    scene = SCENE.with_changes(particle_radius=0.03)
    frames = free_fall(scene=scene)
    write(folder / "00009.h5", *frames, scene)
    with pytest.raises(UnitMismatchError, match=r"00009\.h5: has particles of radius 0\.03 m, but .* of 0\.015 m"):
        load_references(find_data_sets([folder]))


def test_a_repeat_in_other_units_is_skipped(folder):
    of_other_particles(folder / "floor/00000-1.h5")
    references, skipped = load_references(find_data_sets([folder]))
    assert [floor.name for floor in references[0].floors] == ["00000-2.h5"]
    assert "particles of radius 0.025 m" in skipped[0].reason


def test_scenes_and_frames_can_be_limited(folder):
    write(folder / "floor/00000-2.h5", *free_fall(7))
    references, skipped = load_references(find_data_sets([folder], first=1), frames=7)
    assert [(one.path.name, one.frames, len(one.floors)) for one in references] == [("00000.h5", 7, 2)]
    assert skipped == []
    references, _ = load_references(find_data_sets([folder], first=9), frames=10**6)
    assert [one.frames for one in references] == [FRAMES, FRAMES]
