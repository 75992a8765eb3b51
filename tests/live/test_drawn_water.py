"""The water of a page, as viser sends it."""

import socket
import time
from dataclasses import replace

import numpy as np
import pytest

from surfsup.live.drawn_water import PARTICLES, SURFACE, WATER_COLOR, DrawnWater, colors_of
from surfsup.live.liquid_choice import liquid_name
from surfsup.live.page import LivePage
from surfsup.live.world import LiveWorld
from surfsup.scene import Scene
from surfsup.scene.liquid import LIQUIDS, Liquid
from surfsup.simulation import Simulation

viser = pytest.importorskip("viser", reason="needs the extra 'live'")


@pytest.fixture
def server():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = viser.ViserServer("127.0.0.1", port, verbose=False)
    yield server
    server.stop()


def show_surfaces(drawn, frame):
    """Show the surfaces of a frame and wait until they are there."""
    drawn.show(frame, SURFACE, 0.015)
    end = time.monotonic() + 60
    while not drawn.is_up_to_date:
        assert time.monotonic() < end
        time.sleep(0.01)
        drawn.update()


def test_while_a_surface_is_made_only_the_newest_frame_waits(server):
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.3]}}]", "test")
    drawn, frame = DrawnWater(server, scene), Simulation(scene).frame
    places = [replace(frame, positions=frame.positions + np.float32([x, 0, 0])) for x in range(5)]
    for moved in places:
        drawn.show(moved, SURFACE, 0.015)
    show_surfaces(drawn, places[-1])
    assert drawn._shapes["surface-0"].vertices[:, 0].mean() == pytest.approx(4, abs=0.02)


def test_each_liquid_has_its_color_as_particles_and_a_surface_of_its_own(server):
    scene = Scene.from_yaml(
        "fluid:\n- block: {min: [-0.3, -0.1, 0.1], max: [-0.1, 0.1, 0.3]}\n"
        "- {block: {min: [0.2, -0.1, 0.1], max: [0.4, 0.1, 0.3]}, liquid: oil}",
        "test",
    )
    drawn, frame = DrawnWater(server, scene), Simulation(scene).frame
    drawn.show(frame, PARTICLES, 0.015)
    colors = drawn._shapes[PARTICLES].colors.astype(int)
    water, oil = (colors[frame.liquids == number] for number in (0, 1))
    assert (water[:, 2] > water[:, 0]).all() and (oil[:, 0] > oil[:, 2]).all()

    show_surfaces(drawn, frame)
    assert sorted(drawn._shapes) == ["surface-0", "surface-1"]
    assert [drawn._shapes[f"surface-{number}"].color for number in (0, 1)] == [
        WATER_COLOR,
        colors_of(LIQUIDS["oil"])[1],
    ]
    assert drawn._shapes["surface-1"].vertices[:, 0].min() > 0.15

    drawn.show(Simulation(scene.with_changes(frames=1)).frame, PARTICLES, 0.015)
    assert list(drawn._shapes) == [PARTICLES]


def test_a_surface_leaves_with_the_last_particle_of_its_liquid(server):
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.3]}}]", "test")
    drawn, frame = DrawnWater(server, scene), Simulation(scene).frame
    show_surfaces(drawn, frame)
    assert drawn._shapes
    nothing = np.zeros((0, 3), np.float32)
    show_surfaces(drawn, type(frame)(frame.time, nothing, nothing))
    assert not drawn._shapes


def test_a_liquid_is_called_by_its_name_or_its_density():
    assert [liquid_name(liquid) for liquid in (LIQUIDS["oil"], Liquid(density=850))] == ["oil", "850 kg/m³"]


def test_a_page_of_two_liquids_lets_one_choose_and_starts_anew(server, tmp_path):
    scene = Scene.from_yaml(
        "container: {size: [0.6, 0.6, 1]}\nfluid:\n- block: {min: [-0.2, -0.2, 0.02], max: [0, 0.2, 0.2]}\n"
        "- {block: {min: [0.02, -0.2, 0.02], max: [0.2, 0.2, 0.2]}, liquid: oil}",
        "test",
    )
    world = LiveWorld(scene, tmp_path)
    page = LivePage(server, world)
    assert page._viscosity is None, "viscosities of several liquids stay"
    page._tap._liquid = lambda: 1
    page._tap._toggle(world)
    assert world.tap.liquid == LIQUIDS["oil"]
    assert page._reset(world) == "back at the start" and world.tap is None
    assert "particles of 20 mm" in page._restart(world, 0.02)
