"""The server of a live page, and its loop in real time."""

from __future__ import annotations

import io
import socket
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib.util import find_spec
from pathlib import Path

from surfsup.errors import InputError, SimulationError
from surfsup.live.page import LivePage
from surfsup.live.real_time import Rates, RealTime
from surfsup.live.world import MAX_PARTICLES, LiveWorld
from surfsup.scene import Scene

PICTURES = 40.0  # per second at most
LONGEST = 1 / 32  # seconds of steps before a picture
IDLE = 0.05  # seconds between two checks for commands while nothing runs
REPORT = 0.25  # seconds between two updates of the rates


def require_viser() -> None:
    """Ensure that the extra is installed.

    Raises:
        InputError: it is not; the message has the command that installs it.
    """
    if find_spec("viser") is None:
        raise InputError("the live page needs viser: pip install 'surfsup[live]'")


def require_port(host: str, port: int) -> None:
    """Ensure that a port can be opened; viser would take another one without a word.

    Raises:
        InputError: it cannot.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise InputError(
            f"port {port} of {host} cannot be opened ({error.strerror}); choose another by --port"
        ) from None


class LiveServer:
    """Water in real time on a page.

    Args:
        scene: of the start.
        folder: of the recordings.
        host, port: address of the page.

    Raises:
        InputError: viser is missing, the port is in use, or the scene cannot be simulated.
    """

    def __init__(self, scene: Scene, folder: Path, host: str = "127.0.0.1", port: int = 8080) -> None:
        require_viser()
        require_port(host, port)
        import viser

        self._world = LiveWorld(scene, folder)
        with redirect_stdout(io.StringIO()):  # a banner, also where it shall not be verbose
            self._server = viser.ViserServer(host, port, label="surfsup live", verbose=False)
        self._page = LivePage(self._server, self._world)
        self._rates, self._reported = Rates(), 0.0

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until a condition holds; without a browser, and no recording, the water waits."""
        world, timing, clock = self._world, RealTime(self._world.frame_time, time.monotonic()), time.monotonic
        while not until():
            self._obey()
            timing.frame_time = world.frame_time
            watched = bool(self._server.get_clients()) or world.recording is not None
            drawn = self._page.update()
            if self._page.paused or not watched:
                time.sleep(IDLE)
                timing.restart(clock())
                self._report(clock())
                continue
            # Steps come first, for real time; pictures are due even where the steps take longer than that.
            start, before = clock(), world.simulation.time
            while timing.due(clock()) and clock() < start + LONGEST and self._step():
                pass
            if world.simulation.time != before:
                drawn |= self._page.show(world.frame, world)
            self._rates.count(clock(), world.simulation.time - before, drawn)
            self._report(clock())
            time.sleep(max(0.0, start + 1 / PICTURES - clock()))

    def close(self) -> None:
        """Finish a recording and close the page."""
        self._world.stop_recording()
        self._server.stop()

    def _obey(self) -> None:
        """Do what the page wants done."""
        while not self._page.commands.empty():
            was_recording = self._world.recording is not None
            try:
                done = self._page.commands.get()(self._world)
            except (InputError, SimulationError) as error:
                done = str(error)
            if done:
                self._page.report(done)
            if was_recording and self._world.recording is None:
                self._page.recording_ended()

    def _step(self) -> bool:
        """One step; a simulation that fails returns to its start."""
        try:
            self._world.step()
        except SimulationError as error:
            self._world.reset()
            self._page.report(f"{error}; back at the start")
            return False
        if self._world.tap is not None and self._world.is_full:
            self._world.close_tap()
            self._page.report(f"the tap is closed: more than {MAX_PARTICLES:,} particles cannot be live")
        return True

    def _report(self, now: float) -> None:
        if now >= self._reported + REPORT:
            self._page.show_rates(self._world, self._rates.pictures, self._rates.speed)
            self._reported = now
