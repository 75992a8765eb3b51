"""The picture of the live page: a tap is open over the knot, in headless Chromium.

    python benchmarks/live_picture.py [docs/images/live.png]

Needs the extra `live`, playwright and Chromium.
"""

from __future__ import annotations

import io
import shutil
import socket
import sys
import tempfile
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from live import FLAGS
from record import ROOT
from surfsup.live.serve import LiveServer
from surfsup.scene import Container
from surfsup.scene.from_surface import Placement, scene_from_surface

SIZE = {"width": 1100, "height": 930}
SECONDS = 1.6  # of the falling block, then of the tap
SETTLED = 8000  # milliseconds after which the browser has drawn everything, also without a GPU


def main() -> None:
    """Take the picture."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images" / "live.png"
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ended = threading.Event()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        scene, _ = scene_from_surface(ROOT / "examples" / "knot.obj", Placement(), Container(), None, 1)
        server = LiveServer(scene, Path(folder), port=port)
        world, page = server._world, server._page
        for _ in range(round(SECONDS / world.frame_time)):
            world.step()
        page._tap._toggle(world)
        for _ in range(round(SECONDS / world.frame_time)):
            world.step()
        page._toggle_pause()
        page.show(world.frame, world)
        loop = threading.Thread(target=server.run, args=(ended.is_set,))
        loop.start()
        try:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            tab = browser.new_page(viewport=SIZE)
            tab.goto(f"http://127.0.0.1:{port}", timeout=120_000)
            tab.get_by_text("Close tap").wait_for(timeout=120_000)
            tab.wait_for_timeout(SETTLED)
            with_warning = tab.get_by_text("Software WebGL rendering detected")
            if with_warning.count():  # without a GPU
                tab.locator(".mantine-Notification-closeButton").first.dispatch_event("click")
                tab.wait_for_timeout(SETTLED / 4)
            picture = Image.open(io.BytesIO(tab.screenshot(timeout=120_000))).convert("RGB")
            picture.quantize(256, dither=Image.Dither.NONE).save(out, optimize=True)  # a third of the size
            browser.close()
        finally:
            ended.set()
            loop.join()
            server.close()


if __name__ == "__main__":
    main()
