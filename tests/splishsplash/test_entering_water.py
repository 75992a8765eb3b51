import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.splishsplash import solver
from surfsup.splishsplash.entering_water import EnteringWater, with_ids

JET = """
container: {size: [0.6, 0.6, 0.8]}
gravity: [0, 0, %g]
fluid: [{block: {min: [-0.2, -0.2, 0.05], max: [-0.05, -0.05, 0.2]}}]
taps: [{disc: {radius: 0.07}, at: [-0.2, 0.1, 0.5], direction: [1, 0, 0], speed: 2, until: 0.1}]
frames: %d
"""


def reference_frames(scene):
    solids = build_solids(scene)
    start = scene.initial_particles(solids.at_time(0.0))
    return [with_ids(scene, *frame, {}) for frame in solver.simulate(scene, solids.still, start)]


def test_particles_have_the_ids_and_the_places_that_they_have_in_our_solver():
    scene = Scene.from_yaml(JET % (0, 41), "test")
    ours = list(sf.Simulation(scene).run())
    for frame, (positions, velocities, _, ids) in zip(ours, reference_frames(scene), strict=True):
        np.testing.assert_array_equal(ids, frame.ids)
        jet = ids >= ours[0].ids[-1] + 1
        np.testing.assert_allclose(positions[jet], frame.positions[jet], atol=1e-4)
        np.testing.assert_allclose(velocities[jet], frame.velocities[jet], atol=3e-3)


def test_drains_take_water_in_the_reference_too():
    scene = Scene.from_yaml(JET % (-9.81, 81) + "drains: [{box: {size: [0.6, 0.6, 0.1]}}]", "test")
    frames = reference_frames(scene)
    assert frames[-1][3][0] > 0 and (np.diff(frames[-1][3]) > 0).all()
    assert frames[-1][0][:, 2].min() > 0.05
    ours = list(sf.Simulation(scene).run())
    assert len(frames[-1][3]) == pytest.approx(len(ours[-1].ids), abs=40)


def test_the_table_guides_each_layer_and_then_releases_it():
    scene = Scene.from_yaml(JET % (-9.81, 41), "test")
    start = scene.initial_particles(None)
    water = EnteringWater.of(scene, Solids(None), start, 41)
    table = water.table()
    layer = water.layers[3]
    rows = table[table[:, 1] == layer.ids[5]]
    assert (rows[:-1, 2] == 0).all() and rows[-1, 2] == 1 and (np.diff(rows[:, 0]) == 1).all()
    assert rows[0, 0] * 0.001 == pytest.approx(layer.time, abs=0.001)
    assert water.first_frames[layer.ids[0]] * FRAME_TIME == pytest.approx(layer.time, abs=FRAME_TIME)
    nozzle = water.passages.taps.nozzles[0]
    expected = nozzle.points[5] + (rows[:, :1] * 0.001 - layer.time) * nozzle.velocity
    np.testing.assert_allclose(rows[:, 3:6], expected, atol=1e-12)
    assert len(water.parked) == water.count - len(start.positions)
    assert np.linalg.norm(np.diff(water.parked, axis=0), axis=1).min() > 0.06


def test_taps_that_recycle_are_refused_in_one_line():
    scene = Scene.from_yaml(JET.replace("speed", "recycle: true, speed") % (0, 3), "test")
    with pytest.raises(InputError, match="the reference solver knows no taps that recycle; use the simulator dfsph"):
        reference_frames(scene)
