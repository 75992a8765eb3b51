"""Emitters and taps: the same openings, lattices, times and amounts of water."""

import math

import numpy as np
import pytest

from surfsup.scene import Scene
from surfsup.scene.taps import Tap
from surfsup.splishsplash.emitters import closing_times, emitter_of, opening, particles_in_layer, turn_of
from surfsup.splishsplash.scene_export import export_scene
from surfsup.splishsplash.scene_import import import_scene

SPACING = 0.04
BOX = {"width": 8, "height": 3, "translation": [0, 0, 0], "velocity": 2}


def test_an_opening_has_whole_particles():
    assert opening(BOX, SPACING) == {"rectangle": {"size": [0.32, 0.12]}}
    assert opening({"type": 1, "width": 6.9}, SPACING) == {"disc": {"radius": 0.12}}, "the solver cuts a width off"
    assert opening({}, SPACING) == {"rectangle": {"size": [0.2, 0.2]}}, "its defaults"


def test_a_rectangle_is_turned_about_its_direction():
    direction = np.array([1.0, 0, 0])
    assert turn_of(direction, np.array([0, 1.0, 0])) == 0, "the first side is horizontal"
    assert turn_of(direction, np.array([0, 0, 1.0])) == 90
    assert turn_of(direction, np.array([0, -1.0, 0])) == 0, "half a turn changes nothing"


def test_an_emitter_closes_at_its_time_or_when_its_liquid_is_used_up():
    layer, interval = 24, SPACING / 2
    timed = [{**BOX, "emitEndTime": 3}, {**BOX, "id": "oil", "emitStartTime": 1}]
    assert closing_times(timed, SPACING, {"Fluid": 1e9, "oil": 1e4}) == [
        3,
        pytest.approx(1 + 1e4 // layer * interval),
    ]
    shared = [BOX, {**BOX, "emitStartTime": 10 * interval}]
    # Ten layers of the first, then two at a time.
    ends = closing_times(shared, SPACING, {"Fluid": 20 * layer})
    assert ends == [pytest.approx(15 * interval)] * 2
    assert closing_times([BOX], SPACING, {}) == [math.inf]


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, -1), (1, -2, 0.5), (-1, 0, 0)])
def test_a_tap_as_emitter_and_back_is_the_same(direction, tmp_path):
    scene = Scene(
        particle_radius=SPACING / 2,
        container={"size": (2, 2, 2)},
        taps=[
            Tap(rectangle={"size": (0.32, 0.12)}, at=(0.1, 0, 1), direction=direction, turn=30, speed=2, **{"from": 1}),
            Tap(disc={"radius": 0.12}, at=(0, 0.3, 1), direction=direction, speed=1, until=2),
        ],
        duration=1,
    )
    exported = export_scene(scene, tmp_path / "a.json")
    assert [phrase for phrase in exported.missing if "tap 0" in phrase] == []
    exported.write()
    back = Scene.from_yaml(import_scene(tmp_path / "a.json", tmp_path / "b.yaml").text, "b", tmp_path)
    for one, other in zip(scene.taps, back.taps, strict=True):
        ours, theirs = one.nozzle(SPACING), other.nozzle(SPACING)
        assert ours.speed == theirs.speed and (ours.start, ours.until) == (theirs.start, theirs.until)
        np.testing.assert_allclose(theirs.axes[2], ours.axes[2], atol=1e-8)
        order, expected = (np.lexsort(np.round(nozzle.points, 6).T) for nozzle in (theirs, ours))
        np.testing.assert_allclose(theirs.points[order], ours.points[expected], atol=1e-6)


def test_a_flow_that_whole_particles_do_not_have_is_said(tmp_path):
    tap = Tap(disc={"radius": 0.05}, at=(0, 0, 1), speed=1)
    emitter, share = emitter_of(tap, SPACING)
    assert share == pytest.approx(particles_in_layer(emitter) * SPACING**2 / (math.pi * 0.05**2))
    scene = Scene(particle_radius=SPACING / 2, taps=[tap], duration=1)
    assert f"{share:.2f} times" in " ".join(export_scene(scene, tmp_path / "a.json").missing)
