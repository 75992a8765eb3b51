"""What the live page takes in real time, and the pictures a second that headless Chromium draws.

    python benchmarks/live.py [--particles 3000] [--seconds 20] [--threads 1] [--window 1000 800]

Water falls on a ball. The server's pictures and simulated seconds are counted in the process that
simulates, as the page shows them; the browser's own pictures are the calls of requestAnimationFrame. Without a GPU the
browser draws on the processor. Other work on the machine slows both, so the mean number of busy processes (load average
over a minute) comes along, and the processor's time for a step, for a picture and for drawing one, which other work
changes little.

Needs the extra `live`, playwright, psutil and Chromium. The results are written to `benchmarks/results/live.json`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import torch
from playwright.sync_api import sync_playwright

from record import write_result
from surfsup.live.serve import LiveServer
from surfsup.scene import Scene

SCENE = """
surface: {{sphere: {{radius: 0.2}}, at: [0, 0, 0.2]}}
fluid: [{{block: {{min: [-0.23, -0.23, 0.45], max: [0.23, 0.23, {top}]}}}}]
"""
SPACING = 0.03  # meters
FLAGS = [
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-quic", "--no-first-run",
]  # fmt: skip
PICTURES = 40  # a second, which the server sends in real time
COUNT = "window.pictures = 0; (function next() { window.pictures++; requestAnimationFrame(next); })()"


def scene(particles: int) -> Scene:
    """A block of about that many particles above a ball."""
    height = particles / 14**2 * SPACING  # 14 particles fit into 0.46 m
    return Scene.from_yaml(SCENE.format(top=round(0.45 + height, 3)), "benchmark")


class Timed:
    """A function, with the processor's time in its calls.

    Attributes:
        calls: number of calls.
        seconds: of the processor, in the thread that calls.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self.calls, self.seconds = function, 0, 0.0

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        start = time.thread_time()
        result = self._function(*arguments)
        self.seconds += time.thread_time() - start
        self.calls += 1
        return result

    def milliseconds(self) -> float:
        """Of the processor, for a call."""
        return 1000 * self.seconds / max(1, self.calls)


def browser_time() -> float:
    """Seconds of the processor that the browser's processes have taken."""
    times = 0.0
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            used = process.cpu_times()
            times += used.user + used.system
    return times


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--window", type=int, nargs=2, default=(1000, 800), help="of the browser, pixels")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ended = threading.Event()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        server = LiveServer(scene(arguments.particles), Path(folder), port=port)
        loop = threading.Thread(target=server.run, args=(ended.is_set,))
        loop.start()
        try:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            width, height = arguments.window
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(f"http://127.0.0.1:{port}", timeout=120_000)
            page.get_by_text("of real time").wait_for(timeout=120_000)
            page.evaluate(COUNT)
            world = server._world
            step, show = Timed(world.step), Timed(server._page.show)
            world.step, server._page.show = step, show
            start, process, browser_start = time.monotonic(), time.process_time(), browser_time()
            simulated, pictures = world.simulation.time, page.evaluate("window.pictures")
            rates = []
            while time.monotonic() < start + arguments.seconds:
                time.sleep(0.5)
                rates.append(server._rates.pictures)
            elapsed = time.monotonic() - start
            drawn = page.evaluate("window.pictures") - pictures
            send = 1000 * (time.process_time() - process - step.seconds - show.seconds) / max(1, show.calls)
            steps = 1 / world.frame_time
            cores = (steps * step.milliseconds() + PICTURES * (show.milliseconds() + send)) / 1000
            values = {
                "particles": len(world.frame.positions),
                "pictures_sent_per_second": round(sum(rates) / len(rates), 1),
                "pictures_drawn_per_second": round(drawn / elapsed, 1),
                "of_real_time": round((world.simulation.time - simulated) / elapsed, 3),
                "processor_ms_per_step": round(step.milliseconds(), 2),
                "processor_ms_per_picture": round(show.milliseconds(), 2),
                "processor_ms_to_send_a_picture": round(send, 2),
                "cores_for_real_time": round(cores, 2),
                "processor_ms_per_picture_in_the_browser": round(1000 * (browser_time() - browser_start) / drawn, 1),
                "seconds": round(elapsed, 1),
                "threads": arguments.threads,
                "window": list(arguments.window),
                "load_average": round(os.getloadavg()[0], 1),
            }
            browser.close()
        finally:
            ended.set()
            loop.join()
            server.close()
    print(values)
    write_result(
        "live" if tuple(arguments.window) == (1000, 800) else f"live_{width}x{height}",
        f"Cores that the live page's server takes for real time and {PICTURES} pictures a second, "
        f"{values['particles']:,} particles",
        values["cores_for_real_time"],
        "cores",
        None,
        None,
        f"python benchmarks/live.py --particles {arguments.particles}"
        + ("" if tuple(arguments.window) == (1000, 800) else f" --window {width} {height}"),
        values,
        arguments.threads,
    )


if __name__ == "__main__":
    main()
