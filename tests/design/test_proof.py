import numpy as np
import pytest
import torch
import trimesh

from surfsup.design import bowl, funnel, prove
from surfsup.design.landing import settled
from surfsup.design.reward import Outcome, landing_near, log_density, near
from surfsup.design.rivals import WORST, Box, by_model, evolution, first, random_search
from surfsup.design.rollout import every_frame
from surfsup.design.shape_files import closed, write_shape
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.sdf import Bowl
from surfsup.sph.state import Environment
from tests.design.test_run import away
from tests.design.test_task import ball_task, climb, run_of


class TestTheRewards:
    def test_are_the_log_densities_of_the_paper(self):
        from scipy.stats import multivariate_normal

        places = torch.randn(7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
        told = log_density(places, (0.1, 0.0, 0.5), 0.8)
        assert told.numpy() == pytest.approx(multivariate_normal([0.1, 0.0, 0.5], 0.8 * np.eye(3)).logpdf(places))
        nobody = torch.zeros(7, dtype=torch.bool)
        assert near((0.1, 0.0, 0.5), 0.8)(Outcome(places, nobody, {})) == told.mean()

    def test_of_the_funnel_counts_only_who_landed(self):
        places = torch.tensor([[0.1, 0.0, 0.06], [5.0, 5.0, 1.0]])
        end = Outcome(places, torch.tensor([True, False]), {})
        expected = float(log_density(places[:1, :2], (0.0, 0.0), 0.75))
        assert float(landing_near((0.0, 0.0), 0.75, 0.06)(end)) == pytest.approx(expected)


class TestTheSolversFramesAreScoredLikeOurs:
    def test_who_comes_down_stays_where_it_did(self):
        course = [[0.0, 0.3], [0.02, 0.1], [0.04, 0.02], [0.5, 0.4]]
        frames = [(np.array([[x, 0.0, z], [1.0, 1.0, 1.0]], np.float32), np.zeros((2, 3))) for x, z in course]
        places, landed = settled(frames, 0.06)
        assert landed.tolist() == [True, False]
        assert places.numpy() == pytest.approx(np.array([[0.03, 0.0, 0.06], [1.0, 1.0, 1.0]]), abs=1e-6)

    def test_without_a_floor_the_last_frame_counts(self):
        frames = [(np.full((1, 3), value, np.float32), np.zeros((1, 3))) for value in (0.5, 0.01)]
        places, landed = settled(frames, None)
        assert not landed.any() and places.tolist() == [[pytest.approx(0.01)] * 3]

    def test_as_the_learned_rollout_tells_it(self, simulator):
        task = funnel(frames=40)
        water, values = task.water(), {"r1": torch.tensor(0.15), "r2": torch.tensor(0.1)}
        environment = Environment.of(task.scene, task.surface(values, water))
        frames = list(every_frame(simulator, environment, water, 40))
        places, landed = settled([(frame.positions.numpy(), None) for frame in frames], task.floor)
        # In floats a particle lands at the floor's height to the last digit, or one below: it has landed then, too.
        assert torch.equal(landed, frames[-1].landed) and torch.allclose(places, frames[-1].positions, atol=1e-5)


class TestShapeFiles:
    def test_are_closed_and_in_the_units_of_their_readers(self, tmp_path, monkeypatch):
        monkeypatch.setattr("surfsup.design.shape_files.RESOLUTION", 48)
        stl, glb, obj = write_shape(Bowl(0.1, 0.03), tmp_path, "bowl")
        for path, meter, up in ((stl, 1000, 2), (glb, 1, 1), (obj, 1, 2)):
            mesh = trimesh.load(path, force="mesh")
            assert mesh.is_watertight and mesh.volume > 0
            assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(0.28 * meter, rel=0.01)
            assert mesh.bounds[1, up] == pytest.approx(0.02 * meter, rel=0.05)

    def test_hold_no_slivers_whose_corners_a_reader_would_merge(self):
        box = trimesh.creation.box()
        vertices = np.vstack([box.vertices, box.vertices[0] + [1e-9, 0.0, 0.0]])
        first_corner = np.argwhere(box.faces == 0)
        faces = box.faces.copy()
        faces[tuple(first_corner[0])] = 8
        assert closed(trimesh.Trimesh(vertices, faces, process=False), "a box").is_watertight

    def test_hold_no_specks_smaller_than_a_particle(self):
        box, speck = trimesh.creation.box(extents=(0.2, 0.2, 0.2)), trimesh.creation.box(extents=(0.01, 0.01, 0.01))
        speck.apply_translation((0.0, 0.0, 0.3))
        assert closed(trimesh.util.concatenate([box, speck]), "a box and a speck").volume == pytest.approx(0.008)

    def test_of_what_is_not_closed_are_refused(self):
        open_mesh = trimesh.creation.box().submesh([range(6)], append=True)
        with pytest.raises(InputError, match="it cannot be printed"):
            closed(open_mesh, "half a box")


class TestSearchesWithoutGradients:
    def test_keep_to_the_ranges_and_begin_at_the_start(self):
        box = Box(bowl())
        point = box.flat({"r1": torch.tensor(0.07), "r2": torch.tensor(0.05)})
        assert {name: float(value) for name, value in box.values(point).items()} == pytest.approx(
            {"r1": 0.07, "r2": 0.05}, rel=1e-4
        )
        assert float(box.values(np.array([0.0, 1.0]))["r2"]) == pytest.approx(0.8 * 0.06)

    def test_find_the_top_of_a_hill(self):
        def score(values):
            return -float((values["r1"] - 0.2) ** 2 + values["r2"] ** 2)

        for search in (evolution, random_search):
            found = first(search(bowl(), score, 0), 120)
            assert len(found) == 120
            assert max(reward for _, reward in found) > -1e-3

    def test_take_what_cannot_be_scored_as_worst(self, simulator):
        assert by_model(funnel(frames=3), simulator)({"r1": torch.tensor(0.1), "r2": torch.tensor(0.09)}) == WORST


class TestTheVerdict:
    def test_is_the_solvers(self, simulator, tmp_path, monkeypatch):
        monkeypatch.setattr("surfsup.design.shape_files.RESOLUTION", 32)
        run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=2))
        proof = prove(run, lambda done, total: None)
        assert proof.holds == (proof.best.true > proof.first.true)
        assert ("holds" if proof.holds else "FAILS") in proof.text()
        assert proof.best.learned == pytest.approx(run.rewards[run.best], abs=1e-5)
        with Trajectory(tmp_path / "best" / "solver.h5") as frames:
            assert len(frames) == 7
            assert frames.scene.build_surface() is not None
