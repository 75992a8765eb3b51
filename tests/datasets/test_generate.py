import importlib.util

import numpy as np
import pytest
import torch
import yaml

from surfsup.datasets import generate as generation
from surfsup.datasets.generate import energy_gained, generate, what_is_wrong
from surfsup.errors import InputError
from surfsup.reference.solver import NAME, SolverError
from surfsup.scene import Scene
from surfsup.trajectory import Provenance, Trajectory, TrajectoryWriter

needs_solver = pytest.mark.skipif(
    importlib.util.find_spec("pysplishsplash") is None, reason="the reference solver is not installed"
)


def tiny(index: int, random: np.random.Generator) -> Scene:
    """Eight particles in a container whose map takes half a second; the height is drawn."""
    bottom = random.uniform(0.1, 0.25)
    return Scene.from_yaml(
        "container: {size: [0.4, 0.4, 0.4]}\nframes: 6\n"
        f"fluid: [{{block: {{min: [0, 0, {bottom}], max: [0.1, 0.1, {bottom + 0.1}]}}}}]",
        "tiny",
    )


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def tiny_recipe(monkeypatch, cache):
    monkeypatch.setitem(generation.RECIPES, "tiny", tiny)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))


@needs_solver
def test_a_data_set_is_one_trajectory_a_scene_and_says_what_it_is(tmp_path):
    told = []
    folder = tmp_path / "new" / "data"
    paths = generate("tiny", folder, 3, seed=5, workers=2, progress=lambda *progress: told.append(progress))
    assert [path.name for path in paths] == ["00000.h5", "00001.h5", "00002.h5"]
    assert {path.name for path in folder.iterdir()} == {"dataset.yaml", *(path.name for path in paths)}
    assert told == [(1, 3), (2, 3), (3, 3)]
    said = yaml.safe_load((folder / "dataset.yaml").read_text())
    assert (said["recipe"], said["seed"], said["solver"]) == ("tiny", 5, NAME)
    for index, path in enumerate(paths):
        with Trajectory(path) as trajectory:
            assert len(trajectory) == 6
            assert trajectory.scene.to_yaml() == generation.recipe_scene("tiny", 5, index).to_yaml()
            assert trajectory.provenance.model == NAME
            assert trajectory.provenance.seed == 5


@needs_solver
def test_what_is_there_is_kept_and_what_is_missing_is_made_again_to_the_byte(tmp_path):
    paths = generate("tiny", tmp_path, 3, seed=5, workers=1)
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in paths}
    paths[1].unlink()
    generate("tiny", tmp_path, 3, seed=5, workers=1)
    assert {path: path.read_bytes() for path in paths} == {path: data for path, (data, _) in before.items()}
    assert [path.stat().st_mtime_ns == before[path][1] for path in paths] == [True, False, True]


@needs_solver
def test_more_scenes_can_be_added_later(tmp_path):
    generate("tiny", tmp_path, 1, seed=5, workers=1)
    told = []
    generate("tiny", tmp_path, 2, seed=5, workers=1, progress=lambda *progress: told.append(progress))
    assert told == [(2, 2)]


def test_a_folder_of_another_recipe_or_seed_is_refused(tmp_path):
    (tmp_path / "dataset.yaml").write_text("recipe: prim-shapes\nseed: 5\n")
    for recipe, seed in (("tiny", 5), ("prim-shapes", 6)):
        with pytest.raises(InputError, match="holds recipe 'prim-shapes' of seed 5; take another folder"):
            generate(recipe, tmp_path, 1, seed=seed, workers=1)


@pytest.mark.parametrize("text", ["", "just words", "recipe: [", "- 1"])
def test_a_folder_that_does_not_say_what_it_holds_is_refused(tmp_path, text):
    (tmp_path / "dataset.yaml").write_text(text)
    with pytest.raises(InputError) as error:
        generate("tiny", tmp_path, 1, seed=0, workers=1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("count", "workers"), [(0, 1), (1, 0), (-1, 1)])
def test_nothing_to_make_is_refused(tmp_path, count, workers):
    with pytest.raises(InputError, match="must be at least 1"):
        generate("tiny", tmp_path, count, seed=0, workers=workers)


@needs_solver
def test_a_scene_set_aside_is_replaced_and_its_reason_kept(tmp_path, monkeypatch):
    reasons = iter(["a particle left the container", "a particle was 1 m inside the solid", None])
    monkeypatch.setattr(generation, "what_is_wrong", lambda path: next(reasons))
    (path,) = generate("tiny", tmp_path, 1, seed=5, workers=1)
    assert (tmp_path / "00000.set-aside.txt").read_text().splitlines() == [
        "a particle left the container",
        "a particle was 1 m inside the solid",
    ]
    with Trajectory(path) as trajectory:
        assert trajectory.scene.to_yaml() == generation.recipe_scene("tiny", 5, 0, attempt=2).to_yaml()
    assert not list(tmp_path.glob("*.partial"))


@needs_solver
def test_too_many_scenes_set_aside_in_a_row_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(generation, "what_is_wrong", lambda path: "it is wrong")
    with pytest.raises(SolverError, match="5 scenes in a row were set aside, the last because it is wrong"):
        generate("tiny", tmp_path, 1, seed=5, workers=1)
    assert not list(tmp_path.glob("*.h5")) + list(tmp_path.glob("*.partial"))


@needs_solver
def test_an_interrupt_leaves_only_whole_trajectories(tmp_path):
    def interrupt(done: int, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate("tiny", tmp_path, 6, seed=5, workers=1, progress=interrupt)
    made = sorted(tmp_path.glob("*.h5"))
    assert 1 <= len(made) < 6
    for path in made:
        with Trajectory(path) as trajectory:
            assert len(trajectory) == 6
    assert len(generate("tiny", tmp_path, 6, seed=5, workers=2)) == 6


def trajectory_of(path, change) -> None:
    scene = Scene.from_yaml(
        "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\nfluid: [{block: {min: [0, 0, 1.0], max: [0.1, 0.1, 1.1]}}]",
        "test",
    )
    start = scene.start(None)
    with TrajectoryWriter(path, scene, Provenance("test"), len(start.positions)) as writer:
        for frame in range(5):
            positions, velocities = start.positions.copy(), start.particle_velocities.copy()
            if frame == 3:
                change(positions, velocities)
            writer.append(positions, velocities)


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ((0.0, 0.0, 1.06), None),
        ((np.nan, 0.0, 1.0), "not finite"),
        ((0.6, 0.0, 1.0), "left the container"),
        ((0.0, 0.0, -0.01), "left the container"),
        ((0.0, 0.0, 0.59), "0.01 m inside the solid"),
    ],
)
def test_what_is_not_physical_is_found(tmp_path, place, reason):
    def change(positions, velocities):
        positions[5] = place

    trajectory_of(tmp_path / "a.h5", change)
    found = what_is_wrong(tmp_path / "a.h5")
    assert found is None if reason is None else reason in found


def test_a_velocity_that_is_not_finite_is_found(tmp_path):
    def change(positions, velocities):
        velocities[2, 1] = np.inf

    trajectory_of(tmp_path / "a.h5", change)
    assert "not finite" in what_is_wrong(tmp_path / "a.h5")


def test_energy_gained_is_the_largest_rise_and_a_fall_gains_none():
    gravity = (0.0, 0.0, -10.0)
    heights = torch.tensor([2.0, 1.0, 0.0])
    positions = torch.stack([torch.zeros(3), torch.zeros(3), heights], dim=-1)[:, None]
    fall = torch.stack([torch.zeros(3), torch.zeros(3), -(20 * (2 - heights)).sqrt()], dim=-1)[:, None]
    assert energy_gained(positions, fall, gravity) == pytest.approx(0, abs=1e-5)
    burst = fall.clone()
    burst[1, 0, 0] = 4.0
    assert energy_gained(positions, burst, gravity) == pytest.approx(8, rel=1e-5)


def test_water_that_bursts_is_not_physical(tmp_path):
    def change(positions, velocities):
        velocities[3:] += 2.0

    trajectory_of(tmp_path / "a.h5", change)
    assert "burst" in what_is_wrong(tmp_path / "a.h5")
