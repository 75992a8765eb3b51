"""Pictures a second of the live page in headless Chromium, and whether it keeps real time.

    python benchmarks/live.py [--particles 3000] [--seconds 20] [--threads 1]

Water falls on a ball. The server's pictures and simulated seconds are counted in the process that
simulates, as the page shows them; the browser's own pictures are the calls of requestAnimationFrame. Without a GPU the
browser draws on the processor. The mean number of busy processes on the machine (load average over a minute) comes
along, because other work slows both.

Needs the extra `live`, playwright and Chromium. The results are written to `benchmarks/results/live.json`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import tempfile
import threading
import time
from pathlib import Path

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
COUNT = "window.pictures = 0; (function next() { window.pictures++; requestAnimationFrame(next); })()"


def scene(particles: int) -> Scene:
    """A block of about that many particles above a ball."""
    height = particles / 14**2 * SPACING  # 14 particles fit into 0.46 m
    return Scene.from_yaml(SCENE.format(top=round(0.45 + height, 3)), "benchmark")


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--threads", type=int, default=1)
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
            page = browser.new_page(viewport={"width": 1000, "height": 800})
            page.goto(f"http://127.0.0.1:{port}", timeout=120_000)
            page.get_by_text("of real time").wait_for(timeout=120_000)
            page.evaluate(COUNT)
            world, start = server._world, time.monotonic()
            simulated, pictures = world.simulation.time, page.evaluate("window.pictures")
            rates = []
            while time.monotonic() < start + arguments.seconds:
                time.sleep(0.5)
                rates.append(server._rates.pictures)
            elapsed = time.monotonic() - start
            values = {
                "particles": len(world.frame.positions),
                "pictures_sent_per_second": round(sum(rates) / len(rates), 1),
                "pictures_drawn_per_second": round((page.evaluate("window.pictures") - pictures) / elapsed, 1),
                "of_real_time": round((world.simulation.time - simulated) / elapsed, 3),
                "seconds": round(elapsed, 1),
                "threads": arguments.threads,
                "load_average": round(os.getloadavg()[0], 1),
            }
            browser.close()
        finally:
            ended.set()
            loop.join()
            server.close()
    print(values)
    write_result(
        "live",
        f"Pictures a second of the live page in headless Chromium without a GPU, {values['particles']:,} particles",
        values["pictures_drawn_per_second"],
        "pictures/s",
        None,
        None,
        f"python benchmarks/live.py --particles {arguments.particles}",
        values,
        arguments.threads,
    )


if __name__ == "__main__":
    main()
