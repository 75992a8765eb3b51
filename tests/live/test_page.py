"""The live page, clicked on in headless Chromium.

Without a GPU the browser draws on the processor and may lag far behind on a busy machine. So few pictures are sent, and
the water stands still except where a test needs it to run.
"""

import shutil
import socket
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import surfsup as sf
from surfsup.live import serve
from surfsup.live.drawn_water import colors_of, speed_colors
from surfsup.live.page import LivePage, tilted_gravity
from surfsup.live.serve import LiveServer
from surfsup.live.world import LiveWorld
from surfsup.scene import Scene
from surfsup.scene.liquid import LIQUIDS

pytest.importorskip("viser")
SCENE = """
container: {size: [0.6, 0.6, 1]}
surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}
fluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.5]}}]
"""
TIMEOUT = 120  # seconds
CHROMIUM = shutil.which("chromium")
FLAGS = [
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-quic", "--no-first-run",
]  # fmt: skip


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server that runs in a thread, and its address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    folder = tmp_path_factory.mktemp("live")
    patch = pytest.MonkeyPatch()
    patch.setattr(serve, "PICTURES", 4.0)
    server, ended = LiveServer(Scene.from_yaml(SCENE, "test"), folder, port=port), threading.Event()
    loop = threading.Thread(target=server.run, args=(ended.is_set,))
    loop.start()
    yield server, f"http://127.0.0.1:{port}"
    ended.set()
    patch.undo()
    loop.join(30)
    server.close()
    assert not loop.is_alive()


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def opened(served, browser):
    """The page."""
    page = browser.new_page(viewport={"width": 360, "height": 300})
    page.set_default_timeout(TIMEOUT * 1000)
    page.goto(served[1])
    page.get_by_role("button", name="Reset").wait_for()
    yield page
    page.close()


@pytest.fixture
def page(served, opened):
    """The page, paused."""
    if not served[0]._page.paused:
        served[0]._page._toggle_pause()
    return opened


def wait_for(condition, seconds=TIMEOUT):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


def click(page, name):
    # As an event, because a real click waits until the picture stands still, which takes seconds without a GPU.
    page.get_by_role("button", name=name, exact=True).dispatch_event("click")


def test_water_runs_pauses_steps_and_starts_anew(served, page):
    world = served[0]._world
    click(page, "Resume")
    wait_for(lambda: world.simulation.time > 0.05)
    page.get_by_text("of real time").wait_for()
    click(page, "Pause")
    page.get_by_text("paused").wait_for()
    time.sleep(0.2)
    time_then = world.simulation.time
    click(page, "Step")
    wait_for(lambda: world.simulation.time > time_then)
    assert world.simulation.time == pytest.approx(time_then + 0.005)
    click(page, "Reset")
    wait_for(lambda: world.simulation.time == 0)


def test_water_is_poured_recorded_and_tilted_and_the_solid_moves(served, page):
    world = served[0]._world
    click(page, "Reset")
    page.get_by_text("back at the start").wait_for()
    click(page, "Record")
    wait_for(lambda: world.recording is not None)
    path, count = world.recording, len(world.frame.positions)
    click(page, "Step")
    wait_for(lambda: world.simulation.time > 0)
    click(page, "Pour")
    page.get_by_text("particles poured").wait_for()
    assert len(world.frame.positions) > count
    click(page, "Stop recording")
    page.get_by_text("recorded").wait_for()
    with sf.Trajectory(path) as trajectory:
        assert [len(trajectory.ids(frame)) for frame in range(2)] == [count, len(world.frame.positions)]

    page.get_by_role("button", name="right", exact=True).or_(
        page.get_by_text("right", exact=True)
    ).first.dispatch_event("click")
    click(page, "Resume")
    wait_for(lambda: world.frame.poses["solid"].position[0] > 0.04)
    click(page, "Pause")

    tilt = page.get_by_role("slider").nth(5)  # after those of the block and of the tap: the tilt about y
    tilt.focus()
    for _ in range(5):
        tilt.press("ArrowRight")
    wait_for(lambda: world._gravity[0] < -0.1)

    page.get_by_role("combobox", name="viscosity").click()
    page.get_by_role("option", name="0.3").click()
    wait_for(lambda: world.simulation._liquid is not None and world.simulation._liquid.viscosity == 0.3)

    page.get_by_role("combobox", name="radius").click()
    page.get_by_role("option", name="20").click()
    wait_for(lambda: world.scene.particle_radius == 0.02)


def test_a_tap_is_opened_changed_and_closed(served, page):
    world = served[0]._world
    click(page, "Reset")
    page.get_by_text("back at the start").wait_for()
    count = len(world.frame.positions)
    click(page, "Open tap")
    page.get_by_text("the tap is open: 4 liters a second").wait_for()
    page.get_by_role("button", name="Close tap").wait_for()

    click(page, "Resume")
    wait_for(lambda: len(world.frame.positions) > count + 40)
    click(page, "Pause")
    flow = page.get_by_role("slider").nth(3)  # after those of the block and of the opening
    flow.focus()
    flow.press("ArrowRight")
    wait_for(lambda: world.tap.flow == pytest.approx(4.1))

    click(page, "Close tap")
    page.get_by_text("the tap is closed").wait_for()
    assert world.tap is None
    page.get_by_role("button", name="Open tap").wait_for()


def test_a_browser_that_left_does_not_end_it(served, browser):
    server, address = served
    if server._page.paused:
        server._page._toggle_pause()
    for _ in range(2):
        page = browser.new_page(viewport={"width": 360, "height": 300})
        page.goto(address, timeout=TIMEOUT * 1000)
        time_then = server._world.simulation.time
        wait_for(lambda time_then=time_then: server._world.simulation.time != time_then)
        page.close()


def test_pictures_that_a_slow_browser_does_not_take_are_dropped(tmp_path):
    # A browser that reads nothing for a while, then everything: it gets the newest picture, and few of those before.
    import viser
    from websockets.sync.client import connect

    world, particles, pictures = LiveWorld(Scene.from_yaml(SCENE, "test"), tmp_path), 40_000, 60
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = viser.ViserServer("127.0.0.1", port, verbose=False)
    page = LivePage(server, world)
    positions = np.random.default_rng(0).random((pictures, particles, 3), np.float32)
    with socket.create_connection(("127.0.0.1", port)) as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        protocol = f"viser-v{viser.__version__}"
        address, limits = f"ws://127.0.0.1:{port}", {"max_size": None, "max_queue": 1, "ping_interval": None}
        with connect(address, sock=slow, subprotocols=[protocol], **limits) as browser:
            for places in positions:
                page.show(replace(world.frame, positions=places, velocities=np.zeros_like(places)), world)
                time.sleep(1 / 40)
            received, newest = 0, positions[-1].astype(np.float16).tobytes()  # as viser sends them
            while True:
                message = browser.recv(timeout=10)
                received += len(message)
                if newest in message:
                    break
    server.stop()
    assert received < 0.5 * pictures * (len(newest) + 3 * particles), "bytes of all positions and colors"


def test_fast_water_is_white_and_slow_water_blue():
    colors = speed_colors(np.array([[0, 0, 0], [0, 3.0, 0]], np.float32), 3.0).astype(int)
    assert colors[0, 2] > 2 * colors[0, 0] and colors[1].min() > 230


def test_honey_is_amber():
    palette, surface = colors_of(LIQUIDS["honey"])
    assert surface[0] > surface[1] > surface[2]
    slow = speed_colors(np.zeros((1, 3), np.float32), 3.0, palette).astype(int)[0]
    assert slow[0] > 2 * slow[2]


def test_gravity_keeps_its_strength_when_it_is_tilted():
    down = (0.0, 0.0, -9.81)
    np.testing.assert_allclose(tilted_gravity(down, 0, 0), down, atol=1e-9)
    np.testing.assert_allclose(tilted_gravity(down, np.pi / 2, 0), (0, 9.81, 0), atol=1e-9)
    np.testing.assert_allclose(tilted_gravity(down, 0, np.pi / 2), (-9.81, 0, 0), atol=1e-9)
    assert np.linalg.norm(tilted_gravity((1.0, 2.0, -3.0), 0.4, -1.0)) == pytest.approx(14**0.5)
